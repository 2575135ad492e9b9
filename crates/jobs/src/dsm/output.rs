//! The files of a run. All are made in a work folder inside the output folder, then each is moved
//! to its final name.
//!
//! A scene that was computed at once is written from memory. The chunks of a large scene go into
//! spools on the disk as they come, and its pictures are reduced to a size that can be looked at.

use std::fs;
use std::path::{Path, PathBuf};

use crs::{Crs, HeightConverter, VerticalDatum};
use io::raster::{Band, BandData, CogPlace, CogRaster, RasterSpool, SpoolBand, write_cog};
use raster::{Grid, NO_DATA, Window};

use crate::dsm::config::DsmConfig;
use crate::dsm::error::DsmError;
use crate::dsm::grid::DsmGrid;
use crate::dsm::rasters::{ChunkRasters, VOID};
use crate::dsm::report::DsmReport;

/// Files of a run, relative to its folder. The report is the last to appear: a folder with a report
/// is complete.
pub(crate) const FILES: [&str; 9] = [
    "dsm/dsm.tif",
    "dsm/sigma.tif",
    "dsm/views.tif",
    "dsm/filled.tif",
    "dsm/confidence.tif",
    "dsm/hillshade.png",
    "dsm/relief.png",
    "used_config.toml",
    "report/report.json",
];
/// Work folder in which files are made before they are moved to their names.
const PARTIAL: &str = ".skysweep-partial";
/// Largest width and height of the pictures of a large scene, pixels.
const PICTURE_SIDE: usize = 4096;

/// Names and contents of the rasters, in the order of [`bands`].
const BANDS: [(&str, SpoolBand<'static>); 5] = [
    ("dsm.tif", SpoolBand { description: "height_m", is_float: true, no_data: NO_DATA as f64 }),
    ("sigma.tif", SpoolBand { description: "height_standard_deviation_m", is_float: true, no_data: NO_DATA as f64 }),
    ("views.tif", SpoolBand { description: "number_of_views", is_float: false, no_data: 0.0 }),
    ("confidence.tif", SpoolBand { description: "confidence_0_to_1", is_float: true, no_data: NO_DATA as f64 }),
    ("filled.tif", SpoolBand { description: "1_filled_0_observed", is_float: false, no_data: VOID as f64 }),
];

/// Returns the contents of the rasters in the order of [`BANDS`]; `heights` come from
/// [`absolute_heights`].
fn bands<'a>(rasters: &'a ChunkRasters, heights: &'a Grid<f32>) -> [BandData<'a>; 5] {
    [
        BandData::F32(heights),
        BandData::F32(&rasters.sigma_m),
        BandData::U8(&rasters.views),
        BandData::F32(&rasters.confidence),
        BandData::U8(&rasters.filled),
    ]
}

/// Refuses early what would fail at the end.
///
/// # Errors
/// [`DsmError::Exists`] for results that may not be replaced, [`DsmError::Output`] for a folder
/// that cannot be written.
pub(crate) fn check_target(config: &DsmConfig) -> Result<(), DsmError> {
    let existing = FILES.iter().map(|f| config.output.join(f)).find(|p| p.exists());
    if let (Some(path), false) = (existing, config.overwrite) {
        return Err(DsmError::Exists { path });
    }
    let created = !config.output.exists();
    let partial = config.output.join(PARTIAL);
    let tried = fs::create_dir_all(&partial).and_then(|()| fs::write(partial.join("probe"), b"skysweep"));
    clean(config, created);
    tried.map_err(|source| DsmError::Output { path: config.output.clone(), source })
}

/// Removes the work folder, and the output folder when this run made it and it is empty.
fn clean(config: &DsmConfig, created: bool) {
    // Best effort: the error that led here is the one to report.
    let _ = fs::remove_dir_all(config.output.join(PARTIAL));
    if created {
        let _ = fs::remove_dir(&config.output);
    }
}

/// Writes the results of a scene that was computed at once.
///
/// # Errors
/// [`DsmError::Output`], [`DsmError::Image`], [`DsmError::Crs`]. Nothing stays behind.
pub(crate) fn write_whole(
    config: &DsmConfig,
    grid: &DsmGrid,
    rasters: &ChunkRasters,
    report: &DsmReport,
) -> Result<(), DsmError> {
    let created = !config.output.exists();
    let written = make_folders(config)
        .and_then(|()| write_rasters(&dsm_folder(config), config.vertical, grid, rasters))
        .and_then(|()| write_texts(config, report))
        .and_then(|()| publish(config));
    clean(config, created && written.is_err());
    written
}

/// The rasters of a large scene, which grow on the disk chunk by chunk. Dropping it before
/// [`ChunkedOutput::finish`] removes what was made.
pub(crate) struct ChunkedOutput<'a> {
    config: &'a DsmConfig,
    grid: &'a DsmGrid,
    created: bool,
    spools: Vec<RasterSpool>,
}

impl<'a> ChunkedOutput<'a> {
    /// Makes empty spools in the work folder.
    ///
    /// # Errors
    /// [`DsmError::Output`], [`DsmError::Image`].
    pub(crate) fn begin(config: &'a DsmConfig, grid: &'a DsmGrid) -> Result<Self, DsmError> {
        let mut out = Self { config, grid, created: !config.output.exists(), spools: Vec::new() };
        make_folders(config)?;
        for (name, band) in BANDS {
            out.spools.push(RasterSpool::create(spool_path(config, name), grid.size, band)?);
        }
        Ok(out)
    }

    /// Puts the cells of a chunk into their place.
    ///
    /// # Errors
    /// [`DsmError::Image`], [`DsmError::Crs`].
    pub(crate) fn put(&mut self, core: Window, rasters: &ChunkRasters) -> Result<(), DsmError> {
        let heights = absolute_heights(&self.grid.part(core), self.config.vertical, rasters)?;
        for (spool, cells) in self.spools.iter_mut().zip(bands(rasters, &heights)) {
            spool.put((core.x as usize, core.y as usize), cells)?;
            spool.flush()?;
        }
        Ok(())
    }

    /// Makes the final files and moves them to their names.
    ///
    /// # Errors
    /// [`DsmError::Output`], [`DsmError::Image`].
    pub(crate) fn finish(mut self, report: &DsmReport) -> Result<(), DsmError> {
        let (config, grid) = (self.config, self.grid);
        let folder = dsm_folder(config);
        if let Some(heights) = self.spools.first() {
            let factor = grid.size.0.max(grid.size.1).div_ceil(PICTURE_SIDE);
            let reduced = reduced(heights, factor)?;
            write_pictures(&folder, &reduced, grid.gsd_m * factor as f64)?;
        }
        let crs = Crs { horizontal: grid.epsg, vertical: config.vertical };
        let place =
            CogPlace { geotransform: grid.geotransform, crs, metadata: &[], threads: rayon::current_num_threads() };
        for ((name, _), spool) in BANDS.iter().zip(self.spools.drain(..)) {
            spool.into_cog(folder.join(name), place, false)?;
        }
        write_texts(config, report)?;
        publish(config)?;
        self.created = false;
        Ok(())
    }
}

impl Drop for ChunkedOutput<'_> {
    fn drop(&mut self) {
        self.spools.clear();
        clean(self.config, self.created);
    }
}

/// Returns the means of the known cells of squares of side `factor`, NaN where none is known.
fn reduced(spool: &RasterSpool, factor: usize) -> Result<Grid<f32>, DsmError> {
    let (width, height) = spool.size();
    let mut out = Grid::filled(width.div_ceil(factor), height.div_ceil(factor), f32::NAN);
    for y in 0..out.height() {
        let top = y * factor;
        let strip = Window { x: 0, y: top as i64, width, height: factor.min(height - top) };
        let cells = spool.read(strip)?;
        let mut sums = vec![(0.0f64, 0u32); out.width()];
        for row in 0..cells.height() {
            for (x, h) in cells.row(row).iter().enumerate().filter(|(_, h)| !h.is_nan()) {
                let (sum, n) = &mut sums[x / factor];
                *sum += f64::from(*h);
                *n += 1;
            }
        }
        for (cell, (sum, n)) in out.row_mut(y).iter_mut().zip(sums).filter(|(_, (_, n))| *n > 0) {
            *cell = (sum / f64::from(n)) as f32;
        }
    }
    Ok(out)
}

fn dsm_folder(config: &DsmConfig) -> PathBuf {
    config.output.join(PARTIAL).join("dsm")
}

fn spool_path(config: &DsmConfig, name: &str) -> PathBuf {
    config.output.join(PARTIAL).join("spool").join(name)
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> DsmError + use<> {
    let path = path.to_owned();
    move |source| DsmError::Output { path: path.clone(), source }
}

fn make_folders(config: &DsmConfig) -> Result<(), DsmError> {
    let root = config.output.join(PARTIAL);
    let made = |folder| fs::create_dir_all(root.join(folder)).map_err(failed(&config.output));
    ["dsm", "report", "spool"].into_iter().try_for_each(made)
}

fn write_texts(config: &DsmConfig, report: &DsmReport) -> Result<(), DsmError> {
    let root = config.output.join(PARTIAL);
    let json = serde_json::to_string_pretty(report).map_err(|e| failed(&root)(e.into()))?;
    fs::write(root.join("report/report.json"), json + "\n").map_err(failed(&root))?;
    let used = toml::to_string_pretty(config).map_err(|e| failed(&root)(std::io::Error::other(e)))?;
    fs::write(root.join("used_config.toml"), used).map_err(failed(&root))
}

/// Writes hillshade and coloured relief of heights in cells of `cell_m`.
fn write_pictures(folder: &Path, heights: &Grid<f32>, cell_m: f64) -> Result<(), DsmError> {
    let shade = raster::hillshade(heights, (cell_m, cell_m), raster::Light::default());
    io::raster::write_png_gray(folder.join("hillshade.png"), &shade, false)?;
    // Without the extreme hundredths, so that one mast does not take the colours from the rest.
    let (low, high) = raster::height_percentiles(heights, 1.0, 99.0).unwrap_or((0.0, 1.0));
    let relief = raster::coloured_relief(heights, &shade, low, high);
    Ok(io::raster::write_png_rgb(folder.join("relief.png"), &relief, false)?)
}

fn write_rasters(
    folder: &Path,
    vertical: VerticalDatum,
    grid: &DsmGrid,
    rasters: &ChunkRasters,
) -> Result<(), DsmError> {
    let crs = Crs { horizontal: grid.epsg, vertical };
    let heights = absolute_heights(grid, vertical, rasters)?;
    write_pictures(folder, &heights, grid.gsd_m)?;
    for ((name, band), data) in BANDS.iter().zip(bands(rasters, &heights)) {
        let bands = [Band { description: band.description, data }];
        let raster = CogRaster { no_data: Some(band.no_data), ..CogRaster::new(&bands, grid.geotransform, crs) };
        write_cog(folder.join(name), &raster, false)?;
    }
    Ok(())
}

/// Returns heights above the vertical datum, as they are written; NaN in voids.
fn absolute_heights(grid: &DsmGrid, vertical: VerticalDatum, rasters: &ChunkRasters) -> Result<Grid<f32>, DsmError> {
    let mut out = rasters.height_m.map(|h| written(f64::from(*h) + rasters.origin_m));
    if vertical == VerticalDatum::Ellipsoid {
        return Ok(out);
    }
    let (projection, converter) = (grid.projection()?, HeightConverter::new(vertical)?);
    let columns = out.width();
    let (mut x, mut y, mut h) = (vec![0.0; columns], vec![0.0; columns], vec![0.0; columns]);
    for row in 0..out.height() {
        for (c, (x, y)) in x.iter_mut().zip(&mut y).enumerate() {
            (*x, *y) = grid.geotransform.map_from_cell(c as f64, row as f64);
            h[c] = f64::from(rasters.height_m[(c, row)]) + rasters.origin_m;
        }
        projection.lonlat_from_map_slices(&mut x, &mut y)?;
        converter.datum_from_ellipsoid_slices(&x, &y, &mut h)?;
        out.row_mut(row).iter_mut().zip(&h).for_each(|(o, h)| *o = written(*h));
    }
    Ok(out)
}

/// Rounds a height to whole 1024ths of a metre, a hundredth of the precision of any image. The bits
/// behind them are noise that takes a third of the file and of the time to compress it.
fn written(height_m: f64) -> f32 {
    const UNIT_M: f64 = 1.0 / 1024.0;
    ((height_m / UNIT_M).round() * UNIT_M) as f32
}

/// Moves every file to its final name.
fn publish(config: &DsmConfig) -> Result<(), DsmError> {
    let move_one = |name: &str| {
        let (from, to): (PathBuf, PathBuf) = (config.output.join(PARTIAL).join(name), config.output.join(name));
        let made = to.parent().map_or(Ok(()), fs::create_dir_all);
        made.and_then(|()| fs::rename(&from, &to)).map_err(|source| DsmError::Output { path: to, source })
    };
    FILES.iter().try_for_each(|f| move_one(f))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_heights_are_near() {
        for i in 0..1000 {
            let v = 0.001 + 0.37 * f64::from(i);
            assert!((f64::from(written(v)) - v).abs() <= 0.5 / 1024.0 + 1e-5);
        }
        assert!(written(f64::NAN).is_nan());
    }
}
