//! `skysweep splats render`: splats as images and perspective cameras see them, and how alike that is to their pictures.
//!
//! The folder: `colour/NAME.png` (over black), `alpha/NAME.png` (accumulated opacity; with the colours a layer for `skysweep
//! groundview compose`), `height/NAME.npy` (metres above the datum of the origin where half of the light is stopped, NaN where it is
//! not) and `report.json`. Pictures are compared over the pixels that splats cover by more than half; images with RPCs after
//! a gain and an offset per channel, for their units are their own.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use camera::RpcCamera;
use crs::MapProjection;
use io::npy;
use io::raster::{ImageSource, write_png_gray, write_png_rgb};
use io::splat_ply::{LocalOrigin, SplatFile};
use raster::Grid;
use serde::Serialize;
use splats::{LensSplatCamera, Rendering, RpcSplatCamera, SplatCamera, psnr_db, render, ssim};

use crate::progress::{Log, ProgressStyle, Watcher};
use crate::{Global, Outcome, print};
use jobs::corrections::Corrections;
use jobs::placed_model;

const REPORT: &str = "report.json";
/// Least accumulated opacity of pixels that are compared.
const COVERED: f32 = 0.5;

/// Arguments of `skysweep splats render`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples: skysweep splats render splats.ply view_*.tif -o seen; \
                  skysweep splats render splats.ply --cameras views/sparse/0 --pictures views/images -o seen")]
pub(crate) struct Args {
    /// Splats (PLY of 3DGS or 2DGS) with their origin beside them.
    splats: PathBuf,
    /// Images with RPCs to look through.
    #[arg(value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Perspective cameras to look through: a COLMAP model on the splats' map, with origin.json beside.
    #[arg(long, value_name = "FOLDER")]
    cameras: Option<PathBuf>,
    /// Folder with the pictures of the perspective cameras, to compare with; those that are not there are left out.
    #[arg(long, value_name = "FOLDER", requires = "cameras")]
    pictures: Option<PathBuf>,
    /// Corrections of the images' pointing: the report of a run of skysweep dsm.
    #[arg(long, value_name = "report.json")]
    corrections: Option<PathBuf>,
    /// Folder to write.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Replace files that exist.
    #[arg(long)]
    overwrite: bool,
    /// How progress is shown on stderr.
    #[arg(long, value_enum, default_value_t = ProgressStyle::Bar)]
    progress: ProgressStyle,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// What was seen.
#[derive(Debug, Serialize)]
struct Report {
    splats: usize,
    views: Vec<ViewReport>,
}

#[derive(Debug, Serialize)]
struct ViewReport {
    name: String,
    size: (usize, usize),
    /// Mean accumulated opacity.
    coverage: f64,
    /// Against the picture, where there is one.
    psnr_db: Option<f64>,
    ssim: Option<f64>,
}

/// Runs `skysweep splats render`.
pub(super) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    ensure!(
        args.overwrite || args.output.join(REPORT).symlink_metadata().is_err(),
        "the folder holds views already: choose another or pass --overwrite: {}",
        args.output.display()
    );
    ensure!(
        !args.images.is_empty() || args.cameras.is_some(),
        "nothing to look through: give IMAGE or --cameras FOLDER"
    );
    let file = io::splat_ply::read(&args.splats)?;
    let origin = file.origin.clone().with_context(|| {
        format!("no origin beside the splats: expected {}", io::splat_ply::origin_path(&args.splats).display())
    })?;
    let watcher = Watcher::new(args.progress, global);
    let made = Run { args, file: &file, origin, taken: HashSet::new(), views: Vec::new() }.all(&watcher);
    watcher.finish();
    let report = Report { splats: file.splats.len(), views: made? };
    let json = serde_json::to_string_pretty(&report)? + "\n";
    io::write_bytes(args.output.join(REPORT), json.as_bytes(), args.overwrite)?;
    if args.json {
        print::json(&report)?;
    } else if !global.is_quiet() {
        print::text(&report.text(&args.output))?;
    }
    Ok(Outcome::Complete)
}

impl Report {
    fn text(&self, folder: &Path) -> String {
        let mut text = format!("splats     {}\n", self.splats);
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
        for view in &self.views {
            let (psnr, ssim) = (number(view.psnr_db), number(view.ssim));
            text += &format!("{:20} {:.1} % covered, PSNR {psnr} dB, SSIM {ssim}\n", view.name, 100.0 * view.coverage);
        }
        text + &format!("written    {}\n", folder.display())
    }
}

struct Run<'a> {
    args: &'a Args,
    file: &'a SplatFile,
    origin: LocalOrigin,
    /// Names of files.
    taken: HashSet<String>,
    views: Vec<ViewReport>,
}

impl Run<'_> {
    fn all(mut self, progress: &dyn numeric::Progress) -> anyhow::Result<Vec<ViewReport>> {
        let model = self.args.cameras.as_deref().map(|folder| placed_model::read(folder, &self.origin)).transpose()?;
        progress.begin("views", self.args.images.len() + model.as_ref().map_or(0, |model| model.views.len()));
        for path in &self.args.images {
            self.image(path)?;
            progress.step();
        }
        for view in model.iter().flat_map(|model| &model.views) {
            let Some(lens) = model.as_ref().and_then(|model| model.lenses.get(view.lens)) else {
                bail!("image {} of the model has no camera", view.name);
            };
            let picture = self.args.pictures.as_deref().map(|folder| folder.join(&view.name)).filter(|p| p.is_file());
            let picture = picture.as_deref().map(picture_of).transpose()?;
            self.look(Path::new(&view.name), &LensSplatCamera { lens, pose: &view.pose }, picture, false)?;
            progress.step();
        }
        Ok(self.views)
    }

    fn image(&mut self, path: &Path) -> anyhow::Result<()> {
        ensure!(
            self.origin.vertical == "ellipsoid",
            "the splats' heights are above {}, expected the ellipsoid: {}",
            self.origin.vertical,
            self.args.splats.display()
        );
        let projection = MapProjection::from_definition(&self.origin.crs)?;
        let correction = self.args.corrections.as_deref().map(Corrections::read).transpose()?;
        let correction = correction.unwrap_or_default().for_image(path, &Log);
        let camera = RpcCamera { rpc: io::rpc::read_for_image(path)?.rpc, correction };
        let source = ImageSource::open(path)?;
        let pixels = source.read_colour(source.window())?;
        let size = (pixels.width(), pixels.height());
        let camera = RpcSplatCamera::new(&camera, &projection, self.origin.origin, size)?
            .with_context(|| format!("the image does not see the splats: {}", path.display()))?;
        self.look(Path::new(path.file_name().unwrap_or_default()), &camera, Some(pixels), true)
    }

    /// Renders, writes and compares one view.
    fn look(
        &mut self,
        name: &Path,
        camera: &impl SplatCamera,
        picture: Option<Grid<[f32; 3]>>,
        own_units: bool,
    ) -> anyhow::Result<()> {
        let stem = name.with_extension("").to_string_lossy().replace(['/', '\\'], "_");
        ensure!(self.taken.insert(stem.clone()), "two views would be written as {stem}");
        let rendering = render(&self.file.splats, camera)?;
        self.write(&stem, &rendering)?;
        let size = (rendering.colour.width(), rendering.colour.height());
        let covered = rendering.coverage.map(|c| *c > COVERED);
        if let Some(found) = picture.as_ref().map(|p| (p.width(), p.height())).filter(|found| *found != size) {
            bail!("the picture of {stem} has {found:?} pixels, its camera {size:?}");
        }
        let picture = match picture {
            Some(picture) if own_units => Some(fitted(&picture, &rendering.colour, &covered)),
            picture => picture,
        };
        let pixels = rendering.coverage.data().len().max(1) as f64;
        self.views.push(ViewReport {
            name: stem,
            size,
            coverage: rendering.coverage.data().iter().map(|c| f64::from(*c)).sum::<f64>() / pixels,
            psnr_db: picture.as_ref().and_then(|picture| psnr_db(&rendering.colour, picture, &covered)),
            ssim: picture.as_ref().and_then(|picture| ssim(&rendering.colour, picture, &covered)),
        });
        Ok(())
    }

    fn write(&self, stem: &str, rendering: &Rendering) -> anyhow::Result<()> {
        let path = |kind: &str, ending: &str| -> anyhow::Result<PathBuf> {
            let folder = self.args.output.join(kind);
            std::fs::create_dir_all(&folder)
                .with_context(|| format!("cannot make the folder: {}", folder.display()))?;
            Ok(folder.join(format!("{stem}.{ending}")))
        };
        let byte = |share: f32| (255.0 * share.clamp(0.0, 1.0)).round() as u8;
        let (overwrite, heights) = (self.args.overwrite, &rendering.median_height_m);
        write_png_rgb(path("colour", "png")?, &rendering.colour.map(|p| p.map(byte)), overwrite)?;
        write_png_gray(path("alpha", "png")?, &rendering.coverage.map(|c| byte(*c)), overwrite)?;
        let absolute = heights.map(|&h| (f64::from(h) + self.origin.origin[2]) as f32);
        npy::write(path("height", "npy")?, &[heights.height(), heights.width()], absolute.data(), overwrite)?;
        Ok(())
    }
}

fn picture_of(path: &Path) -> anyhow::Result<Grid<[f32; 3]>> {
    let source = ImageSource::open(path)?;
    Ok(source.read_colour(source.window())?.map(|p| p.map(|c| c / 255.0)))
}

/// The picture with the gain and offset of each channel that bring it closest to what is rendered.
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
