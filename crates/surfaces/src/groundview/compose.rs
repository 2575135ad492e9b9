//! Lays a rendered ground layer over a satellite layer: C = C_ground + (1 − alpha) C_sat.

use std::path::{Path, PathBuf};

use formats::raster::{ImageSource, SampleType, write_png_rgb};
use numeric::Progress;
use raster::Grid;
use serde::{Deserialize, Serialize};

use super::error::GroundViewError;
use job::error::JobError;
use job::files::{self, FileError};

/// A ground layer that is laid over a satellite layer. Splat renderers leave the colours of the
/// ground layer weighted by its opacity.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ComposeConfig {
    /// Colours of the ground layer.
    pub ground: PathBuf,
    /// Opacity of the ground layer: 0 to the largest value of the file's type, or 0 to 1 in floats.
    pub alpha: PathBuf,
    /// Colours of the satellite layer.
    pub satellite: PathBuf,
    /// PNG to write.
    pub output: PathBuf,
    /// Whether an existing file may be replaced.
    pub overwrite: bool,
}

/// A composition that was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ComposeReport {
    /// The PNG.
    pub output: PathBuf,
    /// Columns and rows.
    pub size: [usize; 2],
}

impl ComposeConfig {
    /// A composition that replaces no file.
    pub fn new(ground: PathBuf, alpha: PathBuf, satellite: PathBuf, output: PathBuf) -> Self {
        Self { ground, alpha, satellite, output, overwrite: false }
    }

    /// Checks that the output may be written.
    ///
    /// # Errors
    /// [`JobError`] if the output cannot be written, or exists and may not be
    /// replaced.
    pub fn validate(&self) -> Result<(), JobError> {
        Ok(files::check_destination(&self.output, self.overwrite)?)
    }
}

/// Lays a ground layer over a satellite layer and writes the picture.
///
/// # Errors
/// [`JobError`]: layers that cannot be read or differ in size, an output that exists.
///
/// ```
/// use surfaces::groundview::{ComposeConfig, compose};
/// use numeric::Silent;
/// use raster::Grid;
///
/// let folder = tempfile::tempdir()?;
/// let path = |name: &str| folder.path().join(name);
/// formats::raster::write_png_rgb(path("ground.png"), &Grid::filled(2, 2, [100, 0, 0]), false)?;
/// formats::raster::write_png_gray(path("alpha.png"), &Grid::filled(2, 2, 255), false)?;
/// formats::raster::write_png_rgb(path("satellite.png"), &Grid::filled(2, 2, [0, 0, 200]), false)?;
/// let config = ComposeConfig::new(path("ground.png"), path("alpha.png"), path("satellite.png"), path("both.png"));
/// assert_eq!(compose(&config, &Silent)?.size, [2, 2]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn compose(config: &ComposeConfig, progress: &dyn Progress) -> Result<ComposeReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &ComposeConfig, progress: &dyn Progress) -> Result<ComposeReport, GroundViewError> {
    config.validate()?;
    let (ground, satellite) = (layer(&config.ground)?, layer(&config.satellite)?);
    progress.check_cancelled()?;
    let source = ImageSource::open(&config.alpha)?;
    let full = full_scale(&source);
    let alpha = source.read_samples(1, source.window())?.map(|a| if a.is_finite() { a / full } else { 0.0 });
    let made = groundview::compose(&ground, &alpha, &satellite)?;
    let picture = made.map(|p| p.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8));
    write_png_rgb(&config.output, &picture, config.overwrite).map_err(FileError::from)?;
    Ok(ComposeReport { output: config.output.clone(), size: [picture.width(), picture.height()] })
}

/// Reads colours from 0 to 1.
fn layer(path: &Path) -> Result<Grid<[f32; 3]>, GroundViewError> {
    let source = ImageSource::open(path)?;
    let full = full_scale(&source);
    Ok(source.read_colour(source.window())?.map(|p| p.map(|c| if c.is_finite() { c / full } else { 0.0 })))
}

/// Returns the value that stands for 1.
fn full_scale(source: &ImageSource) -> f32 {
    match source.info().sample {
        SampleType::U8 => 255.0,
        SampleType::U16 => 65_535.0,
        _ => 1.0,
    }
}
