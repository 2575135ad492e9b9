//! `skysweep city`: what is in a city model, and its triangles or footprints in another format.
//!
//! Exit code 1 when parts of the model were lost: objects none of whose surfaces could be used, or
//! surfaces that the reader had to leave out. The report names every object of the file, used or
//! not, with the reason.

use std::path::PathBuf;

use city::Lod;
use jobs::city::{CityConvertConfig, CityInfoConfig, CityInput, CityOutputFormat, CitySummary};
use jobs::error::JobError;

use crate::error::with_hint;
use crate::options::named;
use crate::progress::WriteOptions;
use crate::{Global, Outcome};

/// The commands of `skysweep city`.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Show what is in a city model: format, reference system, levels of detail, objects,
    /// triangles, defects.
    Info(InfoArgs),
    /// Write the triangles (OBJ, PLY, glTF), the footprints with heights (GeoJSON) or the model
    /// (CityJSON 2.0).
    Convert(ConvertArgs),
}

/// What both commands read, and how.
#[derive(Debug, clap::Args)]
struct Input {
    /// City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
    #[arg(value_name = "MODEL")]
    file: PathBuf,
    /// Level of detail, such as 2.2 [default: the highest of each object up to 2.x].
    #[arg(long, value_name = "LOD")]
    lod: Option<Lod>,
    /// Use every object with surfaces, not only buildings.
    #[arg(long)]
    all_objects: bool,
    /// Write what became of every object, with all defects, to this file (JSON). Only with it
    /// solids are checked for shells that meet themselves, cavities outside of their solid, and
    /// parts that overlap (codes 306, 4xx, 5xx, 601).
    #[arg(long, value_name = "REPORT.json")]
    report: Option<PathBuf>,
    #[command(flatten)]
    write: WriteOptions,
}

#[derive(Debug, clap::Args)]
pub(crate) struct InfoArgs {
    #[command(flatten)]
    input: Input,
}

#[derive(Debug, clap::Args)]
pub(crate) struct ConvertArgs {
    #[command(flatten)]
    input: Input,
    /// File to write.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Format to write [default: by the ending of OUT: .obj, .ply, .glb, .geojson or .json].
    #[arg(long, value_parser = named(&CityOutputFormat::CHOICES))]
    format: Option<CityOutputFormat>,
}

/// Runs `skysweep city`.
pub(crate) fn run(command: &Command, global: Global) -> anyhow::Result<Outcome> {
    match command {
        Command::Info(args) => info(args, global),
        Command::Convert(args) => convert(args, global),
    }
}

fn info(args: &InfoArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = CityInfoConfig::new(args.input.file.clone());
    args.input.set(&mut config.input);
    let file = &args.input.file;
    let summary =
        args.input.write.show.watch(global, file, |watcher| jobs::city::info(&config, watcher)).map_err(hinted)?;
    tell(&summary);
    args.input.write.show.print(global, &summary, || summary.text())?;
    Ok(outcome(&summary))
}

fn convert(args: &ConvertArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = CityConvertConfig::new(args.input.file.clone(), args.output.clone());
    args.input.set(&mut config.input);
    config.format = args.format;
    let output = &args.output;
    let report =
        args.input.write.show.watch(global, output, |watcher| jobs::city::convert(&config, watcher)).map_err(hinted)?;
    args.input.write.show.print(global, &report, String::new)?;
    tell(&report.summary);
    Ok(outcome(&report.summary))
}

impl Input {
    fn set(&self, input: &mut CityInput) {
        input.lod = self.lod;
        input.all_objects = self.all_objects;
        input.account = self.report.clone();
        input.overwrite = self.write.overwrite;
    }
}

fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the format") => Some("give --format obj, ply, glb, geojson or cityjson"),
        Some("the level of detail") => {
            Some("--lod chooses a level of detail, such as --lod 3, and --all-objects takes more than buildings")
        }
        _ => None,
    };
    with_hint(error, hint)
}

fn tell(summary: &CitySummary) {
    tracing::info!("{}: {}, {} triangles", summary.source, summary.format, summary.triangles);
}

fn outcome(summary: &CitySummary) -> Outcome {
    let what = "the model is incomplete: objects or surfaces of it cannot be used; --report FILE lists them";
    if summary.incomplete { Outcome::Partial(what.to_owned()) } else { Outcome::Complete }
}
