//! Values of options that several commands share.

use std::path::Path;

use anyhow::bail;
use crs::{CrsRequest, VerticalDatum};
use jobs::corrections::CorrectionSource;

/// Reads `--corrections`: a report, the word `none`, or nothing (the corrections of the run that
/// made the surface).
pub(crate) fn corrections_of(option: Option<&Path>) -> CorrectionSource {
    match option {
        None => CorrectionSource::SurfaceRun,
        Some(word) if word.as_os_str() == "none" => CorrectionSource::Uncorrected,
        Some(report) => CorrectionSource::Report(report.to_owned()),
    }
}

/// Returns the codes of a CRS that must be named: the horizontal one and that of the heights.
pub(crate) fn code_of(crs: Option<CrsRequest>, option: &str) -> anyhow::Result<(Option<u32>, Option<VerticalDatum>)> {
    match crs {
        Some(CrsRequest::Epsg { horizontal, vertical }) => Ok((Some(horizontal), vertical)),
        Some(CrsRequest::Auto) => bail!("{option} must name a code: EPSG:n"),
        None => Ok((None, None)),
    }
}
