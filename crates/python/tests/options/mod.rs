//! Settings of the jobs that the command line lacks.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use syn::Type;

use super::Types;
use super::catalogue::JOBS;

/// Settings without an option, by their type and name, with the reason. All of a type without a
/// name.
const WITHOUT: [(&str, &str, &str); 8] = [
    ("BuildingIndexConfig", "", "the constants of a published method"),
    ("BuildingMapConfig", "index", "it holds nothing but those"),
    ("ClassifyConfig", "", "what a tree, a roof and water are does not change with the place"),
    ("ChangeConfig", "overreach_growth", "the surfaces say which program made them, and that decides"),
    ("ChangeConfig", "overreach_sigma_m", "as for its growth"),
    ("GroundConfig", "lowest_object_m", "what an object is does not change with the place"),
    ("GroundConfig", "storey_m", "as for the lowest object"),
    ("SimulationConfig", "", "a scene file has them all"),
];

/// How the names of types of settings end.
const CONFIG: &str = "Config";

/// Returns `Type.setting` of each setting of a job that no source of its command names, and each
/// exception of [`WITHOUT`] that is none.
pub(crate) fn missing(crates: &Path, types: &Types) -> Vec<String> {
    let cli = crates.join("cli");
    let shared = sources(&cli);
    let commands = sources(&cli.join("commands"));
    let mut found = BTreeSet::new();
    for job in JOBS.iter().filter(|job| job.config.ends_with(CONFIG)) {
        look(job.config, job.required, &|name| mentions(&commands, name), &shared, types, &mut found);
    }
    let excused = |(of, setting): &(String, String)| {
        WITHOUT.iter().any(|(other, name, _)| other == of && (name.is_empty() || name == setting))
    };
    let without_reason = found.iter().filter(|setting| !excused(setting));
    let lines = without_reason.map(|(of, setting)| format!("{of}.{setting} has no option"));
    let is_needed =
        |of: &str, name: &str| found.iter().any(|(other, setting)| other == of && (name.is_empty() || name == setting));
    let needless = WITHOUT.iter().filter(|(of, name, _)| !is_needed(of, name));
    lines
        .chain(needless.map(|(of, name, _)| format!("{of}.{name} has an option, and a reason why it has none")))
        .collect()
}

/// Adds the settings of a type, and of the types of settings in it, that no source names.
fn look(
    of: &str,
    required: &[&str],
    commands_with: &dyn Fn(&str) -> String,
    shared: &[String],
    types: &Types,
    found: &mut BTreeSet<(String, String)>,
) {
    let Some(item) = types.structs.get(of) else { return };
    let text = commands_with(of) + &shared.concat();
    for field in &item.fields {
        let name = field.ident.as_ref().map(ToString::to_string).unwrap_or_default();
        if !required.contains(&name.as_str()) && !names(&text, &name) {
            found.insert((of.to_owned(), name));
        }
        if let Type::Path(path) = &field.ty
            && let Some(last) = path.path.segments.last()
            && last.ident.to_string().ends_with(CONFIG)
            && !WITHOUT.iter().any(|(other, name, _)| *other == of && name.is_empty())
        {
            let inner = last.ident.to_string();
            let both = |name: &str| commands_with(of) + &commands_with(name);
            look(&inner, &[], &both, shared, types, found);
        }
    }
}

/// Returns the texts of the sources of a folder.
fn sources(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder).expect("a folder of sources").flatten().map(|entry| entry.path());
    let rust = files.filter(|path| path.extension().is_some_and(|e| e == "rs"));
    rust.map(|path| fs::read_to_string(path).expect("a source")).collect()
}

/// Returns the texts that mention a type.
fn mentions(texts: &[String], name: &str) -> String {
    texts.iter().filter(|text| words(text).any(|word| word == name)).cloned().collect()
}

/// Returns whether a text reads or sets a field: `.name`, `name: …`, or `name` in braces.
fn names(text: &str, name: &str) -> bool {
    text.match_indices(name).any(|(at, _)| {
        let before = text[..at].chars().next_back();
        let after = &text[at + name.len()..];
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let is_whole = !before.is_some_and(is_word) && !after.starts_with(is_word);
        is_whole && (before == Some('.') || after.starts_with([':', ',']) || after.starts_with(" }"))
    })
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric() && c != '_')
}
