//! Reading maps in the pixels of a camera (depths, normals, masks) from `.npy` or any raster, as
//! f64.
//!
//! No-data becomes NaN. A depth PNG with a step (`depth_step_m`, see
//! [`crate::raster::write_depth_png`]) is converted to metres, where 0 is no depth.

use std::path::Path;

use raster::Window;

use crate::format_error::FormatError;
use crate::npy::{self, NpyData};
use crate::raster::{ImageSource, RasterError, SampleType};
use crate::regular;

/// Most values of a map.
const NUMBERS_MAX: usize = 1 << 30;

/// A map in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct MapFile {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Values per pixel.
    pub channels: usize,
    /// Values row by row; the values of a pixel are adjacent.
    pub data: Vec<f64>,
    /// Whether the file has booleans or 8-bit numbers, as masks do.
    pub is_mask: bool,
}

/// Whether the first bytes of a file are those of a NumPy array.
pub fn is_npy(path: impl AsRef<Path>) -> bool {
    use std::io::Read;
    let mut magic = [0u8; 6];
    regular::open(path.as_ref()).and_then(|mut file| file.read_exact(&mut magic)).is_ok() && magic == *b"\x93NUMPY"
}

/// Reads a map.
///
/// # Errors
/// [`FormatError`] for an array or raster of another shape, or with more than 2³⁰ values, and for a
/// file that cannot be read.
pub fn read(path: impl AsRef<Path>) -> Result<MapFile, FormatError> {
    let path = path.as_ref();
    if is_npy(path) { from_npy(path) } else { from_raster(path) }
}

/// The error of a file whose shape is not that of a map.
fn not_a_map(path: &Path, shape: &[usize]) -> FormatError {
    let what = format!("the shape is {shape:?}, expected rows x columns or rows x columns x channels");
    FormatError::new(path, what + ", at most 2^30 numbers")
}

fn from_npy(path: &Path) -> Result<MapFile, FormatError> {
    let array = npy::read(path)?;
    let (height, width, channels) = match array.shape[..] {
        [height, width] => (height, width, 1),
        [height, width, channels] if channels > 0 => (height, width, channels),
        _ => return Err(not_a_map(path, &array.shape)),
    };
    if array.data.len() > NUMBERS_MAX {
        return Err(not_a_map(path, &array.shape));
    }
    let is_mask = matches!(array.data, NpyData::Bool(_) | NpyData::U8(_));
    Ok(MapFile { width, height, channels, data: array.data.to_f64(), is_mask })
}

fn from_raster(path: &Path) -> Result<MapFile, FormatError> {
    let unread = |error: RasterError| FormatError::of(path, error);
    let source = ImageSource::open(path).map_err(unread)?;
    let info = source.info();
    let (width, height, channels) = (info.width, info.height, info.bands);
    if width.saturating_mul(height).saturating_mul(channels) > NUMBERS_MAX {
        return Err(not_a_map(path, &[height, width, channels]));
    }
    let step = source.metadata("").into_iter().find(|(key, _)| key == "depth_step_m");
    let step = step.and_then(|(_, value)| value.parse::<f64>().ok()).filter(|step| step.is_finite());
    let mut data = vec![0.0; width * height * channels];
    for band in 0..channels {
        let values = source.read_band(band + 1, Window::whole(width, height)).map_err(unread)?;
        for (pixel, &value) in values.data().iter().enumerate() {
            let is_void = info.no_data.is_some_and(|no_data| f64::from(value) == no_data);
            data[pixel * channels + band] = if is_void { f64::NAN } else { f64::from(value) * step.unwrap_or(1.0) };
        }
    }
    Ok(MapFile { width, height, channels, data, is_mask: info.sample == SampleType::U8 })
}

#[cfg(test)]
mod tests {
    use raster::Grid;

    use super::*;
    use crate::raster::{Band, BandData, DepthScale, write_depth_png, write_map};

    #[test]
    fn one_map_in_three_formats() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let depths = vec![1.5f32, f32::NAN, 3.25, 60.0, 0.125, 2.0];
        let grid = Grid::from_vec(3, 2, depths.clone()).unwrap();
        npy::write(at("a.npy"), &[2, 3], &depths, false).unwrap();
        let band = [Band { description: "depth_m", data: BandData::F32(&grid) }];
        write_map(at("a.tif"), &band, Some(-32768.0), &[("kind", "depth")], false).unwrap();
        write_depth_png(at("a.png"), &grid, DepthScale::Fit, false).unwrap();
        for name in ["a.npy", "a.tif", "a.png"] {
            let found = read(at(name)).unwrap();
            assert_eq!((found.width, found.height, found.channels, found.is_mask), (3, 2, 1, false), "{name}");
            for (value, depth) in found.data.iter().zip(&depths) {
                let expected = f64::from(*depth);
                let void = value.is_nan() || *value == 0.0;
                assert!((value - expected).abs() < 1e-9 || (void && expected.is_nan()), "{name}: {value}");
            }
        }
        let ids = Grid::from_vec(1, 2, vec![7u32, u32::from(u16::MAX) + 2]).unwrap();
        write_map(at("ids.tif"), &[Band { description: "id", data: BandData::U32(&ids) }], None, &[], false).unwrap();
        assert_eq!(read(at("ids.tif")).unwrap().data, [7.0, 65537.0]);
        npy::write(at("n.npy"), &[1, 2, 3], &[0.0f32; 6], false).unwrap();
        assert_eq!(read(at("n.npy")).unwrap().channels, 3);
        npy::write(at("bad.npy"), &[6], &[0.0f32; 6], false).unwrap();
        let refused = read(at("bad.npy")).unwrap_err().to_string();
        assert!(refused.starts_with("the shape is [6], expected rows x columns or "), "{refused}");
    }
}
