//! Writing an RPC in another format.

use std::path::{Path, PathBuf};

use io::rpc::RpcFormat;
use serde::{Deserialize, Serialize};

use super::error::RpcJobError;
use super::input;
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
    /// Format to write: text, RPB or JSON. `None` takes it from the ending of `output`.
    pub format: Option<RpcFormat>,
    /// Whether an existing `output` may be replaced.
    pub overwrite: bool,
}

/// What a conversion wrote.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
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
}

impl RpcConvertConfig {
    /// A conversion that takes the format from the ending of `output` and replaces nothing.
    pub fn new(file: PathBuf, output: PathBuf) -> Self {
        Self { file, output, format: None, overwrite: false }
    }

    /// Checks that a format is known.
    ///
    /// # Errors
    /// [`RpcJobError::UnknownEnding`] when neither `format` nor the ending of `output` names one.
    pub fn validate(&self) -> Result<(), RpcJobError> {
        self.format.map_or_else(|| format_of(&self.output).map(drop), |_| Ok(()))
    }
}

/// Writes the RPC of a file as text, RPB or JSON.
///
/// # Errors
/// [`RpcJobError::UnknownEnding`], [`RpcJobError::Read`], and [`RpcJobError::Write`], among it an
/// output that exists.
///
/// ```
/// use jobs::rpc::{RpcConvertConfig, convert};
/// let image = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/view_1.tif");
/// let folder = tempfile::tempdir()?;
/// let config = RpcConvertConfig::new(image.into(), folder.path().join("view_1.json"));
/// let report = convert(&config, &numeric::Silent)?;
/// assert_eq!(io::rpc::read(&report.output)?.rpc, io::rpc::read(image.as_ref())?.rpc);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn convert(config: &RpcConvertConfig, progress: &dyn Progress) -> Result<RpcConvertReport, RpcJobError> {
    config.validate()?;
    let format = config.format.map_or_else(|| format_of(&config.output), Ok)?;
    let file = input::read(&config.file, progress)?;
    io::rpc::write(&config.output, &file.rpc, format, config.overwrite)?;
    Ok(RpcConvertReport { source: file.source, source_format: file.format, output: config.output.clone(), format })
}

fn format_of(output: &Path) -> Result<RpcFormat, RpcJobError> {
    let ending = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("txt" | "rpc") => Ok(RpcFormat::Text),
        Some("rpb") => Ok(RpcFormat::Rpb),
        Some("json") => Ok(RpcFormat::Json),
        _ => Err(RpcJobError::UnknownEnding { path: output.to_owned() }),
    }
}
