//! Runs the ground view job.

use numeric::Progress;

use super::config::GroundViewConfig;
use super::error::GroundViewError;
use super::output;
use super::report::{GroundViewReport, REPORT};
use super::shots::Shots;
use super::view_surface::ViewSurface;
use job::error::JobError;
use job::output_folder::OutputFolder;
use job::threads;

/// Renders what cameras on the ground see, and writes it to a folder.
///
/// # Errors
/// [`JobError`]: a surface or cameras that cannot be read, a folder that holds views
/// already. For a list, a row without a view is named in the report.
///
/// ```
/// use surfaces::camera_stand::{StandConfig, StandSource};
/// use surfaces::groundview::{GroundCameras, GroundViewConfig, run};
/// use numeric::Silent;
///
/// let dsm = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/truth/dsm.tif");
/// let folder = tempfile::tempdir()?;
/// let stand = StandConfig::new(StandSource::Position { lon_deg: 5.4, lat_deg: 43.53 });
/// let cameras = GroundCameras::Panoramas(stand);
/// let mut config = GroundViewConfig::new(dsm.into(), folder.path().join("views"), cameras);
/// (config.panorama_width_px, config.crops) = (64, 0);
/// let report = run(&config, &Silent)?;
/// assert_eq!(report.views.len(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &GroundViewConfig, progress: &dyn Progress) -> Result<GroundViewReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &GroundViewConfig, progress: &dyn Progress) -> Result<GroundViewReport, GroundViewError> {
    config.validate()?;
    if !config.overwrite && config.output.join(REPORT).symlink_metadata().is_ok() {
        return Err(GroundViewError::FolderInUse { path: config.output.clone() });
    }
    let folder = OutputFolder::take(&config.output)?;
    folder.check_folders(output::FOLDERS)?;
    threads::install(config.threads, || {
        let surface = ViewSurface::open(&config.surface, config.surface_vertical, progress)?;
        let shots = Shots::of(config, &surface)?;
        // Without its report the folder counts as incomplete from here on.
        folder.remove(REPORT)?;
        output::write(config, &folder, &surface, &shots, progress)
    })?
}
