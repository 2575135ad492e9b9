//! What holds for the options of all commands: their groups in `--help`, and the spellings of
//! GDAL's users.

use std::ffi::OsString;

use clap::Command;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::ErrorKind;

/// Groups of options, by the names of their fields. What is in no group chooses the method.
const GROUPS: [(&str, &[&str]); 5] = [
    (
        "Inputs",
        &[
            "classes",
            "mask",
            "dtm",
            "confidence",
            "buildings",
            "dem",
            "reference_dem",
            "reference_plane",
            "dem_vertical",
            "prior",
            "control",
            "corrections",
            "ortho",
            "maps",
            "lod",
            "all_objects",
            "ref_cell",
            "test_vertical",
            "ref_vertical",
            "dsm_vertical",
            "surface_vertical",
            "before_vertical",
            "after_vertical",
            "sigma_m",
            "ndvi",
            "index",
            "areas",
            "areas_layer",
            "areas_field",
            "source_crs",
            "source_vertical",
            "positions_vertical",
            "offset",
            "transform",
            "image_size",
            "pictures",
            "cameras",
            "camera",
            "center",
            "positions",
            "page",
            "images",
        ],
    ),
    (
        "Output",
        &[
            "output",
            "gsd",
            "crs",
            "force",
            "bounds",
            "bounds_crs",
            "vertical",
            "format",
            "encoding",
            "geotiff",
            "extras",
            "products",
            "only",
            "filled",
            "previews",
            "no_preview",
            "html",
            "no_report",
            "error_map",
            "report",
            "render",
            "noise_output",
            "overwrite",
        ],
    ),
    ("Requirements (exit code 1 when missed)", &["max_mae", "min_completeness", "max_rmse"]),
    ("Run", &["threads", "memory", "chunk", "tile", "port", "seconds", "open", "allow_remote", "fetch_grids"]),
    ("Messages", &["progress", "json", "quiet", "verbose", "help", "version"]),
];

/// GDAL's options and the names of the fields of ours.
const OF_GDAL: [(&str, &str); 5] =
    [("-t_srs", "crs"), ("-te", "bounds"), ("-te_srs", "bounds_crs"), ("-tr", "gsd"), ("-overwrite", "overwrite")];

/// A value of an option with its name and, for the help, its meaning. The `CHOICES` of enums are
/// such values.
pub(crate) type Named<T> = (&'static str, T, &'static str);

/// Parses the values of an option by their names.
pub(crate) fn named<T: Clone + Send + Sync + 'static>(values: &'static [Named<T>]) -> impl TypedValueParser<Value = T> {
    let shown = values.iter().map(|(name, _, about)| PossibleValue::new(name).help(about));
    PossibleValuesParser::new(shown).try_map(move |name| {
        let value = values.iter().find(|(other, ..)| *other == name);
        value.map(|(_, value, _)| value.clone()).ok_or("not a value of this option")
    })
}

/// Puts the options of a command and of its subcommands into their groups.
pub(crate) fn grouped(command: Command) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|below| below.get_name().to_owned()).collect();
    let command = names.into_iter().fold(command, |command, name| command.mut_subcommand(name, grouped));
    command.mut_args(|option| {
        let is_new = option.get_help_heading().is_none() && !option.is_positional();
        match GROUPS.iter().find(|(_, names)| is_new && names.contains(&option.get_id().as_str())) {
            Some((group, _)) => option.help_heading(*group),
            None => option,
        }
    })
}

/// Replaces the spellings of GDAL's users by ours, where the command has the option. `-tr` takes
/// one size or two equal ones.
pub(crate) fn without_gdal_spellings(arguments: impl Iterator<Item = OsString>, root: &Command) -> Vec<OsString> {
    let mut arguments: Vec<OsString> = arguments.collect();
    let name = arguments.iter().skip(1).find(|argument| !argument.to_string_lossy().starts_with('-'));
    let Some(command) = name.and_then(|name| root.find_subcommand(name)) else { return arguments };
    let has = |id: &str| command.get_arguments().any(|option| option.get_id() == id);
    let end = arguments.iter().position(|argument| argument == "--").unwrap_or(arguments.len());
    for at in (0..end).rev() {
        let text = arguments[at].to_string_lossy().into_owned();
        let (spelling, value) = text.split_once('=').map_or((text.as_str(), None), |(name, value)| (name, Some(value)));
        let Some((_, ours)) = OF_GDAL.iter().find(|(theirs, ours)| *theirs == spelling && has(ours)) else { continue };
        let size = |after: usize| arguments.get(at + after)?.to_str()?.parse::<f64>().ok().map(f64::abs);
        match (*ours, size(1), size(2)) {
            ("gsd", Some(x), Some(y)) if value.is_none() && x == y => drop(arguments.remove(at + 2)),
            ("gsd", Some(_), Some(_)) if value.is_none() => {
                let text = "the cells are square: -tr takes one size or two equal ones";
                root.clone().error(ErrorKind::InvalidValue, text).exit();
            }
            _ => {}
        }
        let ours = ours.replace('_', "-");
        arguments[at] = value.map_or(format!("--{ours}"), |value| format!("--{ours}={value}")).into();
    }
    arguments
}
