//! OSSIM's and OTB's `.geom`: `key:  value` lines of a whole sensor model, of which the RPC is a
//! part.
//!
//! Image coordinates are counted from 0 at the centre of the upper-left pixel: the LINE_OFF of a
//! Pléiades image is one less in its `.geom` than in its DIMAP file, which counts from 1.
//! Polynomial format A (RPC00A), whose terms are in another order, is refused. A model with a
//! non-zero adjustment is refused too, because the adjustment moves the RPC.

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::Names;
use super::rpc_file::Parsed;

const NAMES: Names = Names {
    scalars: [
        "line_off",
        "samp_off",
        "lat_off",
        "long_off",
        "height_off",
        "line_scale",
        "samp_scale",
        "lat_scale",
        "long_scale",
        "height_scale",
        "bias_error",
        "rand_error",
    ],
    polys: ["line_num_coeff", "line_den_coeff", "samp_num_coeff", "samp_den_coeff"],
    separator: "_",
    first: 0,
};

/// Whether the text has a `polynomial_format` or OSSIM's coefficient keys (lower case, two digits).
pub(super) fn recognise(text: &str) -> bool {
    let is_ours = |key: &str| key == "polynomial_format" || NAMES.polys.iter().any(|p| key == format!("{p}_00"));
    text.lines().filter_map(|l| l.split_once(':')).any(|(key, _)| is_ours(key.trim()))
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let mut draft = Draft::default();
    for (i, content) in text.lines().enumerate() {
        let Some((key, value)) = content.split_once(':') else { continue };
        let entry = Entry { key: key.trim(), text: value.trim(), line: Some(i + 1) };
        check_model(entry)?;
        draft.take(&NAMES, entry)?;
    }
    Ok(Parsed::certain(draft.finish(&NAMES)?))
}

/// Refuses a model that this reader cannot represent.
fn check_model(entry: Entry<'_>) -> Result<(), Fault> {
    let unsupported = |what: String| Err(Fault::Unsupported { what });
    if entry.key == "polynomial_format" && !matches!(entry.text, "B" | "") {
        return unsupported(format!("polynomial_format is {:?}, expected B (RPC00B): only RPC00B is read", entry.text));
    }
    let moves =
        entry.key.starts_with("adjustment_") && [".parameter", ".center"].iter().any(|e| entry.key.ends_with(e));
    if moves && entry.number()? != 0.0 {
        return unsupported(format!(
            "{} is {}, expected 0: OSSIM's adjustments are not applied, so write the adjusted RPC with OSSIM first",
            entry.key, entry.text
        ));
    }
    Ok(())
}
