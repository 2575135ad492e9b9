//! Holds the rules of `crates/README.md`: the floors, the homes of GDAL and PROJ, where files are
//! touched, no circles of files, one name for one public type, a thin command line, and that every
//! source says what it does.
//!
//! The dependencies are read from `cargo metadata --no-deps`, so no network is needed. Where
//! sources are scanned as text, comments and what follows the first `#[cfg(test)]` of a file do not
//! count.

mod circles;
mod names;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use cargo_metadata::{Metadata, MetadataCommand, Package};

/// The floor of every crate, those to come included, so that a new crate lands where the design has
/// it.
const FLOORS: [(&str, u8); 37] = [
    ("skysweep-numeric", 0),
    ("skysweep-testing", 0),
    ("skysweep-geodesy", 1),
    ("skysweep-raster", 1),
    ("skysweep-crs", 2),
    ("skysweep-camera", 2),
    ("skysweep-bvh", 2),
    ("skysweep-gaussian", 2),
    ("skysweep-city", 3),
    ("skysweep-occlusion", 3),
    ("skysweep-sweep", 4),
    ("skysweep-eval", 4),
    ("skysweep-simulate", 4),
    ("skysweep-priors", 4),
    ("skysweep-heightmap", 4),
    ("skysweep-terrain", 4),
    ("skysweep-change", 4),
    ("skysweep-classes", 4),
    ("skysweep-buildings", 4),
    ("skysweep-groundview", 4),
    ("skysweep-ortho", 4),
    ("skysweep-splats", 4),
    ("skysweep-colmap", 4),
    ("skysweep-tsdf", 4),
    ("skysweep-train", 5),
    ("skysweep-formats", 5),
    ("skysweep-cityfiles", 6),
    ("skysweep-reconstruct", 6),
    ("skysweep-report", 6),
    ("skysweep-job", 7),
    ("skysweep-surfaces", 8),
    ("skysweep-dsm", 9),
    ("skysweep-scenes", 10),
    ("skysweep-viewer", 10),
    ("skysweep-jobs", 11),
    ("skysweep", 12),
    ("skysweep-python", 12),
];

/// Foreign packages that only one crate may use: (package, its home).
const HOMES: [(&str, &str); 4] = [
    ("gdal", "skysweep-formats"),
    ("gdal-sys", "skysweep-formats"),
    ("proj", "skysweep-crs"),
    ("proj-sys", "skysweep-crs"),
];

/// Folders under `crates/` whose sources may touch the file system.
const FILE_CRATES: [&str; 9] = ["formats", "cityfiles", "job", "surfaces", "dsm", "scenes", "viewer", "jobs", "cli"];

/// Most sources of a folder, so that its list is read at one look.
const FOLDER_FILES: usize = 25;

/// Most public enumerations of errors. The number goes down, and not up.
const ERROR_ENUMS: usize = 24;

/// Most lines of a crate, tests included.
const CRATE_LINES: usize = 20_000;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn metadata() -> Metadata {
    MetadataCommand::new().manifest_path(root().join("Cargo.toml")).no_deps().exec().expect("cargo metadata runs")
}

fn floors() -> BTreeMap<&'static str, u8> {
    FLOORS.into_iter().collect()
}

/// What an arrow from one crate to another breaks, if anything.
fn broken_arrow(floors: &BTreeMap<&str, u8>, from: &str, to: &str) -> Option<String> {
    let (&above, &below) = (floors.get(from)?, floors.get(to)?);
    if below < above {
        return None;
    }
    Some(format!(
        "{from} (floor {above}) depends on {to} (floor {below}): an arrow goes only to a lower floor; \
         move the shared type down, or do the joining in a job"
    ))
}

/// Rust sources of the project below `folder`.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for path in entries.flatten().map(|entry| entry.path()) {
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

fn all_sources() -> Vec<PathBuf> {
    let mut found = Vec::new();
    for folder in ["crates", "tests", "benches"] {
        sources(&root().join(folder), &mut found);
    }
    assert!(found.len() > 8, "only {} sources found: is the test run from a checkout?", found.len());
    found.sort();
    found
}

/// Whether a path of `crates/` is only compiled for tests, benches or examples.
fn is_test_source(path: &Path) -> bool {
    let in_folder = path.components().any(|part| {
        matches!(part.as_os_str().to_str(), Some("tests" | "benches" | "examples")) || part.as_os_str() == "testing"
    });
    in_folder || path.file_stem().is_some_and(|stem| stem == "tests" || stem == "testing")
}

/// The code of a source without comments, white space and what follows the first `#[cfg(test)]`.
fn product_code(text: &str) -> String {
    let product = text.split("#[cfg(test)]").next().unwrap_or_default();
    product
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| line.chars().filter(|c| !c.is_whitespace()))
        .collect()
}

/// Whether the code of a source (no comments, nothing after the first `#[cfg(test)]`) names
/// `std::fs`.
fn names_std_fs(text: &str) -> bool {
    let code = product_code(text);
    let grouped = code.match_indices("std::{").any(|(start, head)| {
        let group = &code[start + head.len()..];
        let group = &group[..group.find(';').unwrap_or(group.len())];
        group.split([',', '{', '}']).any(|item| item == "fs" || item.starts_with("fs::"))
    });
    code.contains("std::fs") || grouped
}

fn report(broken: &[String]) {
    assert!(broken.is_empty(), "{} broken:\n{}", broken.len(), broken.join("\n"));
}

#[test]
fn dependencies_go_only_to_lower_floors() {
    let floors = floors();
    let mut broken = Vec::new();
    for package in metadata().workspace_packages() {
        if !floors.contains_key(package.name.as_str()) {
            broken.push(format!("{}: give the new crate a floor in tests/architecture/main.rs", package.name));
        }
        broken.extend(package.dependencies.iter().filter_map(|d| broken_arrow(&floors, &package.name, &d.name)));
    }
    report(&broken);
}

#[test]
fn gdal_and_proj_stay_in_their_homes() {
    let strayed = |package: &Package| -> Vec<String> {
        let misplaced = |name: &str| HOMES.iter().find(|(p, home)| *p == name && *home != package.name.as_str());
        package
            .dependencies
            .iter()
            .filter_map(|d| misplaced(&d.name))
            .map(|(p, home)| {
                format!("{} depends on {p}: it lives in {home} only; add what is missing there", package.name)
            })
            .collect()
    };
    report(&metadata().workspace_packages().into_iter().flat_map(strayed).collect::<Vec<_>>());
}

#[test]
fn plain_cargo_test_covers_every_crate() {
    let metadata = metadata();
    let mut members: Vec<_> = metadata.workspace_members.clone();
    let mut defaults: Vec<_> = metadata.workspace_default_members.to_vec();
    members.sort();
    defaults.sort();
    assert_eq!(members, defaults, "list every member under default-members in Cargo.toml");
}

#[test]
fn the_architecture_document_names_every_crate() {
    let document = fs::read_to_string(root().join("crates/README.md")).expect("crates/README.md is there");
    let missing: Vec<String> = fs::read_dir(root().join("crates"))
        .expect("crates/ is there")
        .flatten()
        .filter(|entry| entry.path().is_dir())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| !document.contains(&format!("| `{name}` |")))
        .map(|name| format!("crates/README.md has no row for `{name}`: say in one line what it holds"))
        .collect();
    report(&missing);
}

#[test]
fn files_are_touched_only_where_files_live() {
    let may = |path: &Path| FILE_CRATES.iter().any(|name| path.starts_with(root().join("crates").join(name)));
    let broken: Vec<String> = all_sources()
        .iter()
        .filter(|path| path.starts_with(root().join("crates")) && !may(path))
        .filter(|path| !is_test_source(path.strip_prefix(root()).unwrap_or(path)))
        .filter(|path| names_std_fs(&fs::read_to_string(path).expect("a source is readable")))
        .map(|path| format!("{}: std::fs is for {FILE_CRATES:?}; take bytes or a grid instead", path.display()))
        .collect();
    report(&broken);
}

#[test]
fn folders_and_crates_stay_small() {
    let mut folders: BTreeMap<PathBuf, usize> = BTreeMap::new();
    let mut crates: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for path in all_sources() {
        *folders.entry(path.parent().expect("a folder").to_owned()).or_default() += 1;
        let Ok(in_crates) = path.strip_prefix(root().join("crates")) else { continue };
        let of = crates.entry(in_crates.iter().take(1).collect()).or_default();
        *of += fs::read_to_string(&path).expect("a source is readable").lines().count();
    }
    let full = folders
        .iter()
        .filter(|(_, files)| **files > FOLDER_FILES)
        .map(|(folder, files)| format!("{}: {files} files, at most {FOLDER_FILES}: make folders", folder.display()));
    let large = crates
        .iter()
        .filter(|(_, lines)| **lines > CRATE_LINES)
        .map(|(name, lines)| format!("crates/{}: {lines} lines, at most {CRATE_LINES}: split it", name.display()));
    report(&full.chain(large).collect::<Vec<_>>());
}

/// Sources of the crates, without tests, benches and examples.
fn product_sources() -> Vec<PathBuf> {
    let in_crates = |path: &PathBuf| path.starts_with(root().join("crates"));
    let is_product = |path: &PathBuf| !is_test_source(path.strip_prefix(root()).unwrap_or(path));
    all_sources().into_iter().filter(in_crates).filter(is_product).collect()
}

#[test]
fn no_files_of_a_crate_use_each_other_in_a_circle() {
    let mut roots: Vec<PathBuf> = fs::read_dir(root().join("crates"))
        .expect("crates/ is there")
        .flatten()
        .flat_map(|entry| ["src/lib.rs", "lib.rs", "main.rs"].map(|file| entry.path().join(file)))
        .filter(|path| path.is_file())
        .collect();
    roots.sort();
    assert!(roots.len() > 15, "only {} crates found", roots.len());
    let name = |path: &Path| path.strip_prefix(root()).unwrap_or(path).display().to_string();
    let broken: Vec<String> = roots
        .iter()
        .flat_map(|file| circles::circles(file))
        .map(|circle| circle.iter().map(|path| name(path)).collect::<Vec<_>>().join(", "))
        .map(|circle| format!("{circle}: move what they share into a file below them"))
        .collect();
    report(&broken);
}

#[test]
fn no_public_type_has_the_name_of_another() {
    let mut types = names::PublicTypes::default();
    product_sources().iter().for_each(|path| types.add(path));
    let broken: Vec<String> =
        types.repeated().map(|(name, files)| format!("{name} is defined in {files:?}: one name, one thing")).collect();
    report(&broken);
}

#[test]
fn errors_of_the_library_name_no_command_line_flags() {
    let in_library = |path: &&PathBuf| !path.starts_with(root().join("crates/cli"));
    let broken: Vec<String> = product_sources()
        .iter()
        .filter(in_library)
        .flat_map(|path| {
            names::errors_with_flags(path).into_iter().map(move |text| format!("{}: {text}", path.display()))
        })
        .collect();
    report(&broken);
    assert!(names::names_flag("give --gsd") && !names::names_flag("a -- b"));
}

#[test]
fn public_error_enums_do_not_become_more() {
    let found: Vec<String> = product_sources().iter().flat_map(|path| names::public_error_enums(path)).collect();
    assert!(
        found.len() <= ERROR_ENUMS,
        "{} public enumerations of errors, at most {ERROR_ENUMS}: a job returns `job::error::JobError`, and what its \
         steps pass to each other is private: {found:?}",
        found.len()
    );
}

/// Callers ask an error for its kind (`numeric::Failure`), and do not search in its text.
#[test]
fn nothing_is_searched_in_the_text_of_an_error() {
    const SHORTEST: usize = 10;
    let sources = product_sources();
    let errors: Vec<String> = sources.iter().flat_map(|path| names::error_texts(path)).collect();
    let broken: Vec<String> = sources
        .iter()
        .flat_map(|path| names::searched_texts(path).into_iter().map(move |text| (path, text)))
        .filter(|(_, text)| text.len() >= SHORTEST && errors.iter().any(|error| error.contains(text.as_str())))
        .map(|(path, text)| format!("{}: {text:?} is in the text of an error: match its kind", path.display()))
        .collect();
    report(&broken);
}

/// A job hands values to another one. The folders in which a job prepares its outputs lie in the
/// output folder, and are `job`'s.
#[test]
fn no_temporary_files_lie_between_jobs() {
    let is_job = |path: &&PathBuf| {
        let crates = root().join("crates");
        ["surfaces", "dsm", "scenes", "viewer", "jobs"].iter().any(|name| path.starts_with(crates.join(name)))
    };
    let broken: Vec<String> = product_sources()
        .iter()
        .filter(is_job)
        .filter(|path| {
            let code = product_code(&fs::read_to_string(path).expect("a source is readable"));
            ["tempfile::tempdir(", "tempfile::NamedTempFile", "env::temp_dir("].iter().any(|word| code.contains(word))
        })
        .map(|path| format!("{}: temporary files are for tests; hand over the value in memory", path.display()))
        .collect();
    report(&broken);
}

/// The command line parses and prints. Whatever takes time or writes files is a job of the library.
/// It has at most 150 lines for each command, as it had when its twenty commands took 3,000.
#[test]
fn the_command_line_parses_and_prints_and_does_nothing_else() {
    let files: Vec<PathBuf> =
        product_sources().into_iter().filter(|path| path.starts_with(root().join("crates/cli"))).collect();
    let text = |path: &PathBuf| fs::read_to_string(path).expect("a source is readable");
    let lines: usize = files.iter().map(|path| text(path).lines().count()).sum();
    let main = text(&root().join("crates/cli/main.rs"));
    let commands =
        main.lines().filter(|line| line.trim_start().starts_with("Command::") && line.contains("=>")).count();
    assert!(commands >= 20, "{commands} commands were found");
    let most = 150 * commands;
    assert!(
        lines <= most,
        "{} files with {lines} lines, at most {most} are allowed for {commands} commands",
        files.len()
    );
    const FORBIDDEN: [&str; 9] = [
        "rayon",
        "ThreadPool",
        "fs::write",
        "File::create",
        "OpenOptions",
        "create_dir",
        "fs::rename",
        "fs::remove",
        "atomic::write",
    ];
    let broken: Vec<String> = files
        .iter()
        .flat_map(|path| {
            let code = product_code(&text(path));
            FORBIDDEN.into_iter().filter(move |word| code.contains(word)).map(move |word| (path, word))
        })
        .map(|(path, word)| format!("{} uses {word}: that belongs to a job", path.display()))
        .collect();
    report(&broken);
}

/// The rows of a source whose comments are wider than 100 columns. Tables and code inside comments
/// may be wider.
fn wide_comments(text: &str) -> Vec<usize> {
    let mut in_code = false;
    let mut wide = Vec::new();
    for (row, line) in text.lines().enumerate() {
        let comment = line.trim_start();
        if !comment.starts_with("//") {
            in_code = false;
            continue;
        }
        let body = comment.trim_start_matches(['/', '!']).trim_start();
        if body.starts_with("```") {
            in_code = !in_code;
        } else if !in_code && !body.starts_with('|') && line.chars().count() > 100 {
            wide.push(row + 1);
        }
    }
    wide
}

#[test]
fn comments_are_at_most_100_columns_wide() {
    let broken: Vec<String> = all_sources()
        .iter()
        .flat_map(|path| {
            let rows = wide_comments(&fs::read_to_string(path).expect("a source is readable"));
            rows.into_iter().map(|row| format!("{}:{row}", path.display())).collect::<Vec<_>>()
        })
        .collect();
    report(&broken);
}

#[test]
fn every_source_says_what_it_does() {
    let broken: Vec<String> = all_sources()
        .iter()
        .filter(|path| !fs::read_to_string(path).expect("a source is readable").starts_with("//!"))
        .map(|path| format!("{}: open with `//!`: what it does, formula or paper, units, frames", path.display()))
        .collect();
    report(&broken);
}

#[test]
fn the_scan_sees_every_spelling() {
    assert!(names_std_fs("use std::fs::File;"));
    assert!(names_std_fs("use std::{\n    fs,\n    io,\n};"));
    assert!(names_std_fs("use std::{io, fs::File};"));
    assert!(names_std_fs("let t = ::std::fs::read(path);"));
    assert!(!names_std_fs("// std::fs is not for this crate\nuse std::{fmt, io};"));
    assert!(!names_std_fs("fn f() {}\n#[cfg(test)]\nmod tests { use std::fs; }"));
}

#[test]
fn arrows_up_and_sideways_are_found() {
    let floors = floors();
    assert!(broken_arrow(&floors, "skysweep-camera", "skysweep-formats").is_some());
    assert!(broken_arrow(&floors, "skysweep-sweep", "skysweep-eval").is_some());
    assert!(broken_arrow(&floors, "skysweep-formats", "skysweep-camera").is_none());
    assert!(broken_arrow(&floors, "skysweep-camera", "serde").is_none());
}
