//! DigitalGlobe's `.RPB`: `key = value;` statements in the group IMAGE, lists in parentheses.

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::{Field, Names};
use super::rpc_file::Parsed;

/// The names of the RPB format, for reading and writing.
pub(super) const NAMES: Names = Names {
    scalars: [
        "lineOffset",
        "sampOffset",
        "latOffset",
        "longOffset",
        "heightOffset",
        "lineScale",
        "sampScale",
        "latScale",
        "longScale",
        "heightScale",
        "errBias",
        "errRand",
    ],
    polys: ["lineNumCoef", "lineDenCoef", "sampNumCoef", "sampDenCoef"],
    separator: "_",
    first: 1,
};

/// Whether the text has an entry whose name is RPB's and not RPC00B's.
pub(super) fn recognise(text: &str) -> bool {
    let is_ours = |key: &str| NAMES.polys.contains(&key) || matches!(key, "sampOffset" | "latOffset" | "longOffset");
    text.lines().filter_map(|l| l.split_once('=')).any(|(key, _)| is_ours(key.trim()))
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let mut draft = Draft::default();
    let mut lines = text.lines().enumerate();
    while let Some((i, content)) = lines.next() {
        let line = Some(i + 1);
        let Some((key, value)) = content.split_once('=') else {
            if matches!(content.trim().trim_end_matches(';'), "" | "END") {
                continue;
            }
            return Err(Fault::Syntax {
                what: format!("found {:?}, expected key = value;", content.trim().chars().take(40).collect::<String>()),
                line,
            });
        };
        let (key, value) = (key.trim(), value.trim());
        let entry = Entry { key, text: value.trim_end_matches(';'), line };
        check_kind(entry)?;
        match NAMES.field(key) {
            Field::List(poly) => {
                let list = list(key, value, i + 1, &mut lines)?;
                let values = Entry { text: &list, ..entry }.numbers(true)?;
                draft.set_list(poly, values, entry)?;
            }
            _ => {
                draft.take(&NAMES, entry)?;
            }
        }
    }
    Ok(Parsed::certain(draft.finish(&NAMES)?))
}

fn check_kind(entry: Entry<'_>) -> Result<(), Fault> {
    let kind = entry.text.trim().trim_matches('"');
    if entry.key.eq_ignore_ascii_case("SpecId") && kind != "RPC00B" {
        return Err(Fault::Unsupported { what: format!("SpecId is {kind:?}, expected RPC00B: only RPC00B is read") });
    }
    Ok(())
}

/// Returns the text between the parentheses that open in `first` or on a later line.
fn list<'a>(
    key: &str,
    first: &'a str,
    line: usize,
    rest: &mut impl Iterator<Item = (usize, &'a str)>,
) -> Result<String, Fault> {
    let mut list = String::new();
    let mut piece = first;
    // Each line is searched once: searching the whole list per line would take quadratic time.
    while !piece.contains(')') {
        list.push_str(piece);
        list.push(' ');
        piece = rest.next().map(|(_, more)| more).ok_or_else(|| Fault::Syntax {
            what: format!("the list {key} does not end, expected ')'"),
            line: Some(line),
        })?;
    }
    list.push_str(piece.split(')').next().unwrap_or_default());
    let inner = list.trim_start().strip_prefix('(').ok_or_else(|| Fault::Syntax {
        what: format!("the list {key} does not begin with '(', expected {key} = ( … );"),
        line: Some(line),
    })?;
    Ok(inner.to_owned())
}
