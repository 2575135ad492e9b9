//! Surface and terrain models read whole or by window: heights, their grid and what they are measured from.
//!
//! The vertical datum is reported as the file states it (in its CRS, else in the item `VERTICAL_DATUM`), and `None` where it does not: nothing is converted here.
//! GDAL moves the georeference of "pixel is point" files by half a pixel, so the grid's positions are right for both
//! kinds.

use std::path::{Path, PathBuf};

use crs::{CrsIdentity, VerticalDatum};
use gdal::{Dataset, Metadata};
use raster::{GeoTransform, Grid, Window};

use super::geotiff::VERTICAL_DATUM;
use super::source::read_as;
use super::{RasterError, open_dataset, with_gdal};

/// More cells than this are not read at once (4 GiB of f32): name a window.
const CELLS_MAX: usize = 1 << 30;

/// Heights on a georeferenced grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Dem {
    /// Where it came from.
    pub path: PathBuf,
    /// Heights with the band's scale and offset applied; NaN where there is none.
    pub heights: Grid<f32>,
    /// Position of the grid (of the window that was read), in units of the CRS.
    pub geotransform: GeoTransform,
    /// CRS of the file as WKT, if it has one.
    pub crs_wkt: Option<String>,
    /// EPSG code of the horizontal CRS, if known.
    pub horizontal_epsg: Option<u32>,
    /// What the heights are measured from, if the file says.
    pub vertical: Option<VerticalDatum>,
    /// The no-data value in the file.
    pub no_data: Option<f64>,
}

/// Reads the first band of a raster as heights.
///
/// # Errors
/// Those of opening; [`RasterError::Unsupported`] without georeference or with more than 2³⁰ cells;
/// [`RasterError::Damaged`] when GDAL cannot decode the cells; [`RasterError::Crs`] for a CRS that PROJ cannot read.
pub fn read_dem(path: impl AsRef<Path>) -> Result<Dem, RasterError> {
    let dataset = open_dataset(path.as_ref())?;
    let (width, height) = dataset.raster_size();
    read(path.as_ref(), &dataset, Window::whole(width, height))
}

/// As [`read_dem`], for the part of a window that lies inside the raster.
///
/// # Errors
/// As [`read_dem`]; [`RasterError::Unsupported`] when the window misses the raster.
pub fn read_dem_window(path: impl AsRef<Path>, window: Window) -> Result<Dem, RasterError> {
    read(path.as_ref(), &open_dataset(path.as_ref())?, window)
}

fn read(path: &Path, dataset: &Dataset, window: Window) -> Result<Dem, RasterError> {
    let unsupported = |found: String, expected| RasterError::Unsupported { path: path.to_owned(), found, expected };
    let (width, height) = dataset.raster_size();
    let inside = Window::whole(width, height).intersection(&window).ok_or_else(|| {
        unsupported(format!("{width} x {height} cells and a window outside them"), "a window that meets the raster")
    })?;
    if inside.width.saturating_mul(inside.height) > CELLS_MAX {
        return Err(unsupported(
            format!("{} x {} cells", inside.width, inside.height),
            "at most 2^30 cells at once: read a part",
        ));
    }
    if dataset.raster_count() == 0 {
        return Err(unsupported("no band".to_owned(), "a band of heights"));
    }
    let geotransform = with_gdal(|| dataset.geo_transform())
        .map_err(|_| unsupported("no georeference".to_owned(), "a geotransform"))?;
    let crs_wkt = Some(dataset.projection()).filter(|wkt| !wkt.is_empty());
    let identity = crs_wkt.as_deref().map(CrsIdentity::of).transpose();
    let identity = identity.map_err(|source| RasterError::Crs { path: path.to_owned(), source })?;
    let (heights, no_data) = heights(path, dataset, inside)?;
    Ok(Dem {
        path: path.to_owned(),
        heights,
        geotransform: GeoTransform(geotransform).shifted(inside.x as f64, inside.y as f64),
        crs_wkt,
        horizontal_epsg: identity.as_ref().and_then(|i| i.horizontal),
        vertical: identity.and_then(|i| i.vertical).or_else(|| stated_datum(dataset)),
        no_data,
    })
}

/// The datum in the metadata item that this toolkit writes.
fn stated_datum(dataset: &Dataset) -> Option<VerticalDatum> {
    dataset.metadata_item(VERTICAL_DATUM, "")?.parse().ok()
}

/// Band 1 in its physical unit, with NaN for void cells.
fn heights(path: &Path, dataset: &Dataset, inside: Window) -> Result<(Grid<f32>, Option<f64>), RasterError> {
    let damaged = |reason: String| RasterError::damaged(path, reason);
    let band = with_gdal(|| dataset.rasterband(1)).map_err(damaged)?;
    let no_data = band.no_data_value();
    let (scale, offset) = (band.scale().unwrap_or(1.0), band.offset().unwrap_or(0.0));
    let mut heights: Grid<f32> = read_as(path, dataset, 1, inside)?;
    let flags = with_gdal(|| band.mask_flags()).map_err(damaged)?;
    let masked = !flags.is_all_valid() && !flags.is_nodata();
    let mask: Option<Grid<u8>> = masked.then(|| mask_of(path, &band, inside)).transpose()?;
    for (i, value) in heights.data_mut().iter_mut().enumerate() {
        let void = no_data.is_some_and(|n| *value == n as f32) || mask.as_ref().is_some_and(|m| m.data()[i] == 0);
        *value = if void || !value.is_finite() {
            f32::NAN
        } else if scale == 1.0 && offset == 0.0 {
            *value
        } else {
            (f64::from(*value) * scale + offset) as f32
        };
    }
    Ok((heights, no_data))
}

fn mask_of(path: &Path, band: &gdal::raster::RasterBand<'_>, inside: Window) -> Result<Grid<u8>, RasterError> {
    let size = (inside.width, inside.height);
    let buffer =
        with_gdal(|| band.open_mask_band()?.read_as::<u8>((inside.x as isize, inside.y as isize), size, size, None));
    let data = buffer.map_err(|reason| RasterError::damaged(path, reason))?.into_shape_and_vec().1;
    Grid::from_vec(inside.width, inside.height, data)
        .ok_or_else(|| RasterError::damaged(path, "the mask has another size than the band"))
}
