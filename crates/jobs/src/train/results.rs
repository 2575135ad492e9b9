//! The files that both trainings write.

use std::path::{Path, PathBuf};

use ::train::Surfel;
use io::splat_ply::{self, LocalOrigin, SplatForm, SplatLayout, SplatPlyError};

use crate::files::{self, FileError};
use crate::report_page;

/// The splats.
const SPLATS: &str = "splats.ply";
/// The report, with its page beside.
pub(super) const REPORT: &str = "report.json";
/// The state to go on from, until the results are written.
pub(super) const CHECKPOINT: &str = "checkpoint.bin";
/// Folder of the views that were not trained on.
pub(super) const RENDERS: &str = "renders";
/// Thickness of a splat in the file, metres. 2DGS has none.
const THICKNESS_M: f32 = 1e-4;

/// Refuses a folder with results that may not be replaced.
pub(super) fn refuse_existing(output: &Path, overwrite: bool) -> Result<(), FileError> {
    files::refuse_existing(&output.join(SPLATS), overwrite)?;
    report_page::refuse_existing(&output.join(REPORT), overwrite)
}

/// Writes splats with their origin, and returns their file.
pub(super) fn write_splats(
    output: &Path,
    surfels: &[Surfel],
    origin: &LocalOrigin,
    overwrite: bool,
) -> Result<PathBuf, SplatPlyError> {
    let splats: Vec<_> = surfels.iter().map(|s| s.to_splat(THICKNESS_M)).collect();
    let path = output.join(SPLATS);
    let layout = SplatLayout { form: SplatForm::Discs, ..SplatLayout::default() };
    splat_ply::write(&path, &splats, origin, layout, overwrite)?;
    Ok(path)
}
