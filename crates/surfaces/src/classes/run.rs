//! Runs the classes job.

use classes::{
    BUILDING, BuildingCue, Classes, ClassifyInput, CrownCue, GROUND, LOW_VEGETATION, UNKNOWN, VEGETATION, WATER,
    classify,
};
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, Dem, read_dem, write_cog};
use numeric::Progress;
use raster::Grid;
use report::{Legend, LightEnd, MapLayer};
use terrain::BareGround;

use super::config::ClassesConfig;
use super::cue::{Cue, unsure_heights};
use super::error::ClassesError;
use super::layers::weak_cells;
use super::multispectral::ImageIndex;
use super::report::ClassesReport;
use crate::dtm::{self, DtmConfig};
use crate::eval::EvalJobError;
use crate::eval::on_reference::surface_on_reference;
use job::error::JobError;
use job::files::{self, FileError};
use job::output_folder::OutputFolder;
use job::report_page;
use job::threads;

/// Names of the files in the output folder.
const CLASSES: &str = "classes.tif";
const ROUGHNESS: &str = "roughness.tif";
const NDVI: &str = "ndvi.tif";
const REPORT: &str = "classes.json";
const PAGE: &str = "classes.html";
/// Style of QGIS for the classes, which are the first map of the page.
const STYLES: [&str; 2] = ["classes.qml", "roughness.qml"];
/// Names of the files that the job writes.
pub const FILES: [&str; 7] = [CLASSES, ROUGHNESS, NDVI, STYLES[0], STYLES[1], PAGE, REPORT];

/// Share of the cells with heights that must show the ground: with less, the ground under nearly
/// everything is a guess from far away, and bare slopes stand above it.
const NEEDED_GROUND: f64 = 0.01;
/// Share below which the ground is doubtful: in dense old towns and closed forests a tenth is left.
const LEAST_GROUND: f64 = 0.05;

/// Finds ground, buildings and vegetation of a surface model, and writes them with a report.
///
/// # Errors
/// [`JobError`]: a surface that cannot be read, is not on a map in metres or shows no ground,
/// outputs that exist.
///
/// ```
/// use surfaces::classes::{ClassesConfig, run};
/// use numeric::Silent;
///
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
/// let folder = tempfile::tempdir()?;
/// let config = ClassesConfig::new(format!("{town}/truth/dsm.tif").into(), folder.path().join("classes"));
/// let report = run(&config, &Silent)?;
/// assert!(report.cells_building > report.cells_vegetation && report.cells_unknown == 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &ClassesConfig, progress: &dyn Progress) -> Result<ClassesReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &ClassesConfig, progress: &dyn Progress) -> Result<ClassesReport, ClassesError> {
    config.validate()?;
    for name in FILES {
        files::refuse_existing(&config.output.join(name), config.overwrite)?;
    }
    threads::install(config.threads, || {
        let (surface, cell_m, crs) =
            dtm::read_surface(&DtmConfig::new(config.surface.clone(), config.output.clone()), progress)?;
        let given = match &config.vegetation_index {
            Some(path) => {
                let index = read_dem(path).map_err(EvalJobError::from)?;
                Some(surface_on_reference(&index, &surface)?)
            }
            None => None,
        };
        let cue = match &config.building_index {
            Some(path) => Some(Cue::read(path, &surface, &config.classes)?),
            None => None,
        };
        let folder = OutputFolder::take(&config.output)?;
        let (ground, _) = dtm::bare_ground(&surface, cell_m, &config.terrain, progress)?;
        progress.check_cancelled()?;
        let ground_share = checked_ground(&surface, &ground, progress)?;
        let (weak, layers) = weak_cells(&surface)?;
        let above = surface.heights.zip_map(&ground.heights, |cell, ground| cell - ground);
        let mut input = ClassifyInput {
            surface: &surface.heights,
            above_ground: &above,
            index: given.as_ref(),
            is_index_coarse: !config.multispectral.is_empty(),
            cue: None,
            crowns: None,
            weak: weak.as_ref(),
            cell_m,
        };
        let made = match config.multispectral.is_empty() {
            true => None,
            false => {
                // Roofs by their heights tell the scale of the bands.
                let roofs = classify(&input, &config.classes)?.classes.map(|class| *class == BUILDING);
                Some(ImageIndex::of_images(config, &surface, &roofs, progress)?)
            }
        };
        let unsure = if made.is_some() { unsure_heights(&surface)? } else { None };
        input.index = made.as_ref().map(|made| &made.index).or(given.as_ref());
        input.cue = cue.as_ref().map(|cue| BuildingCue { index: &cue.index, weak: Some(&cue.weak) });
        input.crowns =
            made.as_ref().zip(unsure.as_ref()).map(|(made, unsure)| CrownCue { index: &made.of_crowns, unsure });
        let found = classify(&input, &config.classes)?;
        progress.check_cancelled()?;
        let cells_weak = cue.map_or(0, |cue| cue.weak.data().iter().filter(|weak| **weak).count());
        let (index, images) = made.map_or((None, Vec::new()), |made| (Some(made.index), made.images));
        let vegetation_index = index.as_ref().map(|_| config.output.join(NDVI));
        let report = report(config, &surface, &found, cell_m);
        let report =
            ClassesReport { cells_weak, vegetation_index, index_images: images, ground_share, layers, ..report };
        let made = Made { found: &found, index: index.as_ref() };
        write(config, &folder, &surface, &made, Crs::ellipsoidal(crs.horizontal), &report)?;
        Ok(report)
    })?
}

/// Returns the share of the cells with heights that show the ground, and warns where it is small.
///
/// # Errors
/// [`ClassesError::NoGround`]: without ground nothing stands on it.
fn checked_ground(surface: &Dem, ground: &BareGround, progress: &dyn Progress) -> Result<f64, ClassesError> {
    let heights = surface.heights.data().iter().filter(|h| h.is_finite()).count();
    let cells = ground.states.data().iter().filter(|state| **state == terrain::GROUND).count();
    let share = cells as f64 / heights.max(1) as f64;
    let path = &surface.path;
    if share < NEEDED_GROUND {
        return Err(ClassesError::NoGround { path: path.clone(), cells, heights });
    }
    if share < LEAST_GROUND {
        progress.warn(&format!(
            "only {:.2} % of the cells with heights show the ground ({cells} of {heights}), so what stands on it is \
             known from little; compare with the ground that the terrain model finds: {}",
            100.0 * share,
            path.display()
        ));
    }
    Ok(share)
}

fn report(config: &ClassesConfig, surface: &Dem, found: &Classes, cell_m: f64) -> ClassesReport {
    let count = |class: u8| found.classes.data().iter().filter(|c| **c == class).count();
    ClassesReport {
        surface: surface.path.clone(),
        classes: config.output.join(CLASSES),
        size: (found.classes.width(), found.classes.height()),
        cell_m,
        cells_ground: count(GROUND),
        cells_building: count(BUILDING),
        cells_low_vegetation: count(LOW_VEGETATION),
        cells_vegetation: count(VEGETATION),
        cells_water: count(WATER),
        cells_unknown: count(UNKNOWN),
        has_vegetation_index: config.vegetation_index.is_some() || !config.multispectral.is_empty(),
        vegetation_index: None,
        index_images: Vec::new(),
        has_building_index: config.building_index.is_some(),
        cells_weak: 0,
        ground_share: 0.0,
        layers: super::layers::ClassLayers::default(),
        terrain: config.terrain,
        parameters: config.classes,
    }
}

/// The rasters of the job.
struct Made<'a> {
    found: &'a Classes,
    /// The vegetation index that was made of images.
    index: Option<&'a Grid<f32>>,
}

/// Makes all files in a work folder and moves them to their names.
fn write(
    config: &ClassesConfig,
    folder: &OutputFolder,
    surface: &Dem,
    made: &Made<'_>,
    crs: Crs,
    report: &ClassesReport,
) -> Result<(), ClassesError> {
    let Made { found, index } = *made;
    let work = folder.work_folder()?;
    let threads = threads::count(config.threads);
    let put = |name: &str, description: &str, data: BandData<'_>| {
        let bands = [Band { description, data }];
        let plain = CogRaster::new(&bands, surface.geotransform, crs);
        let raster = CogRaster { threads, holds_heights: false, provenance: Some(&surface.provenance), ..plain };
        write_cog(work.path().join(name), &raster, false).map_err(FileError::from)
    };
    put(CLASSES, "class_2_ground_3_low_vegetation_5_vegetation_6_building_9_water", BandData::U8(&found.classes))?;
    let roughness = found.roughness.map(|r| if r.is_finite() { *r } else { f32::NAN });
    put(ROUGHNESS, "roughness_m", BandData::F32(&roughness))?;
    if let Some(index) = index {
        put(NDVI, "vegetation_index", BandData::F32(index))?;
    }
    let share = 100.0 * report.cells_building as f64 / found.classes.data().len().max(1) as f64;
    let lead = format!("Buildings cover {share:.1} % of {} cells.", found.classes.data().len());
    let layers = layers(surface, found, report.cell_m);
    report_page::write_styles(work.path(), STYLES.into_iter().zip(&layers))?;
    report_page::write(&work.path().join(REPORT), ("Classes", &lead), report, layers, false)?;
    for name in FILES {
        folder.remove(name)?;
        if name != NDVI || index.is_some() {
            folder.publish(work.path(), name)?;
        }
    }
    Ok(())
}

/// Returns the colours of the classes.
pub fn legend() -> Legend {
    Legend::Codes(vec![
        (GROUND, [214, 200, 170], "ground"),
        (BUILDING, [200, 80, 60], "building"),
        (LOW_VEGETATION, [176, 208, 128], "low vegetation"),
        (VEGETATION, [86, 150, 80], "vegetation"),
        (WATER, [86, 140, 200], "water"),
        (UNKNOWN, [72, 72, 76], "unknown"),
    ])
}

/// Returns the maps of the page.
fn layers(surface: &Dem, found: &Classes, cell_m: f64) -> Vec<MapLayer> {
    let classes = found.classes.map(|class| f32::from(*class));
    let caption = "What stands is a building where it consists of planes, and vegetation where it is rough.";
    let roughness = found.roughness.map(|r| if r.is_finite() { *r } else { f32::NAN });
    let (_, highest) = report_page::shown_range(&roughness);
    let ramp = Legend::sequential(0.0, f64::from(highest), LightEnd::Low, "m");
    let of_roughness = "Residual of the best plane around each cell that stands above the ground.";
    vec![
        report_page::legend_layer("Classes", caption, &classes, legend()),
        report_page::legend_layer("Roughness", of_roughness, &roughness, ramp),
        report_page::relief_layer("Surface", "Heights of the surface, shaded.", &surface.heights, cell_m),
    ]
}
