//! The pages fit together: every link leads to a file and a heading, every page is in the book, the
//! README is short, and the minimum version of Rust is the one in Cargo.toml. Tests find shared
//! data only through the crate `testing`.

use std::path::Path;

use crate::pages::{anchors, below, links, pages, root, text};

/// What is wrong with a link on a page, if anything.
fn broken(page: &Path, link: &str) -> Option<String> {
    if link.starts_with("https://") || link.starts_with("http://") {
        return None;
    }
    let (file, heading) = link.split_once('#').map_or((link, None), |(file, heading)| (file, Some(heading)));
    let target = if file.is_empty() { page.to_owned() } else { page.parent().expect("a folder").join(file) };
    let place = page.strip_prefix(root()).unwrap_or(page).display();
    if !target.exists() {
        return Some(format!("{place}: {link} leads to no file"));
    }
    let heading = heading?;
    let known = anchors(&text(&target));
    (!known.iter().any(|anchor| anchor == heading)).then(|| format!("{place}: {link} leads to no heading of {known:?}"))
}

#[test]
fn every_link_leads_somewhere() {
    let all: Vec<String> = pages()
        .iter()
        .flat_map(|page| links(&text(page)).into_iter().filter_map(|link| broken(page, &link)).collect::<Vec<_>>())
        .collect();
    assert!(all.is_empty(), "{} broken links:\n{}", all.len(), all.join("\n"));
}

/// mdBook shows only pages that its summary names, and copies no file from outside of its folder.
#[test]
fn the_summary_names_every_page_of_the_guide() {
    let docs = root().join("docs");
    let named = links(&text(&docs.join("SUMMARY.md")));
    for page in pages().iter().filter(|page| page.starts_with(&docs) && !page.ends_with("SUMMARY.md")) {
        let name = page.strip_prefix(&docs).expect("a page of the guide").to_str().expect("a name in ASCII");
        assert!(named.iter().any(|link| link == name), "docs/SUMMARY.md does not name {name}");
        for link in links(&text(page)).iter().filter(|link| !link.contains("://") && !link.starts_with('#')) {
            let file = link.split('#').next().expect("a file");
            let target = page.parent().expect("a folder").join(file).canonicalize().expect("links lead somewhere");
            assert!(target.starts_with(&docs), "{name}: {link} leaves the book, so it must be a full address");
        }
    }
}

#[test]
fn links_and_anchors_are_found() {
    let page = "See [a](b.md) and `[no](link)`.\n```\n[no](link)\n```\n![p](q.svg)\n## Two words: `x`, y\n";
    assert_eq!(links(page), ["b.md", "q.svg"]);
    assert_eq!(anchors(page), ["two-words-x-y"]);
}

#[test]
fn the_readme_is_short() {
    let lines = text(&root().join("README.md")).lines().count();
    assert!(lines <= 150, "README.md has {lines} lines: move what is too much to docs");
}

#[test]
fn the_minimum_version_of_rust_is_that_of_cargo() {
    let manifest = text(&root().join("Cargo.toml"));
    let version = manifest.lines().find_map(|line| line.strip_prefix("rust-version = \"")).expect("a rust-version");
    let version = version.trim_end_matches('"');
    assert_eq!(version, env!("CARGO_PKG_RUST_VERSION"));
    for page in ["README.md", "CONTRIBUTING.md"] {
        let words = format!("Rust {version} or newer");
        assert!(text(&root().join(page)).contains(&words), "{page} does not say \"{words}\"");
    }
}

/// One helper prints skips and fails where `SKYSWEEP_REQUIRE_DATA` says so; a test that looks for
/// data by itself would do neither.
#[test]
fn tests_find_shared_data_through_one_helper() {
    let mut all = Vec::new();
    ["crates", "tests"].iter().for_each(|folder| below(&root().join(folder), "rs", &mut all));
    assert!(all.len() > 100, "only {} sources found", all.len());
    let needle = concat!("shared", "/data");
    let looks = |line: &str| !line.trim_start().starts_with("//") && line.contains(needle);
    let strayed: Vec<String> = all
        .iter()
        .filter(|path| !path.starts_with(root().join("crates/testing")))
        .filter(|path| text(path).lines().any(looks))
        .map(|path| format!("{}: call testing::shared_data", path.display()))
        .collect();
    assert!(strayed.is_empty(), "{}", strayed.join("\n"));
}

#[test]
fn the_constants_of_the_guide_are_in_the_code() {
    let page = text(&root().join("docs/constants.md"));
    let is_name = |word: &&str| word.len() > 4 && word.chars().all(|c| c.is_ascii_uppercase() || c == '_');
    let names: Vec<&str> = page.split('`').skip(1).step_by(2).filter(is_name).collect();
    assert!(names.len() > 3, "{names:?}");
    let mut all = Vec::new();
    below(&root().join("crates"), "rs", &mut all);
    let code: Vec<String> = all.iter().map(|path| text(path)).collect();
    for name in names {
        let declared = format!("const {name}:");
        assert!(
            code.iter().any(|text| text.contains(&declared)),
            "docs/constants.md names {name}, which no crate declares"
        );
    }
}
