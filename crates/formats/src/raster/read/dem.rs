//! Reading surface and terrain models, whole or by window: heights, their grid and their vertical
//! datum.
//!
//! Heights are brought to metres and not converted to another datum. The vertical datum is what the
//! file states in its CRS, else in the metadata item `VERTICAL_DATUM`. GDAL moves the georeference
//! of "pixel is point" files by half a pixel, so the grid's positions are right for "pixel is area"
//! and "pixel is point".

use std::path::{Path, PathBuf};

use crs::{CrsIdentity, MapProjection, VerticalDatum};
use gdal::Dataset;
use raster::{GeoTransform, Grid, Window};

use super::source::read_as;
use super::undeclared::undeclared_no_data;
use crate::raster::access::gdal_setup::{open_dataset, with_gdal};
use crate::raster::error::RasterError;
use crate::raster::write::geotiff::stated_datum;
use crate::raster::write::labels::Provenance;

/// Most cells that are read at once (4 GiB of f32).
const CELLS_MAX: usize = 1 << 30;

/// Heights on a georeferenced grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Dem {
    /// The file.
    pub path: PathBuf,
    /// Heights, metres also where the vertical CRS of the file is in feet, with the band's scale
    /// and offset applied. NaN is no-data.
    pub heights: Grid<f32>,
    /// Position of the grid (of the window that was read), in units of the CRS.
    pub geotransform: GeoTransform,
    /// CRS of the file as WKT, if it has one.
    pub crs_wkt: Option<String>,
    /// EPSG code of the horizontal CRS, if known.
    pub horizontal_epsg: Option<u32>,
    /// Vertical datum of the heights, if the file states it.
    pub vertical: Option<VerticalDatum>,
    /// No-data value of the file, if declared.
    pub no_data: Option<f64>,
    /// Images that it was made of, if the file names them.
    pub provenance: Provenance,
}

impl Dem {
    /// Returns the side lengths of a cell along columns and rows in the middle of the grid, metres.
    /// `projection` is that of the grid.
    pub fn cell_size_m(&self, projection: &MapProjection) -> (f64, f64) {
        let (column, row) = (0.5 * self.heights.width() as f64, 0.5 * self.heights.height() as f64);
        let (_, middle) = self.geotransform.map_from_cell(column, row);
        self.geotransform.cell_size_m(projection.metres_per_unit_at(middle))
    }
}

/// Reads the first band of a raster as heights.
///
/// # Errors
/// - [`RasterError::Unreadable`], [`RasterError::NotLocal`] and [`RasterError::NotARaster`] when
///   the file cannot be opened.
/// - [`RasterError::Unsupported`] without bands or georeference, or with more than 2³⁰ cells.
/// - [`RasterError::Damaged`] when GDAL cannot decode the cells.
/// - [`RasterError::UndeclaredNoData`] for cells with a lone value such as −9999 that the file does
///   not declare as no-data.
/// - [`RasterError::Crs`] for a CRS that PROJ cannot read.
pub fn read_dem(path: impl AsRef<Path>) -> Result<Dem, RasterError> {
    let dataset = open_dataset(path.as_ref())?;
    let (width, height) = dataset.raster_size();
    read(path.as_ref(), &dataset, Window::whole(width, height))
}

/// Reads the part of a window that lies inside the raster, as [`read_dem`] does.
///
/// # Errors
/// As [`read_dem`]; [`RasterError::Unsupported`] also when the window does not overlap the raster.
pub fn read_dem_window(path: impl AsRef<Path>, window: Window) -> Result<Dem, RasterError> {
    read(path.as_ref(), &open_dataset(path.as_ref())?, window)
}

fn read(path: &Path, dataset: &Dataset, window: Window) -> Result<Dem, RasterError> {
    let unsupported = |found: String, expected| RasterError::Unsupported { path: path.to_owned(), found, expected };
    let (width, height) = dataset.raster_size();
    let inside = Window::whole(width, height).intersection(&window).ok_or_else(|| {
        unsupported(format!("{width} x {height} cells and a window outside them"), "a window that overlaps the raster")
    })?;
    if inside.width.saturating_mul(inside.height) > CELLS_MAX {
        return Err(unsupported(
            format!("{} x {} cells", inside.width, inside.height),
            "at most 2^30 cells at once: read a window",
        ));
    }
    if dataset.raster_count() == 0 {
        return Err(unsupported("no band".to_owned(), "at least one band of heights"));
    }
    let geotransform = with_gdal(|| dataset.geo_transform()).map_err(|_| {
        unsupported("no georeference".to_owned(), "a raster on a map, such as a surface model, with a geotransform")
    })?;
    let crs_wkt = Some(dataset.projection()).filter(|wkt| !wkt.is_empty());
    let identity = crs_wkt.as_deref().map(CrsIdentity::of).transpose();
    let identity = identity.map_err(|source| RasterError::Crs { path: path.to_owned(), source })?;
    let (mut heights, no_data) = heights(path, dataset, inside)?;
    let vertical = identity.as_ref().and_then(|i| i.vertical).or_else(|| stated_datum(dataset));
    // A datum that PROJ does not know is an error where its heights are converted.
    let metres = vertical.map_or(1.0, |datum| datum.metres_per_unit().unwrap_or(1.0));
    if metres != 1.0 {
        heights.data_mut().iter_mut().for_each(|h| *h = (f64::from(*h) * metres) as f32);
    }
    Ok(Dem {
        path: path.to_owned(),
        heights,
        geotransform: GeoTransform(geotransform).shifted(inside.x as f64, inside.y as f64),
        crs_wkt,
        horizontal_epsg: identity.as_ref().and_then(|i| i.horizontal),
        vertical,
        no_data,
        provenance: Provenance::of(dataset),
    })
}

/// Reads band 1 with its scale and offset applied, and its no-data value. NaN marks void cells.
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
    // A scaled band has counts, which are no heights.
    if scale == 1.0
        && offset == 0.0
        && let Some((value, cells)) = undeclared_no_data(heights.data())
    {
        return Err(RasterError::UndeclaredNoData { path: path.to_owned(), value, cells });
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
