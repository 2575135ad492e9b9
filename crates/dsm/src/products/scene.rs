//! The rasters of a run.

use std::path::{Path, PathBuf};

use crs::{Crs, MapProjection, VerticalDatum};
use formats::raster::{Dem, ImageSource, read_dem};
use numeric::Progress;
use raster::Grid;

use super::error::ProductsError;
use job::run_folder::surface_file;

/// Most cells of a surface: its rasters are held in memory.
const CELLS_MAX: usize = 1 << 28;

/// The surface of a run.
pub(super) struct SurfaceOfRun {
    /// Heights above the vertical datum of `crs`.
    pub(super) dem: Dem,
    pub(super) crs: Crs,
    pub(super) projection: MapProjection,
    /// Folder of the rasters.
    folder: PathBuf,
}

impl SurfaceOfRun {
    /// Reads the heights of a run.
    pub(super) fn open(run: &Path, progress: &dyn Progress) -> Result<Self, ProductsError> {
        let path = surface_file(run);
        if !path.is_file() {
            return Err(ProductsError::NotARun { missing: run.join("dsm/dsm.tif") });
        }
        let size = ImageSource::open(&path)?.info().clone();
        if size.width.saturating_mul(size.height) > CELLS_MAX {
            return Err(ProductsError::TooLarge { width: size.width, height: size.height });
        }
        let dem = read_dem(&path)?;
        let horizontal = dem.horizontal_epsg.ok_or_else(|| ProductsError::NoEpsg { path: path.clone() })?;
        let vertical = dem.vertical.unwrap_or_else(|| {
            progress.warn(&format!(
                "the file does not name the vertical datum of its heights, they are taken as above the ellipsoid: {}",
                path.display()
            ));
            VerticalDatum::Ellipsoid
        });
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let projection = MapProjection::from_epsg(horizontal)?;
        Ok(Self { dem, crs: Crs { horizontal, vertical }, projection, folder })
    }

    /// Reads a raster of the run; NaN is no-data.
    pub(super) fn layer(&self, name: &str) -> Result<Grid<f32>, ProductsError> {
        let path = self.folder.join(name);
        if !path.is_file() {
            return Err(ProductsError::NotARun { missing: path });
        }
        self.raster(&path)
    }

    /// Reads a raster of counts or codes of the run; no-data is 0.
    pub(super) fn codes(&self, name: &str) -> Result<Grid<u8>, ProductsError> {
        Ok(self.layer(name)?.map(|value| if value.is_nan() { 0 } else { *value as u8 }))
    }

    /// Reads the first band of a raster on the grid of the surface; NaN is no-data.
    pub(super) fn raster(&self, path: &Path) -> Result<Grid<f32>, ProductsError> {
        let source = ImageSource::open(path)?;
        let (found, expected) = ((source.info().width, source.info().height), self.size());
        if found != expected {
            return Err(ProductsError::OtherGrid { path: path.to_owned(), found, expected });
        }
        Ok(source.read_samples(1, source.window())?)
    }

    /// Side of a cell, metres.
    pub(super) fn cell_m(&self) -> f64 {
        let (width_m, height_m) = self.dem.cell_size_m(&self.projection);
        (width_m * height_m).sqrt()
    }

    /// Columns and rows.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.dem.heights.width(), self.dem.heights.height())
    }
}
