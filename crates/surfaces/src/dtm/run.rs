//! Runs the DTM job.

use crs::{Crs, MapProjection, VerticalDatum};
use formats::raster::{Band, BandData, CogRaster, Dem, read_dem, write_cog};
use numeric::Progress;
use raster::Grid;
use report::{Legend, LightEnd, MapLayer};
use terrain::{BareGround, GROUND, UNDER_OBJECT, UNKNOWN, VOID_FILLED, without_noise};

use super::config::DtmConfig;
use super::error::DtmError;
use super::layers::{bare_ground, standard_errors};
use super::report::DtmReport;
use job::error::JobError;
use job::files::{self, FileError};
use job::output_folder::OutputFolder;
use job::report_page;
use job::run_folder::surface_file;
use job::threads;

/// Names of the files in the output folder.
const DTM: &str = "dtm.tif";
const ABOVE: &str = "height_above_ground.tif";
const STATES: &str = "ground.tif";
const REPORT: &str = "dtm.json";
const PAGE: &str = "dtm.html";
/// Styles of QGIS, in the order of the maps of the page.
const STYLES: [&str; 3] = ["dtm.qml", "height_above_ground.qml", "ground.qml"];
/// Names of the files that the job writes.
pub const FILES: [&str; 8] = [DTM, ABOVE, STATES, STYLES[0], STYLES[1], STYLES[2], PAGE, REPORT];
/// Largest difference of the sides of a cell, as a share.
const SQUARE_TOLERANCE: f64 = 0.01;

/// Share of the cells with heights below which the ground that was found is doubtful: in dense old
/// towns and closed forests a tenth is left.
const LEAST_GROUND: f64 = 0.05;

/// Makes a terrain model, the heights above it and a mask, and writes them with a report.
///
/// # Errors
/// [`JobError`]: a surface that cannot be read or is not on a map in metres, outputs that exist.
///
/// ```
/// use surfaces::dtm::{DtmConfig, run};
/// use numeric::Silent;
///
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
/// let folder = tempfile::tempdir()?;
/// let config = DtmConfig::new(format!("{town}/truth/dsm.tif").into(), folder.path().join("dtm"));
/// let report = run(&config, &Silent)?;
/// assert!(report.cells_ground > report.cells_under_objects && report.cells_unknown == 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &DtmConfig, progress: &dyn Progress) -> Result<DtmReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &DtmConfig, progress: &dyn Progress) -> Result<DtmReport, DtmError> {
    config.validate()?;
    for name in FILES {
        files::refuse_existing(&config.output.join(name), config.overwrite)?;
    }
    threads::install(config.threads, || {
        let (surface, cell_m, crs) = read_surface(config, progress)?;
        let folder = OutputFolder::take(&config.output)?;
        let (mut terrain, mut layers) = bare_ground(&surface, cell_m, &config.terrain, progress)?;
        let sigma_m = standard_errors(&surface, &mut layers)?;
        if let Some(sigma_m) = sigma_m {
            terrain = without_noise(terrain, &sigma_m, cell_m)?;
        }
        progress.check_cancelled()?;
        let (above, cells_below_ground) = heights_above(&surface.heights, &terrain);
        let report = DtmReport { cells_below_ground, layers, ..report(config, &surface, &terrain, cell_m, crs) };
        warn_of_little_ground(&surface, &report, progress);
        write(config, &folder, &surface, &terrain, &above, crs, &report)?;
        Ok(report)
    })?
}

/// Warns where hardly any cell stayed ground.
fn warn_of_little_ground(surface: &Dem, report: &DtmReport, progress: &dyn Progress) {
    let heights = surface.heights.data().iter().filter(|h| h.is_finite()).count();
    let share = report.cells_ground as f64 / heights.max(1) as f64;
    if share < LEAST_GROUND {
        progress.warn(&format!(
            "only {:.2} % of the cells with heights show the ground ({} of {heights}), so the terrain rests on little; \
             compare ground.tif with the surface: {}",
            100.0 * share,
            report.cells_ground,
            surface.path.display()
        ));
    }
}

/// Reads the surface with the side of its cells and its CRS.
pub(crate) fn read_surface(config: &DtmConfig, progress: &dyn Progress) -> Result<(Dem, f64, Crs), DtmError> {
    let path = surface_file(&config.surface);
    let surface = read_dem(&path)?;
    let horizontal = surface.horizontal_epsg.ok_or_else(|| DtmError::NoEpsg { path: path.clone() })?;
    let projection = MapProjection::from_epsg(horizontal)?;
    let (width_m, height_m) = surface.cell_size_m(&projection);
    if (width_m - height_m).abs() > SQUARE_TOLERANCE * width_m.max(height_m) {
        return Err(DtmError::NotSquare { path, width_m, height_m });
    }
    if !surface.heights.data().iter().any(|h| h.is_finite()) {
        return Err(DtmError::NoHeights { path });
    }
    let vertical = config.surface_vertical.or(surface.vertical).unwrap_or_else(|| {
        let what = "the file does not name the vertical datum of its heights, so the results name none";
        progress.warn(&format!("{what}: {}", surface.path.display()));
        VerticalDatum::Ellipsoid
    });
    Ok((surface, (width_m * height_m).sqrt(), Crs { horizontal, vertical }))
}

/// Returns the heights of the surface above the ground and the number of cells that lay below it.
/// They are 0 there, and where the surface shows the ground itself, whose noise is no height.
fn heights_above(surface: &Grid<f32>, terrain: &BareGround) -> (Grid<f32>, usize) {
    let mut above = surface.clone();
    let mut below = 0;
    let ground = terrain.heights.data().iter().zip(terrain.states.data());
    for (cell, (ground, state)) in above.data_mut().iter_mut().zip(ground) {
        *cell -= ground;
        if *state == GROUND {
            *cell = 0.0;
        } else if *cell < 0.0 {
            below += 1;
            *cell = 0.0;
        }
    }
    (above, below)
}

fn report(config: &DtmConfig, surface: &Dem, terrain: &BareGround, cell_m: f64, crs: Crs) -> DtmReport {
    let count = |state: u8| terrain.states.data().iter().filter(|&&s| s == state).count();
    DtmReport {
        surface: surface.path.clone(),
        dtm: config.output.join(DTM),
        height_above_ground: config.output.join(ABOVE),
        ground: config.output.join(STATES),
        crs: crs.to_string(),
        size: (surface.heights.width(), surface.heights.height()),
        cell_m,
        cells_ground: count(GROUND),
        cells_under_objects: count(UNDER_OBJECT),
        cells_void_filled: count(VOID_FILLED),
        cells_unknown: count(UNKNOWN),
        cells_below_ground: 0,
        layers: super::layers::SurfaceLayers::default(),
        parameters: config.terrain,
    }
}

/// Makes all files in a work folder and moves them to their names.
fn write(
    config: &DtmConfig,
    folder: &OutputFolder,
    surface: &Dem,
    terrain: &BareGround,
    above: &Grid<f32>,
    crs: Crs,
    report: &DtmReport,
) -> Result<(), DtmError> {
    let work = folder.work_folder()?;
    let threads = threads::count(config.threads);
    let put = |name: &str, description: &str, data: BandData<'_>, crs: Crs, holds_heights: bool| {
        let bands = [Band { description, data }];
        let plain = CogRaster::new(&bands, surface.geotransform, crs);
        let raster = CogRaster { threads, holds_heights, provenance: Some(&surface.provenance), ..plain };
        write_cog(work.path().join(name), &raster, false).map_err(FileError::from)
    };
    let plain = Crs::ellipsoidal(crs.horizontal);
    put(DTM, "ground_height_m", BandData::F32(&terrain.heights), crs, true)?;
    put(ABOVE, "height_above_ground_m", BandData::F32(above), plain, false)?;
    let states = "0_unknown_1_ground_2_under_object_3_void_filled";
    put(STATES, states, BandData::U8(&terrain.states), plain, false)?;
    let lead = format!("{} cells of {:.2} m.", terrain.states.data().len(), report.cell_m);
    let layers = layers(terrain, above, report.cell_m);
    report_page::write_styles(work.path(), STYLES.into_iter().zip(&layers))?;
    report_page::write(&work.path().join(REPORT), ("Terrain model", &lead), report, layers, false)?;
    for name in FILES {
        folder.remove(name)?;
        folder.publish(work.path(), name)?;
    }
    Ok(())
}

/// Returns the maps of the page.
fn layers(terrain: &BareGround, above: &Grid<f32>, cell_m: f64) -> Vec<MapLayer> {
    let states = Legend::Codes(vec![
        (GROUND, [86, 160, 96], "ground as observed"),
        (UNDER_OBJECT, [240, 200, 80], "interpolated under an object"),
        (VOID_FILLED, [86, 140, 200], "interpolated in a void"),
        (UNKNOWN, [72, 72, 76], "unknown"),
    ]);
    let (_, highest) = report_page::shown_range(above);
    let ramp = Legend::sequential(0.0, f64::from(highest), LightEnd::Low, "m");
    let of_states = terrain.states.map(|state| f32::from(*state));
    vec![
        report_page::relief_layer("Ground", "Heights of the ground, shaded.", &terrain.heights, cell_m),
        report_page::legend_layer("Above ground", "Height of the surface above the ground.", above, ramp),
        report_page::legend_layer("States", "Where the ground was observed.", &of_states, states),
    ]
}
