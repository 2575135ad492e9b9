//! Bands to write, and the dataset in memory that GDAL's drivers copy into a file.

use std::path::Path;

use gdal::raster::{Buffer, GdalType};
use gdal::{Dataset, Metadata};
use raster::Grid;

use crate::raster::access::gdal_access::memory_driver;
use crate::raster::access::gdal_setup::with_gdal;
use crate::raster::error::RasterError;

/// Rows converted at a time between a grid and GDAL's memory.
const CHUNK_ROWS: usize = 256;

/// Cells of one band.
#[derive(Debug, Clone, Copy)]
pub enum BandData<'a> {
    /// Heights and other quantities. NaN is no-data.
    F32(&'a Grid<f32>),
    /// Masks, classes, pictures.
    U8(&'a Grid<u8>),
    /// Image samples, counts.
    U16(&'a Grid<u16>),
    /// Object identifiers.
    U32(&'a Grid<u32>),
    /// Object numbers of which some are negative.
    I32(&'a Grid<i32>),
}

/// One band to write.
#[derive(Debug, Clone, Copy)]
pub struct Band<'a> {
    /// Name of the band with its unit, such as `height_m`. The endings `_m`, `_ft`, `_ft_us`,
    /// `_deg` and `_px` also become the unit of the band in GDAL's sense.
    pub description: &'a str,
    /// The cells. All bands of a file have the same type and size.
    pub data: BandData<'a>,
}

impl Band<'_> {
    /// Whether the first of `bands` is a float band, which decides for the file.
    pub(in crate::raster) fn first_is_float(bands: &[Band<'_>]) -> bool {
        matches!(bands.first(), Some(Band { data: BandData::F32(_), .. }))
    }
}

/// Copies the bands into a dataset of GDAL's MEM driver. NaN becomes `no_data` where there is one.
pub(in crate::raster) fn in_memory(
    path: &Path,
    bands: &[Band<'_>],
    no_data: Option<f64>,
) -> Result<Dataset, RasterError> {
    let first = bands.first().ok_or_else(|| inconsistent(path, "found no band, expected at least one"))?;
    match first.data {
        BandData::F32(_) => fill(path, bands, no_data, as_f32, |v: f32| match no_data {
            Some(void) if v.is_nan() => void as f32,
            _ => v,
        }),
        BandData::U8(_) => fill(path, bands, no_data, as_u8, |v| v),
        BandData::U16(_) => fill(path, bands, no_data, as_u16, |v| v),
        BandData::U32(_) => fill(path, bands, no_data, as_u32, |v| v),
        BandData::I32(_) => fill(path, bands, no_data, as_i32, |v| v),
    }
}

fn as_f32<'a>(band: &Band<'a>) -> Option<&'a Grid<f32>> {
    if let BandData::F32(grid) = band.data { Some(grid) } else { None }
}

fn as_u8<'a>(band: &Band<'a>) -> Option<&'a Grid<u8>> {
    if let BandData::U8(grid) = band.data { Some(grid) } else { None }
}

fn as_u16<'a>(band: &Band<'a>) -> Option<&'a Grid<u16>> {
    if let BandData::U16(grid) = band.data { Some(grid) } else { None }
}

fn as_u32<'a>(band: &Band<'a>) -> Option<&'a Grid<u32>> {
    if let BandData::U32(grid) = band.data { Some(grid) } else { None }
}

fn as_i32<'a>(band: &Band<'a>) -> Option<&'a Grid<i32>> {
    if let BandData::I32(grid) = band.data { Some(grid) } else { None }
}

fn fill<'a, T: GdalType + Copy + 'a>(
    path: &Path,
    bands: &[Band<'a>],
    no_data: Option<f64>,
    typed: impl Fn(&Band<'a>) -> Option<&'a Grid<T>>,
    convert: impl Fn(T) -> T,
) -> Result<Dataset, RasterError> {
    let grids: Option<Vec<&Grid<T>>> = bands.iter().map(typed).collect();
    let grids = grids.ok_or_else(|| inconsistent(path, "the bands differ in sample type"))?;
    let (width, height) = (grids[0].width(), grids[0].height());
    if grids.iter().any(|g| (g.width(), g.height()) != (width, height)) {
        return Err(inconsistent(path, "the bands differ in size"));
    }
    if width == 0 || height == 0 {
        return Err(inconsistent(path, "found no cells, expected at least one column and row"));
    }
    with_gdal(|| {
        let driver = memory_driver()?;
        let dataset = driver.create_with_band_type::<T, _>("", width, height, grids.len())?;
        for (index, (grid, band)) in grids.iter().zip(bands).enumerate() {
            let mut target = dataset.rasterband(index + 1)?;
            target.set_description(band.description)?;
            target.set_no_data_value(no_data)?;
            for top in (0..height).step_by(CHUNK_ROWS) {
                let rows = CHUNK_ROWS.min(height - top);
                let cells = grid.data()[top * width..(top + rows) * width].iter().map(|&v| convert(v)).collect();
                target.write((0, top as isize), (width, rows), &mut Buffer::new((width, rows), cells))?;
            }
        }
        Ok(dataset)
    })
    .map_err(|reason| RasterError::unwritable(path, reason))
}

fn inconsistent(path: &Path, reason: &str) -> RasterError {
    RasterError::InconsistentBands { path: path.to_owned(), reason: reason.to_owned() }
}
