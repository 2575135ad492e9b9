//! The `RPB/IMAGE` block of DigitalGlobe's and Maxar's `.XML`; image coordinates are counted from
//! 0.

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::{Field, Names};
use super::rpc_file::Parsed;
use super::xml;

const NAMES: Names = Names {
    scalars: [
        "LINEOFFSET",
        "SAMPOFFSET",
        "LATOFFSET",
        "LONGOFFSET",
        "HEIGHTOFFSET",
        "LINESCALE",
        "SAMPSCALE",
        "LATSCALE",
        "LONGSCALE",
        "HEIGHTSCALE",
        "ERRBIAS",
        "ERRRAND",
    ],
    polys: ["LINENUMCOEF", "LINEDENCOEF", "SAMPNUMCOEF", "SAMPDENCOEF"],
    separator: "_",
    first: 1,
};

/// Whether an XML document has an `RPB` element.
pub(super) fn recognise(text: &str) -> bool {
    text.contains("<RPB>") || text.contains("<RPB ")
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let mut draft = Draft::default();
    xml::walk(text, |leaf| {
        let entry = Entry { key: leaf.name(), text: leaf.text, line: Some(leaf.line) };
        if leaf.tail::<2>().is_some_and(|[parent, key]| parent == "RPB" && key == "SPECID") && leaf.text != "RPC00B" {
            return Err(Fault::Unsupported {
                what: format!("SPECID is {:?}, expected RPC00B: only RPC00B is read", leaf.text),
            });
        }
        let scalar = leaf.tail::<3>().is_some_and(|[rpb, image, _]| (rpb, image) == ("RPB", "IMAGE"));
        let list = leaf.tail::<4>().is_some_and(|[rpb, image, list, _]| {
            (rpb, image) == ("RPB", "IMAGE") && list.strip_suffix("List") == Some(entry.key)
        });
        if (scalar && !matches!(NAMES.field(entry.key), Field::List(_))) || list {
            draft.take(&NAMES, entry)?;
        }
        Ok(())
    })?;
    Ok(Parsed::certain(draft.finish(&NAMES)?))
}
