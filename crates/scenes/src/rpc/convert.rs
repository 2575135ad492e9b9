//! Writing an RPC in another format.

use std::path::{Path, PathBuf};

use camera::RpcCamera;
use formats::rpc::RpcFormat;
use serde::{Deserialize, Serialize};

use super::error::RpcJobError;
use super::input;
use job::corrections::{CorrectionSource, Corrections};
use job::error::JobError;
use numeric::Progress;

/// A conversion of the RPC of one file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RpcConvertConfig {
    /// RPC file, or image with an RPC.
    pub file: PathBuf,
    /// File to write.
    pub output: PathBuf,
    /// Format to write: text, RPB, JSON, or the image again with the RPC in its tag. `None` takes
    /// it from the ending of `output`.
    pub format: Option<RpcFormat>,
    /// Report with the pointing correction of the image, or the folder of a DSM run. The RPC that
    /// is written includes it.
    pub corrections: Option<PathBuf>,
    /// Whether an existing `output` may be replaced.
    pub overwrite: bool,
}

/// What a conversion wrote.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RpcConvertReport {
    /// File that held the RPC.
    pub source: PathBuf,
    /// Format of that file.
    pub source_format: RpcFormat,
    /// File that was written.
    pub output: PathBuf,
    /// Format that was written.
    pub format: RpcFormat,
    /// Whether the RPC includes a pointing correction.
    pub corrected: bool,
    /// Largest difference between the RPC that was written and the corrected one, pixels.
    pub residual_px: f64,
}

impl RpcConvertConfig {
    /// A conversion that takes the format from the ending of `output` and replaces nothing.
    pub fn new(file: PathBuf, output: PathBuf) -> Self {
        Self { file, output, format: None, corrections: None, overwrite: false }
    }

    /// Checks that a format is known.
    ///
    /// # Errors
    /// [`JobError`] when neither `format` nor the ending of `output` names one.
    pub fn validate(&self) -> Result<(), JobError> {
        Ok(self.format.map_or_else(|| format_of(&self.output).map(drop), |_| Ok(()))?)
    }
}

/// Writes the RPC of a file as text, RPB or JSON, or an image again with the RPC in its tag.
///
/// # Errors
/// [`JobError`]: an unknown ending of the output, no usable RPC, a report without a correction of
/// the image, an output that exists or cannot be written.
///
/// ```
/// use scenes::rpc::{RpcConvertConfig, convert};
/// let image = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/view_1.tif");
/// let folder = tempfile::tempdir()?;
/// let config = RpcConvertConfig::new(image.into(), folder.path().join("view_1.json"));
/// let report = convert(&config, &numeric::Silent)?;
/// assert_eq!(formats::rpc::read(&report.output)?.rpc, formats::rpc::read(image.as_ref())?.rpc);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn convert(config: &RpcConvertConfig, progress: &dyn Progress) -> Result<RpcConvertReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &RpcConvertConfig, progress: &dyn Progress) -> Result<RpcConvertReport, RpcJobError> {
    config.validate()?;
    let format = config.format.map_or_else(|| format_of(&config.output), Ok)?;
    let file = input::read(&config.file, progress)?;
    let (rpc, residual_px) = match &config.corrections {
        None => (file.rpc, 0.0),
        Some(report) => {
            let source =
                if report.is_dir() { CorrectionSource::SurfaceRun } else { CorrectionSource::Report(report.clone()) };
            let known = Corrections::for_surface(report, &source)?;
            let correction = known
                .find(&config.file)
                .ok_or_else(|| RpcJobError::NotCorrected { path: config.file.clone(), report: report.clone() })?;
            let fit = RpcCamera { rpc: file.rpc, correction }.folded()?;
            (fit.rpc, fit.max_px)
        }
    };
    match format {
        RpcFormat::TiffTag => {
            formats::raster::copy_image_with_rpc(&config.file, &config.output, &rpc, config.overwrite)?
        }
        format => formats::rpc::write(&config.output, &rpc, format, config.overwrite)?,
    }
    Ok(RpcConvertReport {
        source: file.source,
        source_format: file.format,
        output: config.output.clone(),
        format,
        corrected: config.corrections.is_some(),
        residual_px,
    })
}

fn format_of(output: &Path) -> Result<RpcFormat, RpcJobError> {
    let ending = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("txt" | "rpc") => Ok(RpcFormat::Text),
        Some("rpb") => Ok(RpcFormat::Rpb),
        Some("json") => Ok(RpcFormat::Json),
        Some("tif" | "tiff") => Ok(RpcFormat::TiffTag),
        _ => Err(RpcJobError::UnknownEnding { path: output.to_owned() }),
    }
}
