//! OSSIM's and OTB's `.geom`: `key:  value` lines of a whole sensor model, of which the RPC is a part.
//!
//! Image coordinates count from 0 at the centre of the upper-left pixel: the `.geom` of a Pléiades image has
//! LINE_OFF one less than its DIMAP file, which counts from 1. Polynomial format A (RPC00A) has its terms in another
//! order and is refused, as is a model with a non-zero adjustment, which would move it.

use super::Parsed;
use super::draft::{Draft, Entry, Names};
use super::error::Fault;

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
    index: ("_", 0),
};

/// Whether the text has OSSIM's lower-case, two-digit coefficients or its format letter.
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
    Ok(Parsed { rpc: draft.finish(&NAMES)?, warnings: Vec::new() })
}

fn check_model(entry: Entry<'_>) -> Result<(), Fault> {
    let unsupported = |what: String| Err(Fault::Unsupported { what });
    if entry.key == "polynomial_format" && !matches!(entry.text, "B" | "") {
        return unsupported(format!("polynomial_format is {:?}, expected B (RPC00B)", entry.text));
    }
    let moves =
        entry.key.starts_with("adjustment_") && [".parameter", ".center"].iter().any(|e| entry.key.ends_with(e));
    if moves && entry.number()? != 0.0 {
        return unsupported(format!(
            "{} is {}: OSSIM's adjustments are not applied here, write the adjusted RPC out with OSSIM first",
            entry.key, entry.text
        ));
    }
    Ok(())
}
