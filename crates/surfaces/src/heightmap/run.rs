//! Runs the height map job for one camera or for a list.

use std::path::{Path, PathBuf};

use formats::raster::ImageSource;
use numeric::Progress;
use report::{Legend, LightEnd, MapLayer};

use super::config::HeightMapConfig;
use super::error::HeightMapJobError;
use super::list;
use super::maker::Maker;
use super::report::{HeightMapMade, HeightMapReport};
use crate::camera_stand::{CameraStand, Cameras};
use job::error::JobError;
use job::run_folder::surface_file;
use job::{files, report_page, threads};

/// Makes one height map, or one for each row of a list.
///
/// # Errors
/// [`JobError`]: a source or list that cannot be read, a single map that cannot be made,
/// files in the way. For a list, a map that cannot be made is a failed row of the report.
///
/// ```
/// use surfaces::camera_stand::{StandConfig, StandSource};
/// use surfaces::heightmap::{HeightMapConfig, run};
/// use numeric::Silent;
///
/// let dsm = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/truth/dsm.tif");
/// let folder = tempfile::tempdir()?;
/// let map = folder.path().join("map.tif");
/// let stand = StandConfig::new(StandSource::Position { lon_deg: 5.4, lat_deg: 43.53 });
/// let mut config = HeightMapConfig::new(dsm.into(), map.clone(), stand);
/// config.size_px = 64;
/// run(&config, &Silent)?;
/// assert!(map.is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &HeightMapConfig, progress: &dyn Progress) -> Result<HeightMapReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &HeightMapConfig, progress: &dyn Progress) -> Result<HeightMapReport, HeightMapJobError> {
    config.validate()?;
    let config = &HeightMapConfig { source: surface_file(&config.source), ..config.clone() };
    threads::install(config.threads, || match config.stand.cameras()? {
        Cameras::One(stand) => one(config, &stand, progress).map(|made| HeightMapReport::One(Box::new(made))),
        Cameras::List(positions) => list::run(config, positions, progress).map(HeightMapReport::List),
    })?
}

/// Makes the map of one camera.
fn one(
    config: &HeightMapConfig,
    stand: &CameraStand,
    progress: &dyn Progress,
) -> Result<HeightMapMade, HeightMapJobError> {
    files::check_raster_destination(&config.output, config.overwrite)?;
    let report = report_file(&config.output);
    report_page::refuse_existing(&report, config.overwrite)?;
    let maker = Maker::open(config, progress)?;
    progress.check_cancelled()?;
    let laid = maker.source.lay(&maker.settings, &[*stand]).pop().ok_or(HeightMapJobError::WorkerLost)??;
    let made = maker.finish(stand, laid, &config.output)?;
    let lead = "Heights seen from above around a camera, turned to its heading.";
    let layers = layers(config, &made)?;
    report_page::write(&report, ("Height map", lead), &made, layers, config.overwrite)?;
    Ok(made)
}

/// Returns the file of the report beside a map.
fn report_file(map: &Path) -> PathBuf {
    let stem = map.file_stem().unwrap_or_default().to_string_lossy();
    map.with_file_name(format!("{stem}_report.json"))
}

/// Returns the heights, and the confidences where they were asked for.
fn layers(config: &HeightMapConfig, made: &HeightMapMade) -> Result<Vec<MapLayer>, HeightMapJobError> {
    let map = ImageSource::open(&made.path)?;
    let pixel_m = 1.0 / config.resolution_px_per_m;
    let caption = "Heights relative to the camera, shaded. The camera is in the middle and looks up.";
    let heights = map.read_samples(1, map.window())?;
    let mut layers = vec![report_page::relief_layer("Heights", caption, &heights, pixel_m)];
    if map.info().bands > 1 {
        let confidence = map.read_samples(2, map.window())?;
        let ramp = Legend::sequential(0.0, 1.0, LightEnd::High, "");
        let caption = "Probability that the height is right; 0 where the terrain model gave it.";
        layers.push(report_page::legend_layer("Confidence", caption, &confidence, ramp));
    }
    Ok(layers)
}
