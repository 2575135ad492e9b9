//! Reads back what GDAL wrote, because GDAL does not report every failure.
//!
//! GDAL before 3.7 reports nothing when closing a file fails, and a failed write of a block can
//! leave a file that opens and holds other cells. So every file is opened again before it gets its
//! name, all its blocks and overviews are decoded, and the cells are compared with the source.

use std::path::Path;

use gdal::raster::{GdalDataType, GdalType, RasterBand};
use gdal::{Dataset, DatasetOptions, GdalOpenFlags};

use crate::raster::access::gdal_setup::with_gdal;

/// Rows that are read at a time: a multiple of the sides of our tiles.
const ROWS: usize = 512;

/// A type of cells that can be compared bit by bit.
trait Bits: GdalType + Copy {
    fn bits(self) -> u64;
}

impl Bits for f32 {
    fn bits(self) -> u64 {
        u64::from(self.to_bits())
    }
}

impl Bits for f64 {
    fn bits(self) -> u64 {
        self.to_bits()
    }
}

/// Checks that the file at `made` has the cells of `source`, and that its overviews can be decoded.
///
/// # Errors
/// The first difference, in words.
pub(in crate::raster) fn verify(source: &Dataset, made: &Path) -> Result<(), String> {
    let open_flags = GdalOpenFlags::GDAL_OF_RASTER | GdalOpenFlags::GDAL_OF_READONLY;
    let options = || DatasetOptions { open_flags, allowed_drivers: Some(&["GTiff"]), ..Default::default() };
    let written =
        with_gdal(|| Dataset::open_ex(made, options())).map_err(|reason| broken(&format!("unreadable, {reason}")))?;
    let shape = |dataset: &Dataset| (dataset.raster_size(), dataset.raster_count());
    if shape(source) != shape(&written) {
        return Err(broken(&format!("{:?} instead of {:?}", shape(&written), shape(source))));
    }
    if source.geo_transform().ok() != written.geo_transform().ok() && source.geo_transform().is_ok() {
        return Err(broken("another position"));
    }
    for index in 1..=source.raster_count() {
        let bands = with_gdal(|| Ok((source.rasterband(index)?, written.rasterband(index)?)));
        let (expected, found) = bands.map_err(|reason| broken(&reason))?;
        if expected.band_type() != found.band_type() || expected.no_data_value() != found.no_data_value() {
            return Err(broken("another type of cells"));
        }
        compare_any(&expected, Some(&found))?;
        for level in 0..overviews(&found) {
            let overview = with_gdal(|| found.overview(level as usize)).map_err(|reason| broken(&reason))?;
            compare_any(&overview, None)?;
        }
    }
    Ok(())
}

fn overviews(band: &RasterBand<'_>) -> i32 {
    band.overview_count().unwrap_or(0)
}

fn broken(what: &str) -> String {
    format!("what was written reads back broken ({what}); check that the disk is not full")
}

/// Compares two bands in a type that holds every cell exactly, or decodes one.
fn compare_any(expected: &RasterBand<'_>, found: Option<&RasterBand<'_>>) -> Result<(), String> {
    match expected.band_type() {
        GdalDataType::UInt8 | GdalDataType::UInt16 | GdalDataType::Float32 => compare::<f32>(expected, found),
        _ => compare::<f64>(expected, found),
    }
}

fn compare<T: Bits>(expected: &RasterBand<'_>, found: Option<&RasterBand<'_>>) -> Result<(), String> {
    let (width, height) = expected.size();
    for top in (0..height).step_by(ROWS) {
        let size = (width, ROWS.min(height - top));
        let read = |band: &RasterBand<'_>| {
            with_gdal(|| band.read_as::<T>((0, top as isize), size, size, None)).map_err(|reason| broken(&reason))
        };
        let ours = read(expected)?;
        let Some(found) = found else { continue };
        let theirs = read(found)?;
        if ours.data().iter().zip(theirs.data()).any(|(a, b)| a.bits() != b.bits()) {
            return Err(broken(&format!("other cells in the rows from {top}")));
        }
    }
    Ok(())
}
