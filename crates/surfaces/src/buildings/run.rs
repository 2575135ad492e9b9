//! Runs the buildings job.

use buildings::{BuildingIndex, building_index};
use numeric::Progress;
use raster::Grid;
use report::{Legend, LightEnd, MapLayer};

use super::config::BuildingMapConfig;
use super::error::BuildingMapError;
use super::input::Input;
use super::output::Placed;
use super::report::BuildingMapReport;
use job::error::JobError;
use job::files::FileError;
use job::run_folder::surface_file;
use job::{files, report_page, threads};

/// Index from which a cell is counted as likely a building in the report.
const HIGH: f32 = 0.5;

/// Makes the building index of an image and writes it with a report.
///
/// # Errors
/// [`JobError`]: an image that cannot be read or does not tell the size of its pixels, a
/// surface model that it does not see, outputs that exist.
///
/// ```
/// use surfaces::buildings::{BuildingMapConfig, run};
/// use numeric::Silent;
///
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
/// let folder = tempfile::tempdir()?;
/// let image = format!("{town}/view_1.tif").into();
/// let report = run(&BuildingMapConfig::new(image, folder.path().join("index.tif")), &Silent)?;
/// assert!(report.junctions > 0 && report.cells_known > report.cells_high);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &BuildingMapConfig, progress: &dyn Progress) -> Result<BuildingMapReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &BuildingMapConfig, progress: &dyn Progress) -> Result<BuildingMapReport, BuildingMapError> {
    config.validate()?;
    files::check_raster_destination(&config.output, config.overwrite)?;
    let style = config.output.with_extension("qml");
    files::refuse_existing(&style, config.overwrite)?;
    report_page::refuse_existing(&config.report(), config.overwrite)?;
    threads::install(config.threads, || {
        let input = Input::read(config)?;
        progress.check_cancelled()?;
        let found = building_index(&input.values, input.gsd_m, &config.index, progress)?;
        let placed = match &config.surface {
            Some(surface) => Placed::on_surface(&found.index, surface, config, progress)?,
            None => Placed::in_image(found.index.clone()),
        };
        progress.check_cancelled()?;
        placed.write(config, &input)?;
        let report = report(config, &input, &found, &placed.index);
        let lead = format!("{} junctions, {} pairs, at {:.2} m.", report.junctions, report.pairs, report.gsd_m);
        let page = ("Building index", lead.as_str());
        formats::write_bytes(&style, index_legend().qml().as_bytes(), config.overwrite).map_err(FileError::from)?;
        report_page::write(&report.report, page, &report, layers(&input, &placed.index), config.overwrite)?;
        Ok(report)
    })?
}

fn report(config: &BuildingMapConfig, input: &Input, found: &BuildingIndex, placed: &Grid<f32>) -> BuildingMapReport {
    let count = |counts: fn(&f32) -> bool| placed.data().iter().filter(|v| counts(v)).count();
    BuildingMapReport {
        image: config.image.clone(),
        index: config.output.clone(),
        report: config.report(),
        surface: config.surface.as_deref().map(surface_file),
        size: (placed.width(), placed.height()),
        gsd_m: input.gsd_m,
        junctions: found.junctions,
        pairs: found.pairs,
        cells_known: count(|v| v.is_finite()),
        cells_high: count(|v| *v >= HIGH),
        parameters: config.index,
    }
}

/// Returns the maps of the page: the index, and the image that it was made of.
fn layers(input: &Input, placed: &Grid<f32>) -> Vec<MapLayer> {
    let (low, high) = report_page::shown_range(&input.values);
    let grey = |part: f64| (f64::from(low) + part * f64::from(high - low), [(255.0 * part) as u8; 3]);
    let greys = Legend::Ramp { stops: [0.0, 0.25, 0.5, 0.75, 1.0].map(grey).to_vec(), unit: "" };
    let caption = "Geometric saliency of buildings, 0 to 1.";
    let of_image = "Grey values of the image, in its own pixels.";
    vec![
        report_page::legend_layer("Index", caption, placed, index_legend()),
        report_page::legend_layer("Image", of_image, &input.values, greys),
    ]
}

/// Returns the colours of the index.
fn index_legend() -> Legend {
    Legend::sequential(0.0, 1.0, LightEnd::Low, "")
}
