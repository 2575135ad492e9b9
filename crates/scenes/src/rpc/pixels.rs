//! What the image beside an RPC says of itself: its size, its bands, the ground that it shows, when
//! and by which satellite it was taken, and where the sun stood.

use std::path::Path;

use camera::{ImagePoint, Rpc};
use formats::raster::{ImageSource, SampleType, iso_time};
use formats::stac::SunPosition;
use serde::Serialize;

/// The image of an RPC.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RpcPixels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Names of the bands; empty for a band without one.
    pub bands: Vec<String>,
    /// Type of the stored samples.
    pub sample: String,
    /// Significant bits of a sample, where the file says.
    pub bits: Option<u32>,
    /// Corners of the image on the ground at the height offset of the RPC, longitude and latitude
    /// in degrees: upper left, upper right, lower right, lower left. Absent where the model has no
    /// answer for one of them.
    pub footprint_deg: Option<[[f64; 2]; 4]>,
    /// When the image was taken, UTC in the form of ISO 8601; absent where the file does not say.
    pub acquired: Option<String>,
    /// The satellite; absent where the file does not say.
    pub satellite: Option<String>,
    /// Where the sun stood; absent where the file does not say.
    pub sun: Option<SunPosition>,
}

/// Describes an image; `None` for a file that holds an RPC and no pixels.
pub(super) fn of_file(file: &Path, rpc: &Rpc) -> Option<RpcPixels> {
    let image = ImageSource::open(file).ok()?;
    let info = image.info();
    let bands = (1..=info.bands).map(|band| image.band_label(band).map_or(String::new(), |label| label.description));
    Some(RpcPixels {
        width: info.width,
        height: info.height,
        bands: bands.collect(),
        sample: sample_name(info.sample).to_owned(),
        bits: info.bits,
        footprint_deg: footprint(rpc, info.width, info.height),
        acquired: image.acquired_s().and_then(iso_time),
        satellite: image.satellite(),
        sun: image.sun(),
    })
}

/// Returns the outer corners of an image on the ground at the height offset.
pub(super) fn footprint(rpc: &Rpc, width: usize, height: usize) -> Option<[[f64; 2]; 4]> {
    let (right, lower) = (width as f64 - 0.5, height as f64 - 0.5);
    let corner = |sample, line| {
        let ground = rpc.localize(ImagePoint::new(sample, line), rpc.height_off).ok()?;
        Some([ground.lon_deg, ground.lat_deg])
    };
    Some([corner(-0.5, -0.5)?, corner(right, -0.5)?, corner(right, lower)?, corner(-0.5, lower)?])
}

fn sample_name(sample: SampleType) -> &'static str {
    match sample {
        SampleType::U8 => "8 bits",
        SampleType::U16 => "16 bits",
        SampleType::I16 => "16 bits with a sign",
        SampleType::U32 => "32 bits",
        SampleType::I32 => "32 bits with a sign",
        SampleType::F32 => "single precision",
        SampleType::F64 => "double precision",
        _ => "another type",
    }
}

impl RpcPixels {
    /// Returns the rows of the text: names and values.
    pub(super) fn rows(&self) -> Vec<(&'static str, String)> {
        let bits = self.bits.map(|bits| format!(", {bits} of them used")).unwrap_or_default();
        let named: Vec<&str> = self.bands.iter().map(String::as_str).filter(|name| !name.is_empty()).collect();
        let names = if named.is_empty() { String::new() } else { format!(" ({})", named.join(", ")) };
        let plural = if self.bands.len() == 1 { "" } else { "s" };
        let bands = format!("{} band{plural}{names}", self.bands.len());
        let unknown = || "unknown: the file does not say".to_owned();
        let mut rows = vec![
            ("size", format!("{} samples, {} lines", self.width, self.height)),
            ("bands", format!("{bands}, {}{bits}", self.sample)),
            ("taken", self.acquired.clone().unwrap_or_else(unknown)),
            ("satellite", self.satellite.clone().unwrap_or_else(unknown)),
            (
                "sun",
                self.sun.map_or_else(unknown, |sun| {
                    format!("azimuth {:.1} deg, elevation {:.1} deg", sun.azimuth_deg, sun.elevation_deg)
                }),
            ),
        ];
        if let Some(corners) = self.footprint_deg {
            for (at, [lon, lat]) in corners.into_iter().enumerate() {
                let name = if at == 0 { "footprint" } else { "" };
                let corner = ["upper left", "upper right", "lower right", "lower left"][at];
                rows.push((name, format!("{lon:.6} {lat:.6} deg, {corner}")));
            }
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_tells_its_size_bands_and_ground() {
        let town = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
        let path = town.join("view_1.tif");
        let rpc = formats::rpc::read(&path).unwrap().rpc;
        let image = of_file(&path, &rpc).unwrap();
        assert!(image.width > 100 && image.bands.len() == 1);
        let [[west, north], [east, _], [_, south], _] = image.footprint_deg.unwrap();
        assert!(west < rpc.long_off && rpc.long_off < east && south < rpc.lat_off && rpc.lat_off < north);
        let text: Vec<String> = image.rows().into_iter().map(|(name, value)| format!("{name} {value}")).collect();
        let text = text.join("\n");
        assert!(text.contains("samples") && text.contains("1 band") && text.contains("upper left"), "{text}");
        // A text file with an RPC has no pixels.
        let folder = tempfile::tempdir().unwrap();
        let side = folder.path().join("a_RPC.TXT");
        std::fs::write(&side, "LINE_OFF: 1").unwrap();
        assert_eq!(of_file(&side, &rpc), None);
    }
}
