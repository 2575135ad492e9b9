//! Depth maps as 16-bit PNG: `depth = value × step`, and 0 where there is no depth.
//!
//! The step is in the file as the text chunk `depth_step_m`, next to `depth_no_data` = 0. It is
//! also returned, for programs that read PNGs without text. The largest error is half a step. A
//! depth that does not fit into 65,535 steps is refused, not clipped.

use std::fmt;
use std::path::Path;

use png::{BitDepth, ColorType, Encoder, EncodingError};
use raster::Grid;

use crate::atomic::write_bytes;
use crate::raster::error::RasterError;

/// Largest value of a pixel, steps.
const STEPS: f64 = u16::MAX as f64;

/// Length of a step of a 16-bit depth map, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DepthScale {
    /// This step, metres (0.001 for millimetres).
    Step(f64),
    /// The smallest of 1, 2, 5, 10, 20, … mm that holds the largest depth.
    Fit,
}

impl fmt::Display for DepthScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Step(step_m) => write!(f, "{step_m} m"),
            Self::Fit => f.write_str("any length"),
        }
    }
}

impl DepthScale {
    /// Returns the step for depths up to `largest_m`; `None` when they do not fit or the given step
    /// is not positive.
    pub fn step_m(self, largest_m: f64) -> Option<f64> {
        // A depth that rounds to the last step still fits.
        let holds = |step: &f64| largest_m <= *step * (STEPS + 0.5);
        match self {
            Self::Step(step) => Some(step).filter(|step| step.is_finite() && *step > 0.0).filter(holds),
            Self::Fit => (0..18).map(|n| [1e-3, 2e-3, 5e-3][n % 3] * 10f64.powi((n / 3) as i32)).find(holds),
        }
    }
}

/// Writes a depth map and returns the step, metres. Depths that are not finite or not positive are
/// written as no depth.
///
/// # Errors
/// [`RasterError::NotWritten`] for a file that exists without `overwrite`, for depths that do not
/// fit the scale, for a map without pixels, and when the system refuses.
pub fn write_depth_png(
    path: impl AsRef<Path>,
    depth_m: &Grid<f32>,
    scale: DepthScale,
    overwrite: bool,
) -> Result<f64, RasterError> {
    let path = path.as_ref();
    let valid = |depth: f32| depth.is_finite() && depth > 0.0;
    let largest = depth_m.data().iter().copied().filter(|&d| valid(d)).fold(0.0, f32::max);
    let step_m = scale.step_m(f64::from(largest)).ok_or_else(|| {
        let reason = format!("depths up to {largest} m do not fit into 65535 steps of {scale}: choose a longer step");
        RasterError::unwritable(path, reason)
    })?;
    let steps =
        |&depth: &f32| if valid(depth) { (f64::from(depth) / step_m).round().clamp(1.0, STEPS) as u16 } else { 0 };
    let bytes: Vec<u8> = depth_m.data().iter().flat_map(|depth| steps(depth).to_be_bytes()).collect();
    let side = |length: usize| u32::try_from(length).ok().filter(|&length| length > 0);
    let size = side(depth_m.width()).zip(side(depth_m.height()));
    let size = size.ok_or_else(|| {
        RasterError::unwritable(path, "the map has no pixels or is too large, expected 1 to 2^32 - 1 columns and rows")
    })?;
    let encoded = encode(size, step_m, &bytes).map_err(|error| RasterError::unwritable(path, error))?;
    write_bytes(path, &encoded, overwrite)?;
    Ok(step_m)
}

fn encode((width, height): (u32, u32), step_m: f64, bytes: &[u8]) -> Result<Vec<u8>, EncodingError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, width, height);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Sixteen);
    encoder.add_text_chunk("depth_step_m".to_owned(), step_m.to_string())?;
    encoder.add_text_chunk("depth_no_data".to_owned(), "0".to_owned())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use super::*;
    use crate::atomic::SaveError;

    #[test]
    fn depths_lead_back_within_half_a_step() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.png");
        let depths = vec![0.0, f32::INFINITY, f32::NAN, 0.0001, 12.3456, 65.535];
        let map = Grid::from_vec(3, 2, depths.clone()).unwrap();
        assert_eq!(write_depth_png(&path, &map, DepthScale::Fit, false).unwrap(), 0.001);
        let decoder = png::Decoder::new(std::io::BufReader::new(File::open(&path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let text: Vec<_> = reader.info().uncompressed_latin1_text.iter().map(|t| (&*t.keyword, &*t.text)).collect();
        assert_eq!(text, [("depth_step_m", "0.001"), ("depth_no_data", "0")]);
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        let values: Vec<u16> = bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
        assert_eq!(values, [0, 0, 0, 1, 12_346, 65_535]);
        let again = write_depth_png(&path, &map, DepthScale::Fit, false);
        assert!(matches!(again, Err(RasterError::NotWritten(SaveError::Exists { .. }))));
    }

    #[test]
    fn the_step_holds_the_largest_depth() {
        for (largest, step) in [(0.0, 0.001), (65.5, 0.001), (65.6, 0.002), (300.0, 0.005), (400.0, 0.01), (5e5, 10.0)]
        {
            assert_eq!(DepthScale::Fit.step_m(largest), Some(step), "{largest}");
        }
        assert_eq!(DepthScale::Fit.step_m(1e12), None);
        assert_eq!(DepthScale::Step(0.001).step_m(66.0), None);
        assert_eq!(DepthScale::Step(0.01).step_m(66.0), Some(0.01));
        assert_eq!(DepthScale::Step(-1.0).step_m(66.0), None);
        let folder = tempfile::tempdir().unwrap();
        let map = Grid::from_vec(1, 1, vec![70.0]).unwrap();
        let refused = write_depth_png(folder.path().join("d.png"), &map, DepthScale::Step(0.001), false);
        assert!(matches!(refused, Err(RasterError::NotWritten(SaveError::Unwritable { .. }))));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
