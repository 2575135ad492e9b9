//! Rasters that are written window by window on disk, for results that do not fit into memory.
//!
//! A spool is an uncompressed tiled GeoTIFF. Its unwritten tiles take no space and read as no-data.
//! When all windows are written, it is copied into a Cloud-Optimised GeoTIFF block by block.
//! Windows that begin and end on tile borders ([`SPOOL_TILE`]) are written without reading; for
//! other windows GDAL reads the tiles at their border first.

use std::path::{Path, PathBuf};

use gdal::raster::{Buffer, GdalType, RasterCreationOptions};
use gdal::{Dataset, DatasetOptions, DriverManager, GdalOpenFlags, Metadata};
use raster::{Grid, NO_DATA, Window};

use super::band::BandData;
use super::geotiff::{CogPlace, Sampling, finish_cog};
use crate::atomic::write_path;
use crate::raster::access::gdal_setup::{left_over_messages, with_gdal};
use crate::raster::error::RasterError;
use crate::raster::read::source::read_as;
use crate::raster::read::vertical_unit::to_vertical_unit;

/// Side length of a spool's tiles, cells.
pub const SPOOL_TILE: usize = 256;

/// A raster with one band that is filled on disk.
pub struct RasterSpool {
    path: PathBuf,
    dataset: Dataset,
    /// Columns and rows.
    size: (usize, usize),
    is_float: bool,
}

/// Properties of the band of a spool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpoolBand<'a> {
    /// Name of the band with its unit, such as `height_m`.
    pub description: &'a str,
    /// Whether cells are f32 (NaN is no-data); otherwise they are u8.
    pub is_float: bool,
    /// Value of cells that were not written. It also replaces NaN.
    pub no_data: f64,
}

impl<'a> SpoolBand<'a> {
    /// A band of heights or other quantities, with no-data −32768.
    pub fn float(description: &'a str) -> Self {
        Self { description, is_float: true, no_data: f64::from(NO_DATA) }
    }

    /// A band of masks or counts.
    pub fn bytes(description: &'a str, no_data: u8) -> Self {
        Self { description, is_float: false, no_data: f64::from(no_data) }
    }
}

impl RasterSpool {
    /// Creates an empty spool of `size` (columns, rows). An older file of the same name is
    /// replaced.
    ///
    /// # Errors
    /// [`RasterError::NotWritten`] when GDAL or the system refuses.
    pub fn create(path: impl AsRef<Path>, size: (usize, usize), band: SpoolBand<'_>) -> Result<Self, RasterError> {
        let path = path.as_ref().to_owned();
        let tile = SPOOL_TILE.to_string();
        let items = [
            ("TILED", "YES"),
            ("BLOCKXSIZE", tile.as_str()),
            ("BLOCKYSIZE", tile.as_str()),
            ("SPARSE_OK", "TRUE"),
            ("BIGTIFF", "IF_SAFER"),
        ];
        let made = with_gdal(|| {
            let options = RasterCreationOptions::from_iter(items.iter().map(|(key, value)| format!("{key}={value}")));
            let driver = DriverManager::get_driver_by_name("GTiff")?;
            let dataset = if band.is_float {
                driver.create_with_band_type_with_options::<f32, _>(&path, size.0, size.1, 1, &options)?
            } else {
                driver.create_with_band_type_with_options::<u8, _>(&path, size.0, size.1, 1, &options)?
            };
            let mut only = dataset.rasterband(1)?;
            only.set_no_data_value(Some(band.no_data))?;
            only.set_description(band.description)?;
            Ok(dataset)
        });
        let dataset = made.map_err(|reason| RasterError::unwritable(&path, reason))?;
        Ok(Self { path, dataset, size, is_float: band.is_float })
    }

    /// Opens a spool that an earlier process left, to continue it.
    ///
    /// # Errors
    /// [`RasterError::NotARaster`] when GDAL cannot open it; [`RasterError::InconsistentBands`] for
    /// another size or more than one band.
    pub fn reopen(path: impl AsRef<Path>, size: (usize, usize), band: SpoolBand<'_>) -> Result<Self, RasterError> {
        let path = path.as_ref().to_owned();
        let open_flags = GdalOpenFlags::GDAL_OF_RASTER | GdalOpenFlags::GDAL_OF_UPDATE;
        let dataset = with_gdal(|| Dataset::open_ex(&path, DatasetOptions { open_flags, ..Default::default() }))
            .map_err(|reason| RasterError::NotARaster { path: path.clone(), reason })?;
        if dataset.raster_size() != size || dataset.raster_count() != 1 {
            let reason = format!("{:?} cells in {} bands", dataset.raster_size(), dataset.raster_count());
            return Err(RasterError::InconsistentBands { path, reason });
        }
        Ok(Self { path, dataset, size, is_float: band.is_float })
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Writes a window of cells with its first cell at `at` (column, row) to the disk, and reads it
    /// back, because GDAL does not report every failure of a write.
    ///
    /// # Errors
    /// [`RasterError::InconsistentBands`] for another cell type or a window that reaches outside;
    /// [`RasterError::NotWritten`] when GDAL or the system refuses, or other cells come back.
    pub fn put(&mut self, at: (usize, usize), cells: BandData<'_>) -> Result<(), RasterError> {
        match (cells, self.is_float) {
            (BandData::F32(grid), true) => self.write(at, grid, |v| if v.is_nan() { NO_DATA } else { v }),
            (BandData::U8(grid), false) => self.write(at, grid, |v| v),
            _ => Err(self.inconsistent("the cells are of another type than the spool")),
        }
    }

    /// Writes everything that GDAL still holds in memory to the file.
    ///
    /// # Errors
    /// [`RasterError::NotWritten`] when GDAL or the system refuses.
    pub fn flush(&mut self) -> Result<(), RasterError> {
        with_gdal(|| self.dataset.flush_cache()).map_err(|reason| RasterError::unwritable(&self.path, reason))
    }

    /// Reads the cells of a window inside the spool. NaN is no-data.
    ///
    /// # Errors
    /// [`RasterError::Damaged`] when GDAL cannot decode the cells.
    pub fn read(&self, inside: Window) -> Result<Grid<f32>, RasterError> {
        let no_data = with_gdal(|| Ok(self.dataset.rasterband(1)?.no_data_value()))
            .map_err(|reason| RasterError::damaged(&self.path, reason))?;
        let mut cells = read_as::<f32>(&self.path, &self.dataset, 1, inside)?;
        let void = no_data.map(|v| v as f32);
        cells.data_mut().iter_mut().filter(|v| Some(**v) == void).for_each(|v| *v = f32::NAN);
        Ok(cells)
    }

    /// Copies the cells into a Cloud-Optimised GeoTIFF (as [`crate::raster::write_cog`] makes it)
    /// and removes the spool.
    ///
    /// # Errors
    /// [`RasterError::NotWritten`] for a file that exists without `overwrite`, and when GDAL or the
    /// system refuses.
    pub fn into_cog(mut self, path: impl AsRef<Path>, place: CogPlace<'_>, overwrite: bool) -> Result<(), RasterError> {
        let path = path.as_ref();
        self.flush()?;
        let sampling = if self.is_float { Sampling::Average } else { Sampling::Nearest };
        write_path(path, overwrite, |made| {
            let in_unit =
                if place.holds_heights { to_vertical_unit(&self.dataset, place.crs.vertical()) } else { Ok(()) };
            let finished = in_unit.and_then(|()| finish_cog(&mut self.dataset, place, sampling, made));
            finished.map_err(|reason| RasterError::unwritable(path, reason))
        })?;
        let spool = self.path.clone();
        drop(self);
        // The result is complete, so a spool that cannot be removed is not an error.
        let _ = std::fs::remove_file(spool);
        Ok(())
    }

    fn write<T: GdalType + Copy + PartialEq>(
        &mut self,
        at: (usize, usize),
        grid: &Grid<T>,
        convert: impl Fn(T) -> T,
    ) -> Result<(), RasterError> {
        let size = (grid.width(), grid.height());
        if at.0 + size.0 > self.size.0 || at.1 + size.1 > self.size.1 {
            return Err(self.inconsistent("the window reaches outside the spool"));
        }
        let cells = grid.data().iter().map(|&v| convert(v)).collect();
        let mut buffer = Buffer::new(size, cells);
        with_gdal(|| self.dataset.rasterband(1)?.write((at.0 as isize, at.1 as isize), size, &mut buffer))
            .map_err(|reason| RasterError::unwritable(&self.path, reason))?;
        // Flushing drops the blocks from GDAL's cache, so that the file itself is read.
        self.flush()?;
        let reported = left_over_messages();
        let window = Window { x: at.0 as i64, y: at.1 as i64, width: size.0, height: size.1 };
        let found = read_as::<T>(&self.path, &self.dataset, 1, window);
        if !found.is_ok_and(|found| found.data() == buffer.data()) {
            let reason =
                format!("other cells come back than were written; check that the disk is not full: {reported}");
            return Err(RasterError::unwritable(&self.path, reason));
        }
        Ok(())
    }

    fn inconsistent(&self, reason: &str) -> RasterError {
        RasterError::InconsistentBands { path: self.path.clone(), reason: reason.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::{Band, CogRaster, read_dem, write_cog};
    use crs::{Crs, VerticalDatum};
    use raster::GeoTransform;

    /// Windows in any order, some of them missing, give the same file as a grid in memory.
    #[test]
    fn a_spool_becomes_the_raster_that_memory_would_give() {
        let folder = tempfile::tempdir().unwrap();
        let crs = Crs { horizontal: 32631, vertical: VerticalDatum::Ellipsoid };
        let geotransform = GeoTransform::north_up(500_000.0, 4_800_000.0, 0.5);
        let mut whole = Grid::filled(700, 600, f32::NAN);
        let mut spool =
            RasterSpool::create(folder.path().join("s.tif"), (700, 600), SpoolBand::float("height_m")).unwrap();
        for (x, y) in [(512, 256), (0, 0), (256, 512)] {
            let part = Grid::filled(188.min(700 - x), 88.min(600 - y), (x + y) as f32 * 0.25);
            (0..part.height()).for_each(|r| whole.row_mut(y + r)[x..x + part.width()].copy_from_slice(part.row(r)));
            spool.put((x, y), BandData::F32(&part)).unwrap();
        }
        drop(spool);
        let mut spool =
            RasterSpool::reopen(folder.path().join("s.tif"), (700, 600), SpoolBand::float("height_m")).unwrap();
        assert!(spool.put((0, 0), BandData::U8(&Grid::filled(2, 2, 1))).is_err());
        assert!(spool.put((699, 0), BandData::F32(&Grid::filled(2, 2, 1.0))).is_err());
        let (a, b) = (folder.path().join("a.tif"), folder.path().join("b.tif"));
        let place = CogPlace {
            geotransform,
            crs: crs.into(),
            holds_heights: true,
            provenance: None,
            metadata: &[],
            threads: 1,
        };
        spool.into_cog(&a, place, false).unwrap();
        assert!(!folder.path().join("s.tif").exists());
        let bands = [Band { description: "height_m", data: BandData::F32(&whole) }];
        write_cog(&b, &CogRaster::new(&bands, geotransform, crs), false).unwrap();
        let same = |x: &f32, y: &f32| x == y || (x.is_nan() && y.is_nan());
        let (a, b) = (read_dem(&a).unwrap(), read_dem(&b).unwrap());
        assert_eq!((a.geotransform, a.vertical, a.horizontal_epsg), (b.geotransform, b.vertical, b.horizontal_epsg));
        assert!(a.heights.data().iter().zip(b.heights.data()).all(|(x, y)| same(x, y)));
    }
}
