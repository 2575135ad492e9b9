//! Rendering splats through satellite images and perspective cameras, and comparing them with the
//! pictures.
//!
//! The folder holds `colour/NAME.png` (over black), `alpha/NAME.png` (accumulated opacity),
//! `height/NAME.npy` (metres above the datum of the origin where half of the light is stopped, NaN
//! elsewhere), for perspective cameras `depth/NAME.npy` (metres along the optical axis to the same
//! place), and `report.json`. Splats with labels also give `class/NAME.npy` and `object/NAME.npy`
//! in the numbers of the maps of priors, with the names in `labels.json`. Pictures are compared
//! over the pixels that splats cover by more than half, and over all. Flat splats through pinholes
//! are drawn as trainings and meshes draw them (2DGS), and their depths are means by weight; others
//! are mixed where they lie on one surface. Satellite images have units of their own, so they are
//! compared after a gain and an offset per channel.

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use ::splats::{LensSplatCamera, Rendering, RpcSplatCamera, SplatCamera, psnr_db, render_labels, ssim};
use ::train::{Drawing, PinholeView, Registers, Surfel, SurfelCamera};
use camera::{Lens, LensModel};
use crs::{CrsError, MapProjection};
use formats::colmap::{ColmapModel, ColmapView};
use formats::npy;
use formats::raster::{write_png_gray, write_png_rgb};
use formats::splat_ply::{LocalOrigin, SplatFile};
use gaussian::{Splat, SplatLabel};
use numeric::Progress;
use raster::Grid;
use serde::{Deserialize, Serialize};

use super::error::SplatsJobError;
use super::image;
use super::make::pointing_path;
use crate::small_view::{pinhole, shrunk};
use job::corrections::{CorrectionSource, Corrections};
use job::dataset_folder::{UNKNOWN_DATUM, UNKNOWN_FRAME, dataset_folder, sparse_folder};
use job::error::{JobError, SettingError};
use job::files::{self, FileError};
use job::output_folder::OutputFolder;
use job::placed_model;
use job::report_page;
use job::threads::install;

const REPORT: &str = "report.json";
/// Names of the numbers in the maps of labels.
const LABELS: &str = "labels.json";
/// Least accumulated opacity of the pixels that are compared.
const COVERED: f32 = 0.5;

/// Splats and the cameras to look at them through.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SplatRenderConfig {
    /// Splats (PLY of 3DGS or 2DGS, SPZ, SOG or glTF) with their origin beside them. Files of other
    /// programs have none: they lie in the frame of the perspective cameras.
    pub splats: PathBuf,
    /// Images with RPCs to look through.
    pub images: Vec<PathBuf>,
    /// Perspective cameras to look through: folder of a COLMAP model on the map of the splats with
    /// `origin.json`, or of a dataset of the priors job.
    pub cameras: Option<PathBuf>,
    /// Folder with the pictures of the perspective cameras; cameras without a picture are rendered
    /// and not compared. `images` of the dataset when `None`.
    pub pictures: Option<PathBuf>,
    /// Pixels of a perspective camera that become one, in each direction.
    pub shrink: usize,
    /// Source of the pointing corrections of the images. [`CorrectionSource::SurfaceRun`] takes
    /// those that the splats were made with, which lie beside them, or else those of the run in
    /// whose folder they lie.
    pub corrections: CorrectionSource,
    /// Folder to write.
    pub output: PathBuf,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

/// What the cameras saw.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SplatRenderReport {
    /// Number of splats.
    pub splats: usize,
    /// One entry per camera.
    pub views: Vec<SplatRenderView>,
}

/// What one camera saw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SplatRenderView {
    /// Name of the view's files.
    pub name: String,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Mean accumulated opacity.
    pub coverage: f64,
    /// Peak signal-to-noise ratio against the picture, decibels, where there is a picture: over the
    /// pixels that splats cover by more than half.
    pub psnr_db: Option<f64>,
    /// The same over all pixels, as trainings judge their views.
    pub psnr_whole_db: Option<f64>,
    /// Structural similarity with the picture, where there is a picture, over the covered pixels.
    pub ssim: Option<f64>,
}

impl SplatRenderReport {
    /// Returns the report of the views in `folder` as text, which ends in a line break.
    pub fn text(&self, folder: &Path) -> String {
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
        let mut text = format!("splats     {}\n", self.splats);
        for view in &self.views {
            let (psnr, ssim) = (number(view.psnr_db), number(view.ssim));
            text += &format!("{:20} {:.1} % covered, PSNR {psnr} dB, SSIM {ssim}\n", view.name, 100.0 * view.coverage);
        }
        text + &format!("written    {}\n", folder.display())
    }
}

impl SplatRenderConfig {
    /// Views of `splats` in `output`; at least images or cameras must be added.
    pub fn new(splats: PathBuf, output: PathBuf) -> Self {
        Self {
            splats,
            images: Vec::new(),
            cameras: None,
            pictures: None,
            shrink: 1,
            corrections: CorrectionSource::default(),
            output,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks that there is a camera.
    ///
    /// # Errors
    /// [`JobError`] without images and cameras, and for a factor outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        if self.images.is_empty() && self.cameras.is_none() {
            return Err(SplatsJobError::NoCamera.into());
        }
        if !(1..=64).contains(&self.shrink) {
            return Err(SettingError::new("the factor that images shrink by", self.shrink, "1 to 64").into());
        }
        Ok(())
    }
}

/// Renders splats through all cameras, compares them with the pictures and writes the folder.
///
/// # Errors
/// [`JobError`]: splats without an origin, cameras on another map, two views of one name, an
/// output that exists.
///
/// ```
/// use scenes::splats::{SplatRenderConfig, SplatsConfig, make, render};
/// let town = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
/// let folder = tempfile::tempdir()?;
/// let images = vec![town.join("view_1.tif")];
/// let ply = folder.path().join("town.ply");
/// let mut coarse = SplatsConfig::new(town.join("truth/dsm.tif"), images.clone(), ply.clone());
/// (coarse.uniform_side, coarse.compare) = (Some(4), false);
/// make(&coarse, &numeric::Silent)?;
/// let mut config = SplatRenderConfig::new(ply, folder.path().join("seen"));
/// config.images = images;
/// let report = render(&config, &numeric::Silent)?;
/// assert!(report.views[0].psnr_db.is_some_and(|psnr| psnr > 15.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn render(config: &SplatRenderConfig, progress: &dyn Progress) -> Result<SplatRenderReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &SplatRenderConfig, progress: &dyn Progress) -> Result<SplatRenderReport, SplatsJobError> {
    let report_path = config.output.join(REPORT);
    report_page::refuse_existing(&report_path, config.overwrite)?;
    config.validate()?;
    let folder = OutputFolder::take(&config.output)?;
    folder.check_folders(["colour", "alpha", "height", "depth", "class", "object"])?;
    let file = formats::splat_files::read(&config.splats)?;
    let unplaced = || LocalOrigin::new(UNKNOWN_FRAME, UNKNOWN_DATUM, [0.0; 3]);
    // Files of other programs lie in the frame of their cameras.
    let origin = match file.origin.clone() {
        None if config.images.is_empty() => unplaced(),
        found => {
            found.ok_or_else(|| SplatsJobError::NoOrigin { path: formats::splat_ply::origin_path(&config.splats) })?
        }
    };
    folder.remove(REPORT)?;
    if let Some(labels) = &file.labels {
        files::write_json(&config.output.join(LABELS), &labels.table, config.overwrite)?;
    }
    let pictures = config.pictures.clone().or_else(|| config.cameras.as_deref().and_then(pictures_of_dataset));
    let (taken, views) = (HashSet::new(), Vec::new());
    let session = RenderSession { config, folder: &folder, file: &file, origin, pictures, taken, views };
    let views = install(config.threads, || session.run(progress))??;
    let report = SplatRenderReport { splats: file.splats.len(), views };
    let lead = "Gaussian splats seen by the cameras of images.";
    report_page::write(&report_path, ("Rendered splats", lead), &report, Vec::new(), config.overwrite)?;
    Ok(report)
}

/// Returns the pictures of a dataset whose folder, or whose model, is given.
fn pictures_of_dataset(cameras: &Path) -> Option<PathBuf> {
    Some(dataset_folder(&sparse_folder(cameras)).join("images")).filter(|folder| folder.is_dir())
}

/// Views rendered so far.
struct RenderSession<'a> {
    config: &'a SplatRenderConfig,
    folder: &'a OutputFolder,
    file: &'a SplatFile,
    origin: LocalOrigin,
    /// Folder with the pictures of the perspective cameras.
    pictures: Option<PathBuf>,
    /// Names of the views that were written.
    taken: HashSet<String>,
    views: Vec<SplatRenderView>,
}

/// The picture that a view is compared with.
enum Reference {
    None,
    /// Values in the display range.
    Display(Grid<[f32; 3]>),
    /// Values in units of the image, to be brought to the display range.
    OwnUnits(Grid<[f32; 3]>),
}

impl RenderSession<'_> {
    fn run(mut self, progress: &dyn Progress) -> Result<Vec<SplatRenderView>, SplatsJobError> {
        let placed = |folder: &PathBuf| match &self.file.origin {
            Some(origin) => placed_model::read(folder, origin),
            None => Ok(formats::colmap::read(&sparse_folder(folder))?),
        };
        let model = self.config.cameras.as_ref().map(placed).transpose()?;
        let beside = pointing_path(&self.config.splats);
        let corrections = match &self.config.corrections {
            CorrectionSource::SurfaceRun if beside.is_file() => Corrections::read(&beside)?,
            CorrectionSource::SurfaceRun => Corrections::of_run_around(&self.config.splats)?,
            source => Corrections::for_surface(&self.config.splats, source)?,
        };
        let cameras = model.as_ref().map_or(0, |model| model.views.len());
        progress.begin("views", self.config.images.len() + cameras);
        for path in &self.config.images {
            progress.check_cancelled()?;
            self.render_image(path, &corrections, progress)?;
            progress.step();
        }
        for view in model.iter().flat_map(|model| &model.views) {
            progress.check_cancelled()?;
            self.render_perspective(view, model.as_ref())?;
            progress.step();
        }
        Ok(self.views)
    }

    fn render_image(
        &mut self,
        path: &Path,
        corrections: &Corrections,
        progress: &dyn Progress,
    ) -> Result<(), SplatsJobError> {
        if self.origin.vertical != "ellipsoid" {
            return Err(SplatsJobError::NotEllipsoidal {
                vertical: self.origin.vertical.clone(),
                path: self.config.splats.clone(),
            });
        }
        let projection = MapProjection::from_definition(&self.origin.crs)?;
        let image = image::read(path, corrections, progress)?;
        let size = (image.pixels.width(), image.pixels.height());
        let camera = RpcSplatCamera::new(&image.camera, &projection, self.origin.origin, size)?
            .ok_or_else(|| SplatsJobError::NotSeen { target: "the splats", path: path.to_owned() })?;
        let name = Path::new(path.file_name().unwrap_or_default());
        let sight = camera.towards_sensor().map(|c| -c);
        let drawn = self.mixed(&self.seen(|_| sight), &camera)?;
        self.keep(name, false, &drawn, Reference::OwnUnits(image.pixels))
    }

    fn render_perspective(&mut self, view: &ColmapView, model: Option<&ColmapModel>) -> Result<(), SplatsJobError> {
        let lens = model
            .and_then(|model| model.lenses.get(view.lens))
            .ok_or_else(|| SplatsJobError::NoLens { name: view.name.clone() })?;
        let picture = self.pictures.as_deref().map(|folder| folder.join(&view.name)).filter(|p| p.is_file());
        let shrink = self.config.shrink;
        let refused = || SplatsJobError::ShrunkLens { name: view.name.clone(), model: lens.model().name() };
        let small = pinhole(view, lens, shrink);
        let reference = match picture {
            Some(path) => {
                let picture = image::read_pixels(&path)?;
                let (found, expected) = ([picture.width(), picture.height()], [lens.width(), lens.height()]);
                if found != expected {
                    return Err(SplatsJobError::PictureSize { name: view.name.clone(), found, expected });
                }
                let size = expected.map(|side| side / shrink);
                let planes = [0, 1, 2].map(|c| shrunk(size, shrink, |x, y| picture[(x, y)][c] / 255.0));
                let pixels = (0..size[0] * size[1]).map(|i| planes.each_ref().map(|plane| plane[i])).collect();
                Reference::Display(Grid::from_vec(size[0], size[1], pixels).expect("as many values as pixels"))
            }
            None => Reference::None,
        };
        let centre = view.pose.centre;
        let splats = self.seen(|splat| [0, 1, 2].map(|i| f64::from(splat.position[i]) - centre[i]));
        let is_flat = self.file.is_flat();
        let drawn = match (is_flat, small) {
            (true, Some(camera)) => flat(&splats, self.labels(), &camera),
            (_, None) if shrink > 1 => return Err(refused()),
            (_, None) => self.mixed(&splats, &LensSplatCamera { lens, pose: &view.pose })?,
            (false, Some(PinholeView { focal_px: [fx, fy], principal_px: [cx, cy], size: [width, height], .. })) => {
                let lens = Lens::new(width, height, LensModel::Pinhole, &[fx, fy, cx, cy]).map_err(|_| refused())?;
                self.mixed(&splats, &LensSplatCamera { lens: &lens, pose: &view.pose })?
            }
        };
        self.keep(Path::new(&view.name), true, &drawn, reference)
    }

    /// Returns the labels of the splats, where they have some.
    fn labels(&self) -> Option<&[SplatLabel]> {
        self.file.labels.as_ref().map(|labels| labels.of.as_slice())
    }

    /// Draws splats that are mixed where they lie on one surface.
    fn mixed(&self, splats: &[Splat], camera: &impl SplatCamera) -> Result<Drawn, CrsError> {
        let labels = self.labels().map(|labels| render_labels(splats, labels, camera)).transpose()?;
        Ok(Drawn { rendering: ::splats::render(splats, camera)?, labels })
    }

    /// Returns the splats with the colours that their harmonics have along a direction.
    fn seen(&self, direction: impl Fn(&Splat) -> [f64; 3]) -> Cow<'_, [Splat]> {
        let SplatFile { splats, harmonics, .. } = self.file;
        let Some(harmonics) = harmonics else { return Cow::Borrowed(splats) };
        let coloured = |(number, splat): (usize, &Splat)| Splat {
            colour: harmonics.colour(number, splat.colour, direction(splat)),
            ..*splat
        };
        Cow::Owned(splats.iter().enumerate().map(coloured).collect())
    }

    /// Writes and compares one view.
    fn keep(
        &mut self,
        name: &Path,
        with_depth: bool,
        drawn: &Drawn,
        reference: Reference,
    ) -> Result<(), SplatsJobError> {
        let rendering = &drawn.rendering;
        let name = files::flat_stem(name);
        if !self.taken.insert(name.clone()) {
            return Err(SplatsJobError::SameName { name });
        }
        self.write(&name, with_depth, rendering)?;
        if let Some(labels) = &drawn.labels {
            self.write_labels(&name, labels)?;
        }
        let size = [rendering.colour.width(), rendering.colour.height()];
        let covered = rendering.coverage.map(|c| *c > COVERED);
        let all = rendering.coverage.map(|_| true);
        let picture = reference.against(&name, rendering, &covered)?;
        let pixels = rendering.coverage.data().len().max(1) as f64;
        self.views.push(SplatRenderView {
            name,
            size,
            coverage: rendering.coverage.data().iter().map(|c| f64::from(*c)).sum::<f64>() / pixels,
            psnr_db: picture.as_ref().and_then(|picture| psnr_db(&rendering.colour, picture, &covered)),
            psnr_whole_db: picture.as_ref().and_then(|picture| psnr_db(&rendering.colour, picture, &all)),
            ssim: picture.as_ref().and_then(|picture| ssim(&rendering.colour, picture, &covered)),
        });
        Ok(())
    }

    fn write(&self, name: &str, with_depth: bool, rendering: &Rendering) -> Result<(), FileError> {
        let path = |kind: &str, ending: &str| {
            let folder = self.folder.subfolder(kind)?;
            Ok::<_, FileError>(folder.join(format!("{name}.{ending}")))
        };
        let byte = |share: f32| (255.0 * share.clamp(0.0, 1.0)).round() as u8;
        let (overwrite, heights) = (self.config.overwrite, &rendering.median_height_m);
        write_png_rgb(path("colour", "png")?, &rendering.colour.map(|p| p.map(byte)), overwrite)?;
        write_png_gray(path("alpha", "png")?, &rendering.coverage.map(|c| byte(*c)), overwrite)?;
        let absolute = heights.map(|&h| (f64::from(h) + self.origin.origin[2]) as f32);
        let shape = [heights.height(), heights.width()];
        npy::write(path("height", "npy")?, &shape, absolute.data(), overwrite).map_err(FileError::write)?;
        if with_depth {
            let depths = rendering.median_depth_m.data();
            npy::write(path("depth", "npy")?, &shape, depths, overwrite).map_err(FileError::write)?;
        }
        Ok(())
    }

    fn write_labels(&self, name: &str, labels: &Grid<SplatLabel>) -> Result<(), FileError> {
        let path = |kind: &str| Ok::<_, FileError>(self.folder.subfolder(kind)?.join(format!("{name}.npy")));
        let (overwrite, shape) = (self.config.overwrite, [labels.height(), labels.width()]);
        let (class, object) = (labels.map(|label| label.class), labels.map(|label| label.object));
        npy::write(path("class")?, &shape, class.data(), overwrite).map_err(FileError::write)?;
        npy::write(path("object")?, &shape, object.data(), overwrite).map_err(FileError::write)
    }
}

/// What a camera sees, with the labels of the pixels where splats have some.
struct Drawn {
    rendering: Rendering,
    labels: Option<Grid<SplatLabel>>,
}

impl Reference {
    /// Returns the picture in the display range of a rendering of the same size.
    fn against(
        self,
        name: &str,
        rendering: &Rendering,
        covered: &Grid<bool>,
    ) -> Result<Option<Grid<[f32; 3]>>, SplatsJobError> {
        let size = |grid: &Grid<[f32; 3]>| [grid.width(), grid.height()];
        let (picture, own_units) = match self {
            Self::None => return Ok(None),
            Self::Display(picture) => (picture, false),
            Self::OwnUnits(picture) => (picture, true),
        };
        let (found, expected) = (size(&picture), size(&rendering.colour));
        if found != expected {
            return Err(SplatsJobError::PictureSize { name: name.to_owned(), found, expected });
        }
        Ok(Some(if own_units { fitted(&picture, &rendering.colour, covered) } else { picture }))
    }
}

/// Draws flat splats as trainings and meshes do: the rule of 2DGS. Depths are means by weight
/// there.
fn flat(splats: &[Splat], labels: Option<&[SplatLabel]>, camera: &PinholeView) -> Drawn {
    let surfels: Vec<Surfel> = splats.iter().map(Surfel::of_splat).collect();
    let drawing = Drawing::new(&surfels, camera, Registers::Longest);
    let (images, [width, height]) = (drawing.images(), camera.size);
    let depth = |pixel: usize, least: f32| {
        let coverage = images.coverage[pixel];
        if coverage > least { images.depth_m[pixel] / coverage } else { f32::NAN }
    };
    let local_height = |pixel: usize, depth: f32| {
        let place = [(pixel % width) as f64, (pixel / width) as f64];
        camera.point(place, f64::from(depth)).map_or(f32::NAN, |point| point[2] as f32)
    };
    let grid = |value: &dyn Fn(usize) -> f32| {
        Grid::from_vec(width, height, (0..width * height).map(value).collect()).expect("as many values as pixels")
    };
    let labels =
        labels.map(|labels| Grid::from_vec(width, height, drawing.labels(labels)).expect("as many labels as pixels"));
    let colours = (0..width * height).map(|pixel| images.colour.each_ref().map(|plane| plane[pixel])).collect();
    let rendering = Rendering {
        colour: Grid::from_vec(width, height, colours).expect("as many values as pixels"),
        coverage: grid(&|pixel| images.coverage[pixel]),
        mean_height_m: grid(&|pixel| local_height(pixel, depth(pixel, 0.0))),
        median_height_m: grid(&|pixel| local_height(pixel, depth(pixel, COVERED))),
        median_depth_m: grid(&|pixel| depth(pixel, COVERED)),
    };
    Drawn { rendering, labels }
}

/// Applies to each channel of a picture the gain and offset that bring it closest to a rendering
/// (least squares).
fn fitted(picture: &Grid<[f32; 3]>, rendered: &Grid<[f32; 3]>, counts: &Grid<bool>) -> Grid<[f32; 3]> {
    let lines = [0, 1, 2].map(|channel| {
        let pairs = picture.data().iter().zip(rendered.data()).zip(counts.data()).filter(|(_, counts)| **counts);
        let pairs = pairs.map(|((p, r), _)| (f64::from(p[channel]), f64::from(r[channel])));
        let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (p, r) in pairs.filter(|(p, _)| p.is_finite()) {
            (n, x, y, xx, xy) = (n + 1.0, x + p, y + r, xx + p * p, xy + p * r);
        }
        let variance = n * xx - x * x;
        let gain = if variance > 0.0 { (n * xy - x * y) / variance } else { 0.0 };
        (gain, if n > 0.0 { (y - gain * x) / n } else { 0.0 })
    });
    picture.map(|p| [0, 1, 2].map(|i| (lines[i].0 * f64::from(p[i]) + lines[i].1) as f32))
}
