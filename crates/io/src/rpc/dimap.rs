//! DIMAP 2 and 3: `RPC_*.XML` of Pléiades, SPOT 6/7 and Pléiades Neo.
//!
//! The projection is `Inverse_Model` (DIMAP 2) or `GroundtoImage_Values` (DIMAP 3); the other direction is not read.
//!
//! Image coordinates: the number of the first pixel differs by sensor. The file says it itself in FIRST_COL and FIRST_ROW
//! of the image's validity domain: 1 in every Pléiades and SPOT 6/7 file, 0 in Pléiades Neo's (whose
//! LINE_OFF = LINE_SCALE = LAST_ROW / 2). GDAL and rpcm subtract accordingly. Where the domain is not given, the
//! sensor's rule holds, and for an unknown sensor 1 with a warning.

use super::Parsed;
use super::draft::{Draft, Entry, RPC00B};
use super::error::Fault;
use super::xml;

/// Whether an XML document with the root `Dimap_Document` has a rational function model.
pub(super) fn recognise(text: &str) -> bool {
    text.contains("<Global_RFM")
}

/// What the document says about the image coordinates of its first pixel.
#[derive(Debug, Default)]
struct ImageOrigin {
    profile: String,
    first_col: Option<f64>,
    first_row: Option<f64>,
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let mut draft = Draft::default();
    let mut origin = ImageOrigin::default();
    xml::walk(text, |leaf| {
        let entry = Entry { key: leaf.name(), text: leaf.text, line: Some(leaf.line) };
        match leaf.tail::<3>() {
            // ERR_BIAS_ROW and its like are in pixels and have no place in RPC00B.
            Some(["Global_RFM", "Inverse_Model" | "GroundtoImage_Values" | "RFM_Validity", key])
                if !key.starts_with("ERR_") =>
            {
                draft.take(&RPC00B, entry)?;
            }
            Some(["RFM_Validity", "Direct_Model_Validity_Domain" | "ImagetoGround_Validity_Domain", key]) => {
                match key {
                    "FIRST_COL" => origin.first_col = Some(entry.number()?),
                    "FIRST_ROW" => origin.first_row = Some(entry.number()?),
                    _ => {}
                }
            }
            Some([_, "Metadata_Identification", "METADATA_PROFILE"]) => origin.profile = leaf.text.to_owned(),
            _ => {}
        }
        Ok(())
    })?;
    let mut warnings = Vec::new();
    let (col, row) = origin.first_pixel(&mut warnings);
    draft.shift_image(col, row);
    Ok(Parsed { rpc: draft.finish(&RPC00B)?, warnings })
}

impl ImageOrigin {
    /// Column and row of the first pixel in the file's own counting.
    fn first_pixel(&self, warnings: &mut Vec<String>) -> (f64, f64) {
        let is_number_of_first = |v: f64| v == 0.0 || v == 1.0;
        let by_sensor = match self.profile.as_str() {
            "PHR_SENSOR" | "S6_SENSOR" | "S7_SENSOR" => Some(1.0),
            "PNEO_SENSOR" => Some(0.0),
            _ => None,
        };
        match (self.first_col, self.first_row) {
            (Some(col), Some(row)) if is_number_of_first(col) && is_number_of_first(row) => {
                if by_sensor.is_some_and(|n| n != col || n != row) {
                    warnings.push(format!(
                        "the validity domain counts pixels from ({col}, {row}), which is not usual for {}; the file's own numbers are used",
                        self.profile
                    ));
                }
                (col, row)
            }
            _ => {
                let first = by_sensor.unwrap_or_else(|| {
                    warnings.push(format!(
                        "neither a validity domain nor the profile {:?} says how pixels are counted; taken as from 1",
                        self.profile
                    ));
                    1.0
                });
                (first, first)
            }
        }
    }
}
