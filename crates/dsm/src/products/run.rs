//! Runs the products job.

use std::path::{Path, PathBuf};

use formats::raster::ImageSource;
use numeric::{Choice, Progress};

use super::cloud::{self, ClassSources};
use super::colour::colours;
use super::config::{FOLDER, ProductsConfig};
use super::contours;
use super::error::ProductsError;
use super::mesh;
use super::mesh_tiles::{TILES, TILESET, is_tile};
use super::page;
use super::product::ProductKind;
use super::report::ProductsReport;
use super::scene::SurfaceOfRun;
use crate::job_file::read_dsm_job;
use job::error::JobError;
use job::files::{self, FileError};
use job::guarded;
use job::output_folder::OutputFolder;
use job::report_page;
use job::run_links;
use job::threads;
use surfaces::classes::{self, ClassesConfig};
use surfaces::dtm::{self, DtmConfig, DtmReport};
use surfaces::ortho::{self, OrthoConfig};

/// Names in the folder of the products.
const ORTHO: &str = "ortho.tif";
const ORTHO_MASK: &str = "ortho_mask.tif";
const BESIDE_ORTHO: [&str; 3] = ["ortho_mask.qml", "ortho_report.html", "ortho_report.json"];
const DTM: &str = "dtm";
const DTM_STATES: &str = "dtm/ground.tif";
const DTM_HEIGHTS: &str = "dtm/dtm.tif";
const CLASSES: &str = "classes";
const CLASS_CODES: &str = "classes/classes.tif";
const REPORT: &str = "products.json";
const PAGE: &str = "products.html";
/// Settings of a run, which name its images.
const SETTINGS: &str = "used_config.toml";

/// Makes products of the folder of a run, and a report beside them.
///
/// # Errors
/// [`JobError`]: a folder that is no run, images that cannot be found, outputs that exist.
pub fn run(config: &ProductsConfig, progress: &dyn Progress) -> Result<ProductsReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &ProductsConfig, progress: &dyn Progress) -> Result<ProductsReport, ProductsError> {
    config.validate()?;
    let output = config.folder();
    let names = config.products.iter().flat_map(|product| match product {
        ProductKind::Cloud => cloud::FILES.map(|(name, _)| name).to_vec(),
        ProductKind::Dtm => vec![DTM_STATES],
        ProductKind::Classes => vec![CLASS_CODES],
        ProductKind::Contours => vec![contours::FILE],
        ProductKind::Mesh => vec![mesh::GLB, TILESET, TILES],
    });
    names.into_iter().try_for_each(|name| files::refuse_existing(&output.join(name), config.overwrite))?;
    threads::install(config.threads, || make(config, &output, progress))?
}

fn make(config: &ProductsConfig, output: &Path, progress: &dyn Progress) -> Result<ProductsReport, ProductsError> {
    let surface = SurfaceOfRun::open(&config.run, progress)?;
    if config.output.is_none() {
        guarded::check_folder(output)?;
    }
    let folder = OutputFolder::take(output)?;
    folder.check_folders([DTM, CLASSES])?;
    if config.wants(ProductKind::Mesh) {
        folder.require_own(TILES, &is_tile)?;
    }
    let has_ground = output.join(DTM_HEIGHTS).is_file();
    let needs_ground = config.wants(ProductKind::Contours) && !has_ground;
    let wants_ground = config.wants(ProductKind::Dtm) || needs_ground;
    let dtm = wants_ground.then(|| terrain(config, output, progress)).transpose()?;
    let mut shown = None;
    let mut report = ProductsReport {
        surface: surface.dem.path.clone(),
        folder: output.to_owned(),
        ortho: None,
        colour: None,
        dtm,
        classes: None,
        contours: None,
        mesh: None,
        cloud: None,
    };
    if config.wants(ProductKind::Classes) {
        let mut of = ClassesConfig::new(config.run.clone(), output.join(CLASSES));
        of.overwrite = config.overwrite;
        of.multispectral = multispectral(&config.run);
        report.classes =
            Some(classes::run(&of, progress).map_err(|error| ProductsError::of(error, ProductsError::Classes))?);
    }
    if config.wants(ProductKind::Contours) {
        let (dtm, interval) = (output.join(DTM_HEIGHTS), config.contour_interval);
        report.contours = Some(contours::make(&surface, &dtm, interval, &folder, progress)?);
    }
    if config.wants(ProductKind::Cloud) || config.wants(ProductKind::Mesh) {
        let ortho = ortho_file(config, output, progress)?;
        let (colours, colour) = colours(&surface, &ortho)?;
        (report.ortho, report.colour) = (Some(ortho), Some(colour));
        shown = Some(report_page::thinned(&colours).0.map(|colour| colour.map(|c| (c >> 8) as u8)));
        if config.wants(ProductKind::Mesh) {
            let fitting = || surface.layer("sigma.tif").map(|sigma| mesh::fitting_tolerance(&sigma, surface.cell_m()));
            let tolerance_m = config.mesh_tolerance_m.map_or_else(fitting, Ok)?;
            report.mesh = Some(mesh::make(&surface, &colours, tolerance_m, &folder, progress)?);
        }
        if config.wants(ProductKind::Cloud) {
            let states = Some(output.join(DTM_STATES)).filter(|states| states.is_file());
            let classes = Some(output.join(CLASS_CODES)).filter(|classes| classes.is_file());
            let sources = ClassSources { ground: states.as_deref(), classes: classes.as_deref() };
            report.cloud = Some(cloud::make(&surface, &colours, &sources, config.filled, &folder, progress)?);
        }
    }
    let page = page::of(&report, &surface, shown)?;
    report_page::write_page(&output.join(REPORT), &page, &report, true)?;
    run_links::refresh(&config.run)?;
    Ok(report)
}

/// Makes products of a run that has just ended in its folder.
pub(crate) fn beside(
    run_folder: &Path,
    products: &[ProductKind],
    overwrite: bool,
    progress: &dyn Progress,
) -> Result<(), ProductsError> {
    if products.is_empty() {
        return Ok(());
    }
    let mut config = ProductsConfig::new(run_folder.to_owned());
    (config.products, config.overwrite) = (products.to_vec(), overwrite);
    let report = run(&config, progress)?;
    let value = report.folder.display().to_string();
    progress.choice(&Choice { name: "products".to_owned(), value, reason: "they were asked for".to_owned() });
    Ok(())
}

/// Removes the products of a surface model that is replaced. Folders without a report of ours stay.
pub(crate) fn remove_products(run_folder: &OutputFolder) -> Result<(), FileError> {
    let folder = run_folder.path().join(FOLDER);
    if folder.is_symlink() || !folder.join(REPORT).is_file() {
        return Ok(());
    }
    guarded::remove_known(&folder.join(TILES), &is_tile)?;
    guarded::remove_known(&folder.join(DTM), &|name| dtm::FILES.contains(&name))?;
    guarded::remove_known(&folder.join(CLASSES), &|name| classes::FILES.contains(&name))?;
    let clouds = cloud::FILES.map(|(name, _)| name);
    let others = [contours::FILE, mesh::GLB, TILESET, ORTHO, ORTHO_MASK, PAGE];
    let is_product = |name: &str| clouds.iter().chain(&BESIDE_ORTHO).chain(&others).any(|known| *known == name);
    guarded::remove_known(&folder, &is_product)?;
    // The report marks the folder, so it goes last.
    guarded::remove_known(&folder, &|name| name == REPORT)
}

/// Returns the images of a run that name a red and a near-infrared band; none where the images are
/// no longer there, because classes need none.
fn multispectral(run: &Path) -> Vec<PathBuf> {
    let Ok(settings) = read_dsm_job(&run.join(SETTINGS)) else { return Vec::new() };
    let has_index = |path: &PathBuf| {
        let bands = ImageSource::open(path).and_then(|source| source.index_bands(None, None));
        matches!(bands, Ok(Some(_)))
    };
    settings.images.into_iter().filter(has_index).collect()
}

/// Makes the terrain model.
fn terrain(config: &ProductsConfig, output: &Path, progress: &dyn Progress) -> Result<DtmReport, ProductsError> {
    let mut of = DtmConfig::new(config.run.clone(), output.join(DTM));
    of.overwrite = config.overwrite;
    dtm::run(&of, progress).map_err(|error| ProductsError::of(error, ProductsError::Dtm))
}

/// Returns the ortho that was given or that an earlier call made, or makes one.
fn ortho_file(config: &ProductsConfig, output: &Path, progress: &dyn Progress) -> Result<PathBuf, ProductsError> {
    if let Some(ortho) = &config.ortho {
        return Ok(ortho.clone());
    }
    let made = output.join(ORTHO);
    if made.is_file() && !config.overwrite {
        return Ok(made);
    }
    let settings = read_dsm_job(&config.run.join(SETTINGS)).map_err(|error| ProductsError::Images(Box::new(error)))?;
    let mut of = OrthoConfig::new(settings.images, config.run.clone(), made.clone());
    of.overwrite = config.overwrite;
    ortho::run(&of, progress).map_err(|error| ProductsError::of(error, ProductsError::Ortho))?;
    Ok(made)
}
