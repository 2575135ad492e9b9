//! The pages of the project: which there are, and the links in them.

use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the repository.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The pages at the root, the architecture page, the samples' page and all pages of the guide.
pub(crate) fn pages() -> Vec<PathBuf> {
    let fixed = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "crates/README.md", "data-samples/README.md"];
    let mut found: Vec<PathBuf> = fixed.iter().map(|name| root().join(name)).collect();
    below(&root().join("docs"), "md", &mut found);
    found.sort();
    assert!(found.len() > 15, "only {} pages found", found.len());
    found
}

/// Adds the files below a folder whose names end with an extension.
pub(crate) fn below(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).expect("the folder is readable").map(|entry| entry.expect("an entry").path()) {
        if path.is_dir() {
            below(&path, extension, found);
        } else if path.extension().is_some_and(|found| found == extension) {
            found.push(path);
        }
    }
}

/// The text of a page.
pub(crate) fn text(page: &Path) -> String {
    fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()))
}

/// The lines of a page outside of fenced code, with inline code replaced by nothing.
pub(crate) fn prose(text: &str) -> Vec<String> {
    let mut in_fence = false;
    let mut lines = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_fence = !in_fence;
        } else if !in_fence {
            lines.push(line.split('`').step_by(2).collect());
        }
    }
    lines
}

/// The targets of the links and pictures in a page: what stands between `](` and `)`.
pub(crate) fn links(text: &str) -> Vec<String> {
    let prose = prose(text).join("\n");
    prose.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect()
}

/// The anchor that a heading gets in HTML: lower case, spaces as hyphens, punctuation left out.
pub(crate) fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// The anchors of a page's headings.
pub(crate) fn anchors(text: &str) -> Vec<String> {
    let mut in_fence = false;
    let mut found = Vec::new();
    for line in text.lines() {
        if line.starts_with("```") {
            in_fence = !in_fence;
        } else if !in_fence && line.starts_with('#') {
            found.push(anchor(&line.trim_start_matches('#').replace('`', "")));
        }
    }
    found
}
