//! Every measured number on the pages comes from a results file.
//!
//! A block between `<!-- numbers NAME -->` and `<!-- end -->` is made from `benches/results`. With
//! `SKYSWEEP_WRITE_NUMBERS=1` (`make readme`) the blocks on the pages are written anew; otherwise
//! the test fails when a block on a page differs. Outside of blocks, no page may hold a number that
//! looks like a measurement.

mod blocks;
mod results;

use std::fs;

use crate::pages::{pages, prose, root, text};
use results::Results;

const END: &str = "<!-- end -->";

/// Units of what is measured. Lengths are not among them: they are mostly parameters.
const UNITS: [&str; 14] =
    ["%", "s", "ms", "seconds", "minutes", "hours", "cm", "mm", "MB", "GB", "MiB", "megapixels", "times", "×"];
/// Words beside which a decimal number is a result.
const METRICS: [&str; 5] = ["MAE", "NMAD", "RMSE", "completeness", "coverage"];
/// Numbers that are parameters or definitions, not results.
const PARAMETERS: [&str; 3] = ["3 GB", "10 s", "60 s"];

/// A page with its blocks made from the results.
fn renewed(page: &str, results: &Results) -> String {
    let mut out = String::new();
    let mut rest = page;
    while let Some((before, after)) = rest.split_once("<!-- numbers ") {
        let (name, after) = after.split_once(" -->").expect("a marker ends with -->");
        let (_, after) = after.split_once(END).unwrap_or_else(|| panic!("the block {name} has no end"));
        let made = blocks::block(name, results);
        out += &format!("{before}<!-- numbers {name} -->\n{}\n{END}", made.trim_end());
        rest = after;
    }
    out + rest
}

/// A page without its blocks.
fn without_blocks(page: &str) -> String {
    let mut parts = page.split("<!-- numbers ");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + part.split_once(END).map_or("", |(_, rest)| rest))
}

/// The numbers of a line that look like measurements.
fn measurements(line: &str) -> Vec<String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let bare = |word: &str| word.trim_matches(|c: char| !c.is_alphanumeric() && c != '%' && c != '×').to_owned();
    let is_number =
        |word: &str| word.starts_with(|c: char| c.is_ascii_digit()) && word.ends_with(|c: char| c.is_ascii_digit());
    let has_metric = words.iter().any(|word| METRICS.contains(&bare(word).as_str()));
    let mut found = Vec::new();
    for (at, word) in words.iter().map(|word| bare(word)).enumerate() {
        let next = words.get(at + 1).map(|word| bare(word)).unwrap_or_default();
        // "20,000 × 20,000 pixels" is a size.
        let after = words.get(at + 2).map(|word| bare(word)).unwrap_or_default();
        let is_size = next == "×" && is_number(&after);
        if is_number(&word) && UNITS.contains(&next.as_str()) && !is_size {
            found.push(format!("{word} {next}"));
        } else {
            let is_share = word.ends_with(['%', '×']) && is_number(word.trim_end_matches(['%', '×']));
            if is_share || (has_metric && is_number(&word) && word.contains('.')) {
                found.push(word);
            }
        }
    }
    found
}

#[test]
fn the_blocks_say_what_was_measured() {
    let results = Results::read();
    let is_written = std::env::var("SKYSWEEP_WRITE_NUMBERS").is_ok_and(|value| value == "1");
    let mut blocks = 0;
    for page in pages() {
        let old = text(&page);
        blocks += old.matches("<!-- numbers ").count();
        let new = renewed(&old, &results);
        if old != new && is_written {
            fs::write(&page, new).expect("the page is written");
        } else {
            assert!(old == new, "{}: run `make readme`; the numbers should be\n{new}", page.display());
        }
    }
    assert!(blocks > 5, "only {blocks} blocks of numbers");
}

#[test]
fn no_measurement_stands_outside_of_a_block() {
    let mut stray = Vec::new();
    for page in pages() {
        let place = page.strip_prefix(root()).unwrap_or(&page).display().to_string();
        for line in prose(&without_blocks(&text(&page))) {
            let found = measurements(&line).into_iter().filter(|number| !PARAMETERS.contains(&number.as_str()));
            stray.extend(found.map(|number| format!("{place}: \"{number}\" in: {line}")));
        }
    }
    assert!(
        stray.is_empty(),
        "make these numbers in tests/documents/numbers/blocks.rs, or name them as parameters in \
         tests/documents/numbers.rs:\n{}",
        stray.join("\n")
    );
}

#[test]
fn measurements_are_recognised() {
    assert_eq!(measurements("It takes 18 s, or 3.1 × less (97 %)."), ["18 s", "3.1 ×", "97 %"]);
    assert_eq!(measurements("The MAE is 0.94 m."), ["0.94"]);
    assert!(measurements("Images of 518 × 518 pixels at 0.5 m, EPSG:32631, version 1.95 or newer.").is_empty());
}

#[test]
fn a_block_is_replaced_between_its_markers() {
    let results = Results::read();
    let page = "a\n<!-- numbers large -->\nold\n<!-- end -->\nb 5 s\n";
    let new = renewed(page, &results);
    assert!(
        new.starts_with("a\n<!-- numbers large -->\nA simulated pair") && new.ends_with("\n<!-- end -->\nb 5 s\n"),
        "{new}"
    );
    assert_eq!(renewed(&new, &results), new);
    assert_eq!(without_blocks(&new), "a\n\nb 5 s\n");
}
