//! Writes the outputs of a comparison of height grids: the report folder, the page alone, the error
//! map.
//!
//! A surface model inside the folder of a DSM run (`RUN/dsm/dsm.tif`, with `RUN/report/report.json`
//! beside it) can have its report in `RUN/eval` without being asked. Files of an earlier evaluation
//! are replaced; other files are not, unless the configuration allows it.

use std::path::{Path, PathBuf};

use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, Provenance, write_cog, write_png_rgb, write_world_file};
use formats::write_bytes;
use numeric::Progress;
use report::{EvaluationReport, Legend, error_picture};

use super::error::EvalJobError;
use super::grid_config::{EvalTarget, GridEvalConfig};
use super::grid_inputs::GridInputs;
use super::report_folder::{
    ERROR_MAP, ERROR_PICTURE, ERROR_STYLE, ERROR_WORLD, PAGE, REPORT_JSON, RUN_FOLDER, check_ours,
};
use job::files::{self, FileError};
use job::guarded;
use job::output_folder::OutputFolder;

/// Folder that the report is written to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Target {
    folder: PathBuf,
    /// Whether the folder follows from the place of the test, and nobody asked for it. Then a
    /// failure is a warning.
    automatic: bool,
}

/// What became of the report folder.
#[derive(Debug, Default)]
pub(super) struct Written {
    /// The page in the folder.
    pub(super) page: Option<PathBuf>,
    /// Reason why the automatic report was not written.
    pub(super) failure: Option<String>,
}

impl Target {
    /// Returns the folder that the configuration asks for, or that the place of the test suggests.
    pub(super) fn of(config: &GridEvalConfig) -> Option<Self> {
        match &config.target {
            EvalTarget::Nowhere => None,
            EvalTarget::Folder(folder) => Some(Self { folder: folder.clone(), automatic: false }),
            EvalTarget::RunFolder => {
                let dsm = config.test.parent().filter(|p| p.file_name().is_some_and(|name| name == "dsm"));
                let run = dsm?.parent()?;
                let is_run = run.join("report/report.json").is_file() && run.join("used_config.toml").is_file();
                is_run.then(|| Self { folder: run.join(RUN_FOLDER), automatic: true })
            }
        }
    }

    /// Refuses to replace files that no evaluation wrote.
    fn check(&self, overwrite: bool) -> Result<(), EvalJobError> {
        let names = [REPORT_JSON, ERROR_MAP, ERROR_STYLE, ERROR_PICTURE, ERROR_WORLD, PAGE];
        let taken = names.map(|name| self.folder.join(name));
        check_ours(&self.folder, &taken, overwrite)
    }
}

/// Refuses before the work what would fail after it.
pub(super) fn check(config: &GridEvalConfig, target: Option<&Target>) -> Result<(), EvalJobError> {
    let (error_map, page) = (config.error_map.as_deref(), config.page.as_deref());
    error_map.map_or(Ok(()), |path| files::check_raster_destination(path, config.overwrite))?;
    page.map_or(Ok(()), |path| files::check_destination(path, config.overwrite))?;
    if let Some(target) = target.filter(|target| target.automatic) {
        // Nobody named this folder; a link in its place could lead anywhere.
        guarded::check_folder(&target.folder)?;
    }
    let Some(target) = target.filter(|target| !target.automatic) else { return Ok(()) };
    target.check(config.overwrite)?;
    Ok(OutputFolder::check(&target.folder)?)
}

/// Writes the outputs that were asked for, and the report folder.
pub(super) fn write(
    config: &GridEvalConfig,
    target: Option<&Target>,
    inputs: &GridInputs,
    report: &EvaluationReport<'_>,
    progress: &dyn Progress,
) -> Result<Written, EvalJobError> {
    if let Some(path) = &config.error_map {
        let horizontal = inputs.reference.horizontal_epsg.ok_or(EvalJobError::NoEpsgForErrorMap)?;
        write_error_map(path, horizontal, inputs, report, config.overwrite)?;
    }
    if let Some(path) = &config.page {
        write_bytes(path, report.html()?.as_bytes(), config.overwrite).map_err(FileError::from)?;
    }
    let Some(target) = target else { return Ok(Written::default()) };
    match write_folder(target, inputs, report, config.overwrite) {
        Ok(page) => Ok(Written { page: Some(page), failure: None }),
        Err(error) if target.automatic => {
            let failure = job::error_text::with_causes(&error);
            progress.warn(&format!("no report was written: {failure}"));
            Ok(Written { page: None, failure: Some(failure) })
        }
        Err(error) => Err(error),
    }
}

/// Writes the report folder and returns its page.
fn write_folder(
    target: &Target,
    inputs: &GridInputs,
    report: &EvaluationReport<'_>,
    overwrite: bool,
) -> Result<PathBuf, EvalJobError> {
    target.check(overwrite)?;
    let taken = OutputFolder::take(&target.folder)?;
    let folder = taken.path();
    // The JSON comes first, so that an interrupted evaluation is recognised as one, and the page of
    // an earlier one goes before it.
    taken.remove(PAGE)?;
    files::write_json(&folder.join(REPORT_JSON), &report.json(), true)?;
    if let Some(horizontal) = inputs.reference.horizontal_epsg {
        write_error_map(&folder.join(ERROR_MAP), horizontal, inputs, report, true)?;
        let style = Legend::signed(report.error_range_m(), "m").qml();
        write_bytes(folder.join(ERROR_STYLE), style.as_bytes(), true).map_err(FileError::from)?;
    }
    let picture = error_picture(&report.found.errors, report.reference, report.error_range_m());
    let file = folder.join(ERROR_PICTURE);
    write_png_rgb(&file, &picture, true).map_err(FileError::from)?;
    write_world_file(&file, inputs.reference.geotransform, 1).map_err(FileError::from)?;
    let page = folder.join(PAGE);
    write_bytes(&page, report.html()?.as_bytes(), true).map_err(FileError::from)?;
    Ok(page)
}

/// Writes the errors as a GeoTIFF on the grid of the reference.
fn write_error_map(
    path: &Path,
    horizontal: u32,
    inputs: &GridInputs,
    report: &EvaluationReport<'_>,
    overwrite: bool,
) -> Result<(), EvalJobError> {
    let bands = [Band { description: "error_m", data: BandData::F32(&report.found.errors) }];
    let place = (inputs.reference.geotransform, Crs::ellipsoidal(horizontal));
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let sources = [&report.protocol.test, &report.protocol.reference].map(|path| name(Path::new(path)));
    let provenance = Provenance { sources: sources.to_vec(), acquired: Vec::new() };
    let plain = CogRaster::new(&bands, place.0, place.1);
    let raster = CogRaster { holds_heights: false, provenance: Some(&provenance), ..plain };
    Ok(write_cog(path, &raster, overwrite).map_err(FileError::from)?)
}
