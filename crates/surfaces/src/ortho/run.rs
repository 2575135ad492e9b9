//! Runs the ortho job.

use numeric::Progress;
use raster::Window;

use super::config::OrthoConfig;
use super::error::OrthoError;
use super::inputs::OrthoInputs;
use super::output::OrthoReport;
use super::states::{HIDDEN, SEEN, VOID};
use super::{mosaic, output};
use job::corrections::Corrections;
use job::{files, report_page, threads};

/// Makes an ortho and writes it with its mask.
///
/// # Errors
/// [`OrthoError`]: files that cannot be read, images that do not see the surface, outputs that
/// exist.
///
/// ```
/// use surfaces::ortho::{OrthoConfig, run};
/// use numeric::Silent;
///
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
/// let folder = tempfile::tempdir()?;
/// let images = vec![format!("{town}/view_1.tif").into()];
/// let surface = format!("{town}/truth/dsm.tif").into();
/// let mut config = OrthoConfig::new(images, surface, folder.path().join("ortho.tif"));
/// config.cell_m = Some(5.0);
/// let report = run(&config, &Silent)?;
/// assert!(report.cells_seen > report.cells_hidden);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &OrthoConfig, progress: &dyn Progress) -> Result<OrthoReport, OrthoError> {
    let corrections = Corrections::for_surface(&config.surface, &config.corrections)?;
    run_on(config, None, &corrections, progress)
}

/// Makes an ortho on a window of the cells of the surface model; what lies outside of the window
/// still hides what is behind it. The configuration's own corrections do not count.
///
/// # Errors
/// As [`run`].
pub(crate) fn run_in_window(
    config: &OrthoConfig,
    window: Window,
    corrections: &Corrections,
    progress: &dyn Progress,
) -> Result<OrthoReport, OrthoError> {
    run_on(config, Some(window), corrections, progress)
}

fn run_on(
    config: &OrthoConfig,
    window: Option<Window>,
    corrections: &Corrections,
    progress: &dyn Progress,
) -> Result<OrthoReport, OrthoError> {
    config.validate()?;
    files::check_raster_destination(&config.output, config.overwrite)?;
    files::check_raster_destination(&config.mask(), config.overwrite)?;
    files::refuse_existing(&config.mask_style(), config.overwrite)?;
    report_page::refuse_existing(&config.report(), config.overwrite)?;
    threads::install(config.threads, || {
        let inputs = OrthoInputs::open(config, window, corrections, progress)?;
        let made = mosaic::make(&inputs, config, progress)?;
        if !made.state.data().iter().any(|state| matches!(*state, SEEN | HIDDEN)) {
            let heights = made.state.data().iter().filter(|state| **state != VOID).count();
            return Err(OrthoError::NothingSeen { cells: made.state.data().len(), heights });
        }
        output::write(config, &inputs, &made)
    })?
}
