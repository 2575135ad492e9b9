//! DIMAP 2 and 3: `RPC_*.XML` of Pléiades, SPOT 6/7 and Pléiades Neo.
//!
//! The projection is `Inverse_Model` (DIMAP 2) or `GroundtoImage_Values` (DIMAP 3). The opposite
//! direction is not read.
//!
//! The image coordinates of the first pixel differ by sensor. The file states them in FIRST_COL and
//! FIRST_ROW of the image's validity domain: 1 in every Pléiades and SPOT 6/7 file, 0 in Pléiades
//! Neo's (whose LINE_OFF = LINE_SCALE = LAST_ROW / 2). GDAL and rpcm subtract them too. Without a
//! validity domain the sensor decides, and an unknown sensor is taken to count from 1, with a
//! warning.

use camera::ImagePoint;

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::RPC00B;
use super::rpc_file::Parsed;
use super::xml;

/// Whether an XML document with the root `Dimap_Document` has a rational function model.
pub(super) fn recognise(text: &str) -> bool {
    text.contains("<Global_RFM")
}

/// The entries that decide the image coordinates of the first pixel.
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
            // Errors such as ERR_BIAS_ROW are in pixels; RPC00B has only errors in metres.
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
    draft.shift_image(origin.first_pixel(&mut warnings));
    Ok(Parsed { rpc: draft.finish(&RPC00B)?, warnings })
}

impl ImageOrigin {
    /// Returns the file's image coordinates of the centre of the first pixel.
    fn first_pixel(&self, warnings: &mut Vec<String>) -> ImagePoint {
        let is_usual = |v: f64| v == 0.0 || v == 1.0;
        let by_sensor = match self.profile.as_str() {
            "PHR_SENSOR" | "S6_SENSOR" | "S7_SENSOR" => Some(1.0),
            "PNEO_SENSOR" => Some(0.0),
            _ => None,
        };
        match (self.first_col, self.first_row) {
            (Some(col), Some(row)) if is_usual(col) && is_usual(row) => {
                if by_sensor.is_some_and(|n| n != col || n != row) {
                    warnings.push(format!(
                        "the validity domain counts pixels from ({col}, {row}), which is not usual for {}: \
                         the file's numbers are used",
                        self.profile
                    ));
                }
                ImagePoint { sample: col, line: row }
            }
            _ => {
                let first = by_sensor.unwrap_or_else(|| {
                    warnings.push(format!(
                        "there is no validity domain and the profile {:?} is not known: \
                         pixels are taken to be counted from 1",
                        self.profile
                    ));
                    1.0
                });
                ImagePoint { sample: first, line: first }
            }
        }
    }
}
