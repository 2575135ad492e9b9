//! Runs the classes job.

use classes::{BUILDING, Classes, ClassifyInput, GROUND, UNKNOWN, VEGETATION, classify};
use crs::Crs;
use io::raster::{Band, BandData, CogRaster, Dem, read_dem, write_cog};
use numeric::Progress;
use terrain::bare_ground;

use super::config::ClassesConfig;
use super::error::ClassesError;
use super::report::ClassesReport;
use crate::dtm::{self, DtmConfig};
use crate::eval::EvalJobError;
use crate::eval::on_reference::surface_on_reference;
use crate::files::{self, FileError};
use crate::output_folder::OutputFolder;
use crate::threads;

/// Names of the files in the output folder.
const CLASSES: &str = "classes.tif";
const ROUGHNESS: &str = "roughness.tif";
const REPORT: &str = "classes.json";

/// Finds ground, buildings and vegetation of a surface model, and writes them with a report.
///
/// # Errors
/// [`ClassesError`]: a surface that cannot be read or is not on a map in metres, outputs that
/// exist.
///
/// ```
/// use jobs::classes::{ClassesConfig, run};
/// use numeric::Silent;
///
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
/// let folder = tempfile::tempdir()?;
/// let config = ClassesConfig::new(format!("{town}/truth/dsm.tif").into(), folder.path().join("classes"));
/// let report = run(&config, &Silent)?;
/// assert!(report.cells_building > report.cells_vegetation && report.cells_unknown == 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &ClassesConfig, progress: &dyn Progress) -> Result<ClassesReport, ClassesError> {
    config.validate()?;
    for name in [CLASSES, ROUGHNESS, REPORT] {
        files::refuse_existing(&config.output.join(name), config.overwrite)?;
    }
    threads::install(config.threads, || {
        let (surface, cell_m, crs) =
            dtm::read_surface(&DtmConfig::new(config.surface.clone(), config.output.clone()), progress)?;
        let index = match &config.vegetation_index {
            Some(path) => {
                let index = read_dem(path).map_err(EvalJobError::from)?;
                Some(surface_on_reference(&index, &surface)?)
            }
            None => None,
        };
        let folder = OutputFolder::take(&config.output)?;
        let ground = bare_ground(&surface.heights, cell_m, &config.terrain, progress)?;
        progress.check_cancelled()?;
        let mut above = surface.heights.clone();
        above.data_mut().iter_mut().zip(ground.heights.data()).for_each(|(cell, ground)| *cell -= ground);
        let input = ClassifyInput { surface: &surface.heights, above_ground: &above, index: index.as_ref(), cell_m };
        let found = classify(&input, &config.classes)?;
        progress.check_cancelled()?;
        let report = report(config, &surface, &found, cell_m);
        write(config, &folder, &surface, &found, Crs::ellipsoidal(crs.horizontal), &report)?;
        Ok(report)
    })?
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
        cells_vegetation: count(VEGETATION),
        cells_unknown: count(UNKNOWN),
        has_vegetation_index: config.vegetation_index.is_some(),
        terrain: config.terrain,
        parameters: config.classes,
    }
}

/// Makes all files in a work folder and moves them to their names.
fn write(
    config: &ClassesConfig,
    folder: &OutputFolder,
    surface: &Dem,
    found: &Classes,
    crs: Crs,
    report: &ClassesReport,
) -> Result<(), ClassesError> {
    let work = folder.work_folder()?;
    let threads = threads::count(config.threads);
    let put = |name: &str, description: &str, data: BandData<'_>| {
        let bands = [Band { description, data }];
        let raster = CogRaster { threads, holds_heights: false, ..CogRaster::new(&bands, surface.geotransform, crs) };
        write_cog(work.path().join(name), &raster, false).map_err(FileError::from)
    };
    put(CLASSES, "class_2_ground_5_vegetation_6_building", BandData::U8(&found.classes))?;
    let roughness = found.roughness.map(|r| if r.is_finite() { *r } else { f32::NAN });
    put(ROUGHNESS, "roughness_m", BandData::F32(&roughness))?;
    files::write_json(&work.path().join(REPORT), report, false)?;
    for name in [CLASSES, ROUGHNESS, REPORT] {
        folder.remove(name)?;
        folder.publish(work.path(), name)?;
    }
    Ok(())
}
