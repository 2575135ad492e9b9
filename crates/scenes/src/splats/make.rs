//! Making splats of a surface model and its images.

use std::path::{Path, PathBuf};

use ::splats::{
    ColourFit, DivisionConfig, RpcSplatCamera, SplatConfig, SplatReport, SplatScene, SplatSurface, SplatView,
    ViewReport, make_splats,
};
use crs::VerticalDatum;
use formats::raster::{read_dem, write_png_rgb};
use formats::splat_ply::{LocalOrigin, SplatFile, SplatForm, SplatLayout};
use numeric::Progress;
use raster::Grid;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::convert::format_of;
use super::error::SplatsJobError;
use super::image::{self, ColourImage};
use job::corrections::{CorrectionSource, Corrections};
use job::error::JobError;
use job::files::{self, FileError};
use job::map_surface::{self, MapSurface};
use job::output_folder::OutputFolder;
use job::report_page;
use job::threads::install;

/// A surface model and its images, to be turned into splats.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SplatsConfig {
    /// The surface model, in a projected CRS in metres.
    pub dsm: PathBuf,
    /// Images with RPCs that give the colours.
    pub images: Vec<PathBuf>,
    /// File to write (PLY); its origin is written beside it.
    pub output: PathBuf,
    /// Largest distance of a height from the plane of its splat, metres.
    pub error_m: f64,
    /// Largest standard deviation of the colours under one splat, as a share of the display range.
    /// Infinity leaves the division to the geometry.
    pub colour_error: f64,
    /// Side of square splats, cells; splats as large as the bounds allow when `None`.
    pub uniform_side: Option<usize>,
    /// Whether the walls between cells get splats. Square splats have none.
    pub walls: bool,
    /// Confidence of the cells, 0 to 1, on the grid of the surface model; it becomes opacity. Full
    /// when `None`.
    pub confidence: Option<PathBuf>,
    /// Source of the pointing corrections of the images.
    pub corrections: CorrectionSource,
    /// Vertical datum of the surface model; the one that the file states when `None`.
    pub vertical: Option<VerticalDatum>,
    /// Whether splats have two scales (2DGS) instead of three (3DGS).
    pub discs: bool,
    /// Degree of the spherical harmonics in the file, 0 to 3. The original 3DGS and 2DGS loaders
    /// expect 3.
    pub sh_degree: u8,
    /// Whether uniform splats of several sizes are measured for comparison.
    pub compare: bool,
    /// File for the report (JSON), whose page is written beside it.
    pub report: Option<PathBuf>,
    /// Folder for the splats as each image sees them (PNG, in the display range).
    pub renderings: Option<PathBuf>,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

/// Number of splats, and how well they stand for the surface and the images.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct SplatsReport {
    /// Count and errors of the splats.
    #[serde(flatten)]
    pub made: SplatReport<SplatsImageReport>,
    /// File that was written.
    pub output: String,
    /// Bound on the heights that was asked for, metres.
    pub error_bound_m: f64,
    /// Bound on the colours that was asked for, as a share of the display range.
    pub colour_bound: f64,
}

/// How well the splats render back into one image.
#[derive(Debug, Clone, Serialize)]
pub struct SplatsImageReport {
    /// The numbers.
    #[serde(flatten)]
    pub view: ViewReport,
    /// The image.
    pub image: String,
}

impl SplatsConfig {
    /// Splats under the default bounds, with the corrections of the run that made the surface
    /// model.
    pub fn new(dsm: PathBuf, images: Vec<PathBuf>, output: PathBuf) -> Self {
        let division = DivisionConfig::default();
        Self {
            dsm,
            images,
            output,
            error_m: division.error_m,
            colour_error: division.colour_error,
            uniform_side: None,
            walls: true,
            confidence: None,
            corrections: CorrectionSource::default(),
            vertical: None,
            discs: false,
            sh_degree: 0,
            compare: false,
            report: None,
            renderings: None,
            threads: None,
            overwrite: false,
        }
    }

    fn splat_config(&self) -> SplatConfig {
        SplatConfig {
            division: DivisionConfig {
                error_m: self.error_m,
                colour_error: self.colour_error,
                ..DivisionConfig::default()
            },
            colour: ColourFit::default(),
            uniform_side: self.uniform_side,
            walls: self.walls,
            compare: self.compare,
            ..SplatConfig::default()
        }
    }
}

impl SplatsReport {
    fn new(config: &SplatsConfig, report: SplatReport) -> Self {
        let mut images = config.images.iter().map(|path| path.display().to_string());
        let named = |view| SplatsImageReport { view, image: images.next().unwrap_or_default() };
        Self {
            made: report.map_views(named),
            output: config.output.display().to_string(),
            error_bound_m: config.error_m,
            colour_bound: config.colour_error,
        }
    }

    /// Returns the report as it is written to file.
    ///
    /// # Errors
    /// None in practice: the report has text keys only.
    pub fn to_json(&self) -> Result<Value, serde_json::Error> {
        serde_json::to_value(self)
    }
}

/// Makes splats of a surface model and its images and writes them.
///
/// # Errors
/// [`JobError`]: an input that cannot be used, bounds that are not positive, an output that
/// exists.
///
/// ```
/// use scenes::splats::{SplatsConfig, make};
/// let town = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
/// let folder = tempfile::tempdir()?;
/// let images = vec![town.join("view_1.tif")];
/// let mut config = SplatsConfig::new(town.join("truth/dsm.tif"), images, folder.path().join("town.ply"));
/// (config.uniform_side, config.compare) = (Some(4), false);
/// let report = make(&config, &numeric::Silent)?;
/// assert!(report.made.splats < report.made.cells && config.output.is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn make(config: &SplatsConfig, progress: &dyn Progress) -> Result<SplatsReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &SplatsConfig, progress: &dyn Progress) -> Result<SplatsReport, SplatsJobError> {
    format_of(&config.output)?;
    files::check_destination(&config.output, config.overwrite)?;
    if let Some(path) = &config.report {
        report_page::refuse_existing(path, config.overwrite)?;
    }
    if let Some(folder) = &config.renderings {
        OutputFolder::check(folder)?;
    }
    let report = install(config.threads, || make_and_write(config, progress))??;
    if let Some(path) = &config.report {
        let lead = "Gaussian splats of a surface model and its images, and how well they render back.";
        report_page::write(path, ("Splats", lead), &report, Vec::new(), config.overwrite)?;
    }
    Ok(report)
}

fn make_and_write(config: &SplatsConfig, progress: &dyn Progress) -> Result<SplatsReport, SplatsJobError> {
    let map = map_surface::read(&config.dsm, config.vertical, progress)?;
    let origin = SplatSurface::middle(&map.dem.heights, map.dem.geotransform)
        .ok_or_else(|| SplatsJobError::NoHeight { path: config.dsm.clone() })?;
    progress.check_cancelled()?;
    let scene = splat_scene(config, &map, origin, progress)?;
    progress.check_cancelled()?;
    let form = if config.discs { SplatForm::Discs } else { SplatForm::Ellipsoids };
    let layout = SplatLayout { form, sh_degree: config.sh_degree };
    let local = LocalOrigin::new(map.projection.definition(), "ellipsoid", origin);
    // `render` looks through the same cameras.
    let corrections = Corrections::for_surface(&config.dsm, &config.corrections)?.of_images(&config.images);
    corrections.write(&pointing_path(&config.output), config.overwrite)?;
    let file = SplatFile { splats: scene.splats, harmonics: None, labels: None, layout, origin: Some(local) };
    formats::splat_files::write(&config.output, &file, config.overwrite).map_err(FileError::write)?;
    write_renderings(config, &scene.renderings)?;
    Ok(SplatsReport::new(config, scene.report))
}

/// Returns the file beside splats that holds the pointing corrections of their images.
pub(crate) fn pointing_path(splats: &Path) -> PathBuf {
    splats.with_extension("pointing.json")
}

fn splat_scene(
    config: &SplatsConfig,
    map: &MapSurface,
    origin: [f64; 3],
    progress: &dyn Progress,
) -> Result<SplatScene, SplatsJobError> {
    let surface = SplatSurface::new(&map.dem.heights, map.dem.geotransform, origin);
    let confidence = config.confidence.as_deref().map(read_confidence).transpose()?;
    let corrections = Corrections::for_surface(&config.dsm, &config.corrections)?;
    let read = |path: &PathBuf| image::read(path, &corrections, progress);
    let images = config.images.iter().map(read).collect::<Result<Vec<ColourImage>, _>>()?;
    let mut views = Vec::with_capacity(images.len());
    for (path, image) in config.images.iter().zip(&images) {
        let size = (image.pixels.width(), image.pixels.height());
        let camera = RpcSplatCamera::new(&image.camera, &map.projection, origin, size)?
            .ok_or_else(|| SplatsJobError::NotSeen { target: "the surface model", path: path.clone() })?;
        views.push(SplatView { camera, image: &image.pixels });
    }
    Ok(make_splats(&surface, confidence.as_ref(), &views, &config.splat_config())?)
}

fn read_confidence(path: &Path) -> Result<Grid<f32>, SplatsJobError> {
    Ok(read_dem(path).map_err(SplatsJobError::Confidence)?.heights)
}

fn write_renderings(config: &SplatsConfig, renderings: &[Grid<[f32; 3]>]) -> Result<(), FileError> {
    let Some(folder) = &config.renderings else { return Ok(()) };
    files::create_folder(folder)?;
    for (path, rendering) in config.images.iter().zip(renderings) {
        let name = path.file_stem().unwrap_or_default();
        let picture = rendering.map(|p| p.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8));
        write_png_rgb(folder.join(name).with_extension("png"), &picture, config.overwrite)?;
    }
    Ok(())
}
