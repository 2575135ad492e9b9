//! Writing a run's results: first all beside their places, then each to its final name.

use std::fs;
use std::path::{Path, PathBuf};

use geodesy::{Crs, HeightConverter, VerticalDatum};
use io::raster::{Band, BandData, CogRaster, write_cog};
use raster::{Grid, NO_DATA};
use sweep::fusion::Surface;

use crate::config::DsmConfig;
use crate::error::PipelineError;
use crate::report::DsmReport;
use crate::setup::OutputGrid;

/// The files of a run, relative to its folder.
const FILES: [&str; 9] = [
    "dsm/dsm.tif",
    "dsm/sigma.tif",
    "dsm/views.tif",
    "dsm/filled.tif",
    "dsm/confidence.tif",
    "dsm/hillshade.png",
    "dsm/relief.png",
    "used_config.toml",
    // The last to appear: a folder with a report is complete.
    "report/report.json",
];
/// Where files are made before they are moved to their names.
const PARTIAL: &str = ".skysweep-partial";

/// The rasters of a run, heights above the ellipsoid.
#[derive(Debug)]
pub(crate) struct Product {
    origin_m: f64,
    /// Above the origin, NaN in voids.
    height_m: Grid<f32>,
    sigma_m: Grid<f32>,
    views: Grid<u8>,
    /// 0 where nothing was observed, up to 1.
    confidence: Grid<f32>,
    /// 1 where a height was filled in, 0 where it was observed, 255 in voids.
    pub(crate) filled: Grid<u8>,
}

/// Mark of a cell that was filled in.
pub(crate) const FILLED: u8 = 1;
/// Mark of a cell without a height.
const VOID: u8 = 255;

impl Product {
    pub(crate) fn new(fused: Surface, filled: Grid<bool>, origin_m: f64) -> Self {
        let mut marks = filled.map(|f| if *f { FILLED } else { 0 });
        let Surface { height_m, mut sigma_m, mut views, mut confidence } = fused;
        for (i, h) in height_m.data().iter().enumerate() {
            if h.is_nan() {
                marks.data_mut()[i] = VOID;
            }
            // What speckle removal and filling touched has no observation behind it.
            if h.is_nan() || marks.data()[i] == FILLED {
                sigma_m.data_mut()[i] = f32::NAN;
                views.data_mut()[i] = 0;
                confidence.data_mut()[i] = if h.is_nan() { f32::NAN } else { 0.0 };
            }
        }
        Self { origin_m, height_m, sigma_m, views, confidence, filled: marks }
    }
}

/// Refuses early what would fail at the end: results in the way, or a place that cannot be written.
pub(crate) fn check_target(config: &DsmConfig) -> Result<(), PipelineError> {
    let existing = FILES.iter().map(|f| config.output.join(f)).find(|p| p.exists());
    if let (Some(path), false) = (existing, config.overwrite) {
        return Err(PipelineError::Exists { path });
    }
    let created = !config.output.exists();
    let partial = config.output.join(PARTIAL);
    let tried = fs::create_dir_all(&partial).and_then(|()| fs::write(partial.join("probe"), b"skysweep"));
    clean(config, created);
    tried.map_err(|source| PipelineError::Output { path: config.output.clone(), source })
}

/// Removes the work folder, and the output folder when this run made it and it is empty.
fn clean(config: &DsmConfig, created: bool) {
    // Best effort: the error that led here is the one to report.
    let _ = fs::remove_dir_all(config.output.join(PARTIAL));
    if created {
        let _ = fs::remove_dir(&config.output);
    }
}

/// Writes everything beside its place, then moves it there; when writing fails nothing stays behind.
pub(crate) fn write(
    config: &DsmConfig,
    grid: &OutputGrid,
    product: &Product,
    report: DsmReport,
) -> Result<DsmReport, PipelineError> {
    let created = !config.output.exists();
    let written = write_partial(config, grid, product, &report).and_then(|()| publish(config));
    clean(config, created && written.is_err());
    written.map(|()| report)
}

fn write_partial(
    config: &DsmConfig,
    grid: &OutputGrid,
    product: &Product,
    report: &DsmReport,
) -> Result<(), PipelineError> {
    let root = config.output.join(PARTIAL);
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| PipelineError::Output { path, source }
    };
    for folder in ["dsm", "report"] {
        fs::create_dir_all(root.join(folder)).map_err(failed(&config.output))?;
    }
    write_rasters(&root.join("dsm"), config.vertical, grid, product)?;
    let json = serde_json::to_string_pretty(report).map_err(|e| failed(&root)(e.into()))?;
    fs::write(root.join("report/report.json"), json + "\n").map_err(failed(&root))?;
    let used = toml::to_string_pretty(config).map_err(|e| failed(&root)(std::io::Error::other(e)))?;
    fs::write(root.join("used_config.toml"), used).map_err(failed(&root))
}

fn write_rasters(
    folder: &Path,
    vertical: VerticalDatum,
    grid: &OutputGrid,
    product: &Product,
) -> Result<(), PipelineError> {
    let crs = Crs { horizontal: grid.epsg, vertical };
    let heights = absolute_heights(grid, vertical, product)?;
    let shade = raster::hillshade(&heights, (grid.gsd_m, grid.gsd_m), raster::Light::default());
    io::raster::write_png_gray(folder.join("hillshade.png"), &shade, false)?;
    // The extreme hundredths are left out, so that one mast does not take the colours from the rest.
    let (low, high) = raster::height_percentiles(&heights, 1.0, 99.0).unwrap_or((0.0, 1.0));
    let relief = raster::coloured_relief(&heights, &shade, low, high);
    io::raster::write_png_rgb(folder.join("relief.png"), &relief, false)?;
    let cog = |name: &str, description: &str, data: BandData<'_>, no_data: f64| {
        let bands = [Band { description, data }];
        let raster = CogRaster { no_data: Some(no_data), ..CogRaster::new(&bands, grid.geotransform, crs) };
        write_cog(folder.join(name), &raster, false)
    };
    let float = f64::from(NO_DATA);
    cog("dsm.tif", "height_m", BandData::F32(&heights), float)?;
    cog("sigma.tif", "height_standard_deviation_m", BandData::F32(&product.sigma_m), float)?;
    cog("views.tif", "number_of_views", BandData::U8(&product.views), 0.0)?;
    cog("confidence.tif", "confidence_0_to_1", BandData::F32(&product.confidence), float)?;
    cog("filled.tif", "1_filled_0_observed", BandData::U8(&product.filled), f64::from(VOID))?;
    Ok(())
}

/// Heights above the vertical datum; NaN in voids.
fn absolute_heights(grid: &OutputGrid, vertical: VerticalDatum, product: &Product) -> Result<Grid<f32>, PipelineError> {
    let mut out = product.height_m.map(|h| (f64::from(*h) + product.origin_m) as f32);
    if vertical == VerticalDatum::Ellipsoid {
        return Ok(out);
    }
    let converter = HeightConverter::new(vertical)?;
    let columns = out.width();
    let (mut x, mut y, mut h) = (vec![0.0; columns], vec![0.0; columns], vec![0.0; columns]);
    for row in 0..out.height() {
        for (c, (x, y)) in x.iter_mut().zip(&mut y).enumerate() {
            (*x, *y) = grid.geotransform.map_from_cell(c as f64, row as f64);
            h[c] = f64::from(product.height_m[(c, row)]) + product.origin_m;
        }
        grid.projection.lonlat_from_map_slices(&mut x, &mut y)?;
        converter.datum_from_ellipsoid_slices(&x, &y, &mut h)?;
        out.row_mut(row).iter_mut().zip(&h).for_each(|(o, h)| *o = *h as f32);
    }
    Ok(out)
}

/// Moves every file to its final name.
fn publish(config: &DsmConfig) -> Result<(), PipelineError> {
    let move_one = |name: &str| {
        let (from, to): (PathBuf, PathBuf) = (config.output.join(PARTIAL).join(name), config.output.join(name));
        let made = to.parent().map_or(Ok(()), fs::create_dir_all);
        made.and_then(|()| fs::rename(&from, &to)).map_err(|source| PipelineError::Output { path: to, source })
    };
    FILES.iter().try_for_each(|f| move_one(f))
}
