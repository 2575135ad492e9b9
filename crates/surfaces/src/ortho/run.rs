//! Runs the ortho job.

use numeric::Progress;
use ortho::MosaicRule;
use raster::Window;

use super::config::OrthoConfig;
use super::error::OrthoError;
use super::inputs::{OrthoImage, OrthoInputs, OrthoSurface, Pixels};
use super::laying::{Laying, TOLERANCE_M};
use super::mosaic::Ortho;
use super::output::OrthoReport;
use super::{mosaic, output};
use job::corrections::Corrections;
use job::error::JobError;
use job::{files, report_page, threads};

/// Makes an ortho and writes it with its mask.
///
/// # Errors
/// [`JobError`]: files that cannot be read, images that do not see the surface, outputs that
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
pub fn run(config: &OrthoConfig, progress: &dyn Progress) -> Result<OrthoReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &OrthoConfig, progress: &dyn Progress) -> Result<OrthoReport, OrthoError> {
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
        let surface = OrthoSurface::read(&config.surface_file(), config.surface_vertical, progress)?;
        let inputs = OrthoInputs::open(config, &surface, window, corrections, progress)?;
        let made = mosaic::make(&inputs, config.laying(), progress)?;
        output::write(config, &inputs, &made)
    })?
}

/// Lays one image on the cells of a surface, in memory. Hidden cells have no value.
///
/// # Errors
/// [`OrthoError::NothingSeen`], and pixels that cannot be read.
pub(crate) fn lay<P: Pixels>(
    surface: &OrthoSurface,
    image: OrthoImage<P>,
    progress: &dyn Progress,
) -> Result<Ortho, OrthoError> {
    let inputs = OrthoInputs::of_image(surface, image)?;
    let laying = Laying { tolerance_m: TOLERANCE_M, balance: false, mosaic: MosaicRule::Best, keep_hidden: false };
    mosaic::make(&inputs, laying, progress)
}
