//! The files of a run. All are made in a work folder inside the output folder, then each is moved
//! to its final name. An old report is removed before the first and the new one is moved last, so a
//! folder with a report holds the files of one run.
//!
//! A scene that was computed at once is written from memory. The chunks of a large scene go into
//! spools on the disk as they come, and its pictures are reduced to a size that can be looked at.

use std::path::{Path, PathBuf};

use crs::{Crs, HeightConverter, VerticalDatum};
use io::raster::{Band, BandData, CogPlace, CogRaster, RasterSpool, SpoolBand, write_cog};
use raster::{Grid, NO_DATA, Window};
use tempfile::TempDir;

use crate::dsm::config::DsmConfig;
use crate::dsm::error::DsmError;
use crate::dsm::grid::DsmGrid;
use crate::dsm::rasters::{ChunkRasters, VOID};
use crate::dsm::report::DsmReport;
use crate::eval::remove_evaluation;
use crate::files::{FileError, create_folder, write_json};
use crate::job_paths::relative;
use crate::output_folder::OutputFolder;

/// Files of a run, relative to its folder. The report is the last to appear: a folder with a report
/// is complete.
pub(crate) const FILES: [&str; 10] = [
    "dsm/dsm.tif",
    "dsm/sigma.tif",
    "dsm/views.tif",
    "dsm/filled.tif",
    "dsm/source.tif",
    "dsm/confidence.tif",
    "dsm/hillshade.png",
    "dsm/relief.png",
    USED_CONFIG,
    "report/report.json",
];
/// Configuration of the run, as a job file.
pub(crate) const USED_CONFIG: &str = "used_config.toml";
/// Largest width and height of the pictures of a large scene, pixels.
const PICTURE_SIDE: usize = 4096;

/// The only raster of heights.
const HEIGHTS: &str = "dsm.tif";

/// Names and contents of the rasters, in the order of [`bands`].
const BANDS: [(&str, SpoolBand<'static>); 6] = [
    (HEIGHTS, SpoolBand { description: "height_m", is_float: true, no_data: NO_DATA as f64 }),
    ("sigma.tif", SpoolBand { description: "height_standard_deviation_m", is_float: true, no_data: NO_DATA as f64 }),
    ("views.tif", SpoolBand { description: "number_of_views", is_float: false, no_data: 0.0 }),
    ("confidence.tif", SpoolBand { description: "confidence_0_to_1", is_float: true, no_data: NO_DATA as f64 }),
    ("filled.tif", SpoolBand { description: "1_filled_0_observed", is_float: false, no_data: VOID as f64 }),
    ("source.tif", SpoolBand { description: SOURCE_CODES, is_float: false, no_data: 0.0 }),
];
/// Description of the codes of [`sweep::fusion::CellSource`].
const SOURCE_CODES: &str = "0_outside_1_observed_2_filled_hidden_3_filled_surface_4_filled_narrow_\
                            10_void_unmatched_11_void_blank_12_void_hidden_13_void_masked";

/// Returns the contents of the rasters in the order of [`BANDS`]; `heights` come from
/// [`absolute_heights`].
fn bands<'a>(rasters: &'a ChunkRasters, heights: &'a Grid<f32>) -> [BandData<'a>; 6] {
    [
        BandData::F32(heights),
        BandData::F32(&rasters.sigma_m),
        BandData::U8(&rasters.views),
        BandData::F32(&rasters.confidence),
        BandData::U8(&rasters.filled),
        BandData::U8(&rasters.source),
    ]
}

/// The output folder of a run, with the work folder in which its files are made. Dropping it before
/// the files are published removes what was made.
pub(crate) struct DsmFolder {
    // Dropped first, so that an empty output folder can be removed after it.
    work: TempDir,
    folder: OutputFolder,
}

impl DsmFolder {
    /// Takes the output folder for this run, and refuses early what would fail at the end.
    ///
    /// # Errors
    /// [`DsmError::InUse`] when another run writes into the folder, [`DsmError::Exists`] for
    /// results that may not be replaced, [`DsmError::Output`] for a folder that cannot be written.
    pub(crate) fn take(config: &DsmConfig) -> Result<Self, DsmError> {
        let folder = OutputFolder::take(&config.output)?;
        if !config.overwrite {
            refuse_results(&config.output, &FILES)?;
        }
        Self::inside(folder)
    }

    /// Makes the work folder inside a folder that this run has taken.
    ///
    /// # Errors
    /// [`DsmError::Output`].
    pub(crate) fn inside(folder: OutputFolder) -> Result<Self, DsmError> {
        let work = folder.work_folder()?;
        for name in ["dsm", "report", "spool"] {
            create_folder(&work.path().join(name))?;
        }
        Ok(Self { work, folder })
    }

    fn dsm(&self) -> PathBuf {
        self.work.path().join("dsm")
    }

    fn spool(&self, name: &str) -> PathBuf {
        self.work.path().join("spool").join(name)
    }

    /// Moves every file to its final name. Results about the DSM that is replaced go with it.
    fn publish(&self) -> Result<(), DsmError> {
        if let Some(report) = FILES.last() {
            self.folder.remove(report)?;
        }
        remove_evaluation(&self.folder)?;
        Ok(FILES.iter().try_for_each(|name| self.folder.publish(self.work.path(), name))?)
    }
}

/// Refuses results of these names in a folder.
///
/// # Errors
/// [`DsmError::Exists`] with the first that is there.
pub(crate) fn refuse_results(folder: &Path, names: &[&str]) -> Result<(), DsmError> {
    let existing = names.iter().map(|name| folder.join(name)).find(|path| path.symlink_metadata().is_ok());
    existing.map_or(Ok(()), |path| Err(DsmError::Exists { path }))
}

/// Writes a configuration as a job file, whose paths are relative to `folder`.
///
/// # Errors
/// [`DsmError::Output`], [`DsmError::File`].
pub(crate) fn write_config(path: &Path, config: &DsmConfig, folder: &Path) -> Result<(), DsmError> {
    let mut named = config.clone();
    named.map_paths(|path| relative(path, folder));
    let text = toml::to_string_pretty(&named)
        .map_err(|e| DsmError::Output { path: path.to_owned(), source: std::io::Error::other(e) })?;
    Ok(io::write_bytes(path, text.as_bytes(), false).map_err(FileError::from)?)
}

/// Writes the results of a scene that was computed at once.
///
/// # Errors
/// [`DsmError::Output`], [`DsmError::Image`], [`DsmError::Crs`]. Nothing stays behind.
pub(crate) fn write_whole(
    folder: &DsmFolder,
    config: &DsmConfig,
    grid: &DsmGrid,
    rasters: &ChunkRasters,
    report: &DsmReport,
) -> Result<(), DsmError> {
    write_rasters(&folder.dsm(), config.vertical, grid, rasters)?;
    write_texts(folder, config, report)?;
    folder.publish()
}

/// The rasters of a large scene, which grow on the disk chunk by chunk. Dropping it before
/// [`ChunkedOutput::finish`] removes what was made.
pub(crate) struct ChunkedOutput<'a> {
    config: &'a DsmConfig,
    grid: &'a DsmGrid,
    spools: Vec<RasterSpool>,
    folder: DsmFolder,
}

impl<'a> ChunkedOutput<'a> {
    /// Makes empty spools in the work folder.
    ///
    /// # Errors
    /// [`DsmError::Output`] also for a disk with too little space; [`DsmError::Image`].
    pub(crate) fn begin(folder: DsmFolder, config: &'a DsmConfig, grid: &'a DsmGrid) -> Result<Self, DsmError> {
        let cell_bytes: u64 = BANDS.iter().map(|(_, band)| if band.is_float { 4 } else { 1 }).sum();
        let needed_bytes = grid.size.0 as u64 * grid.size.1 as u64 * cell_bytes;
        io::atomic::require_space(&config.output, needed_bytes).map_err(FileError::from)?;
        let mut spools = Vec::with_capacity(BANDS.len());
        for (name, band) in BANDS {
            spools.push(RasterSpool::create(folder.spool(name), grid.size, band)?);
        }
        Ok(Self { config, grid, spools, folder })
    }

    /// Puts the cells of a chunk into their place.
    ///
    /// # Errors
    /// [`DsmError::Image`], [`DsmError::Crs`].
    pub(crate) fn put(&mut self, core: Window, rasters: &ChunkRasters) -> Result<(), DsmError> {
        let heights = absolute_heights(&self.grid.part(core), self.config.vertical, rasters)?;
        for (spool, cells) in self.spools.iter_mut().zip(bands(rasters, &heights)) {
            spool.put((core.x as usize, core.y as usize), cells)?;
        }
        Ok(())
    }

    /// Makes the final files and moves them to their names.
    ///
    /// # Errors
    /// [`DsmError::Output`], [`DsmError::Image`].
    pub(crate) fn finish(self, report: &DsmReport) -> Result<(), DsmError> {
        let Self { config, grid, spools, folder } = self;
        if let Some(heights) = spools.first() {
            let factor = grid.size.0.max(grid.size.1).div_ceil(PICTURE_SIDE);
            let reduced = reduced(heights, factor)?;
            write_pictures(&folder.dsm(), &reduced, grid.gsd_m * factor as f64)?;
        }
        let crs = Crs { horizontal: grid.epsg, vertical: config.vertical };
        let geotransform = grid.geotransform;
        for ((name, _), spool) in BANDS.iter().zip(spools) {
            let holds_heights = *name == HEIGHTS;
            let place =
                CogPlace { geotransform, crs, holds_heights, metadata: &[], threads: rayon::current_num_threads() };
            spool.into_cog(folder.dsm().join(name), place, false)?;
        }
        write_texts(&folder, config, report)?;
        folder.publish()
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

fn write_texts(folder: &DsmFolder, config: &DsmConfig, report: &DsmReport) -> Result<(), DsmError> {
    let root = folder.work.path();
    write_json(&root.join("report/report.json"), report, false)?;
    write_config(&root.join(USED_CONFIG), config, folder.folder.path())
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
        let holds_heights = *name == HEIGHTS;
        let raster =
            CogRaster { no_data: Some(band.no_data), holds_heights, ..CogRaster::new(&bands, grid.geotransform, crs) };
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A run that is killed while it publishes leaves no report of an older run beside its files.
    #[test]
    fn the_report_goes_first_and_comes_last() {
        let root = tempfile::tempdir().unwrap();
        let mut config = DsmConfig::new(Vec::new(), root.path().join("out"));
        config.overwrite = true;
        for name in FILES {
            let path = config.output.join(name);
            create_folder(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"old").unwrap();
        }
        let folder = DsmFolder::take(&config).unwrap();
        std::fs::write(folder.dsm().join("dsm.tif"), b"new").unwrap();
        // The second file is missing, so publishing stops after the first.
        assert!(folder.publish().is_err());
        let content = |name: &str| std::fs::read(config.output.join(name)).ok();
        assert_eq!(content("dsm/dsm.tif").as_deref(), Some(&b"new"[..]));
        assert_eq!(content("dsm/sigma.tif").as_deref(), Some(&b"old"[..]));
        assert_eq!(content("report/report.json"), None);
    }

    #[test]
    fn written_heights_are_near() {
        for i in 0..1000 {
            let v = 0.001 + 0.37 * f64::from(i);
            assert!((f64::from(written(v)) - v).abs() <= 0.5 / 1024.0 + 1e-5);
        }
        assert!(written(f64::NAN).is_nan());
    }
}
