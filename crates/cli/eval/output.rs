//! Where an evaluation is written: the report folder, the page alone, the error map.
//!
//! Without -o, a surface model inside the folder of a run (`RUN/dsm/dsm.tif`, with `RUN/report/report.json` beside) has its report
//! in `RUN/eval`; any other is only printed. What an earlier evaluation wrote is replaced, anything else only with --overwrite.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use crs::Crs;
use io::raster::{Band, BandData, CogRaster, write_cog, write_png_rgb};
use io::write_bytes;
use report::{EvaluationReport, error_picture};

use super::Args;
use super::inputs::Inputs;

/// The files of a report folder; the page comes last, so that a folder with a page is complete.
const JSON: &str = "report.json";
const ERROR_MAP: &str = "error_map.tif";
const ERROR_PICTURE: &str = "error_map.png";
const PAGE: &str = "report.html";

/// The folder that the report goes to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Target {
    pub(super) folder: PathBuf,
    /// Nobody asked for it: when it cannot be written that is told, and no failure.
    by_itself: bool,
}

impl Target {
    /// What the arguments ask for, or what the place of the test surface suggests.
    pub(super) fn of(args: &Args) -> Option<Self> {
        if let Some(folder) = &args.output {
            return Some(Self { folder: folder.clone(), by_itself: false });
        }
        let run = args.test.parent().filter(|p| p.file_name().is_some_and(|name| name == "dsm"))?.parent()?;
        let made_here = run.join("report/report.json").is_file() && run.join("used_config.toml").is_file();
        (made_here && !args.no_report).then(|| Self { folder: run.join("eval"), by_itself: true })
    }

    /// Refuses early what would replace files that no evaluation wrote.
    fn check(&self, overwrite: bool) -> anyhow::Result<()> {
        let ours = fs::read_to_string(self.folder.join(JSON)).is_ok_and(|text| EvaluationReport::is_ours(&text));
        let taken = [JSON, ERROR_MAP, ERROR_PICTURE, PAGE].map(|name| self.folder.join(name));
        match taken.iter().find(|path| path.symlink_metadata().is_ok()) {
            Some(path) if !ours && !overwrite => {
                bail!(
                    "a file is in the way that no evaluation wrote: choose another folder or pass --overwrite: {}",
                    path.display()
                )
            }
            _ => Ok(()),
        }
    }
}

/// Refuses before the work what would fail after it.
pub(super) fn check(args: &Args, target: Option<&Target>) -> anyhow::Result<()> {
    for path in args.error_map.iter().chain(&args.html) {
        if !args.overwrite && path.symlink_metadata().is_ok() {
            bail!("the output exists already: choose another name or pass --overwrite: {}", path.display());
        }
    }
    target.filter(|target| !target.by_itself).map_or(Ok(()), |target| target.check(args.overwrite))
}

/// Writes what was asked for and says in one line each where it is.
pub(super) fn write(
    args: &Args,
    target: Option<&Target>,
    inputs: &Inputs,
    report: &EvaluationReport<'_>,
) -> anyhow::Result<Vec<String>> {
    let mut told = Vec::new();
    if let Some(path) = &args.error_map {
        let horizontal = inputs.reference.horizontal_epsg.context(
            "an error map takes the coordinate system of the reference, which has no EPSG code: leave --error-map out",
        )?;
        write_error_map(path, horizontal, inputs, report, args.overwrite)?;
        told.push(format!("error map  {}", path.display()));
    }
    if let Some(path) = &args.html {
        write_bytes(path, report.html()?.as_bytes(), args.overwrite)?;
        told.push(format!("page       {}", path.display()));
    }
    match target.map(|target| (target, write_folder(target, inputs, report, args.overwrite))) {
        Some((target, Ok(()))) => told.push(format!("report     {}", target.folder.join(PAGE).display())),
        Some((target, Err(error))) if target.by_itself => tracing::warn!("no report was written: {error:#}"),
        Some((_, Err(error))) => return Err(error),
        None if args.html.is_none() && !args.no_report => {
            told.push("report     none; -o DIR writes one (page, JSON, error map)".to_owned());
        }
        None => {}
    }
    Ok(told)
}

fn write_folder(
    target: &Target,
    inputs: &Inputs,
    report: &EvaluationReport<'_>,
    overwrite: bool,
) -> anyhow::Result<()> {
    target.check(overwrite)?;
    let folder = &target.folder;
    fs::create_dir_all(folder).with_context(|| format!("cannot make the folder: {}", folder.display()))?;
    let json = serde_json::to_string_pretty(&report.json())? + "\n";
    // First, so that an interrupted evaluation is still known as one.
    write_bytes(folder.join(JSON), json.as_bytes(), true)?;
    if let Some(horizontal) = inputs.reference.horizontal_epsg {
        write_error_map(&folder.join(ERROR_MAP), horizontal, inputs, report, true)?;
    }
    let picture = error_picture(&report.found.errors, report.reference, report.error_range_m());
    write_png_rgb(folder.join(ERROR_PICTURE), &picture, true)?;
    write_bytes(folder.join(PAGE), report.html()?.as_bytes(), true)?;
    Ok(())
}

fn write_error_map(
    path: &Path,
    horizontal: u32,
    inputs: &Inputs,
    report: &EvaluationReport<'_>,
    overwrite: bool,
) -> anyhow::Result<()> {
    let bands = [Band { description: "error_m", data: BandData::F32(&report.found.errors) }];
    let raster = CogRaster::new(&bands, inputs.reference.geotransform, Crs::ellipsoidal(horizontal));
    Ok(write_cog(path, &raster, overwrite)?)
}
