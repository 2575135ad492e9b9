//! `skysweep splats`: Gaussian splats of a surface model and its images, as the PLY that 3DGS viewers and trainers read.
//! `skysweep splats render` looks at them again, through images and perspective cameras.

mod render;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use camera::RpcCamera;
use crs::VerticalDatum;
use io::raster::{ImageSource, read_dem, write_png_rgb};
use io::splat_ply::{LocalOrigin, SplatForm, SplatLayout};
use raster::Grid;
use serde_json::Value;
use splats::{ColourFit, DivisionConfig, RpcSplatCamera, SplatConfig, SplatReport, SplatView, Surface, make_splats};

use crate::progress::Log;
use crate::{Global, Outcome, print};
use jobs::corrections::Corrections;
use jobs::map_surface;

/// Arguments of `skysweep splats`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Example: skysweep splats out/dsm/dsm.tif view_*.tif -o splats.ply. The report says how many splats \
                        there are, how far their heights are from the surface, and how well they render back into each image."
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    make: MakeArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Render splats through images with RPCs and through perspective cameras.
    Render(render::Args),
}

/// What splats are made of, and how.
#[derive(Debug, clap::Args)]
struct MakeArgs {
    /// The surface model, in a projected CRS in metres.
    #[arg(required = true, value_name = "DSM")]
    dsm: Option<PathBuf>,
    /// Images with RPCs that give the colours.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// File to write; its origin goes beside it as OUT.origin.json.
    #[arg(short, long, required = true, value_name = "OUT.ply")]
    output: Option<PathBuf>,
    /// Largest distance of a height from its splat's plane, metres.
    #[arg(long, value_name = "METRES", default_value_t = DivisionConfig::default().error_m)]
    error: f64,
    /// Largest standard deviation of the colours under one splat, in parts of the display range (inf: geometry alone).
    #[arg(long, value_name = "SHARE", default_value_t = DivisionConfig::default().colour_error)]
    colour_error: f64,
    /// Squares of N cells instead of splats as large as the bounds allow.
    #[arg(long, value_name = "N")]
    uniform: Option<usize>,
    /// Confidence of the cells, 0 to 1, on the grid of the DSM; it becomes opacity [default: full].
    #[arg(long, value_name = "FILE")]
    confidence: Option<PathBuf>,
    /// Corrections of the images' pointing: the report of a run of skysweep dsm, or none [default: those of the run that made the
    /// surface model, for the images that it used].
    #[arg(long, value_name = "report.json|none")]
    corrections: Option<PathBuf>,
    /// What the DSM's heights are above, where the file does not say: ellipsoid, egm96, egm2008 or an EPSG code.
    #[arg(long, value_name = "DATUM")]
    vertical: Option<VerticalDatum>,
    /// Three scales per splat (3DGS) or two (2DGS).
    #[arg(long, value_enum, default_value_t = Form::ThreeD)]
    form: Form,
    /// Degree of the harmonics in the file, 0 to 3; the loaders of the original 3DGS and 2DGS code want 3.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=3))]
    sh_degree: u8,
    /// Also measure uniform splats of several sizes, and how many of them the same error takes.
    #[arg(long)]
    compare: bool,
    /// Write the report to this file (JSON).
    #[arg(long, value_name = "REPORT.json")]
    report: Option<PathBuf>,
    /// Write the splats as each image sees them to this folder (IMAGE.png, in the display range).
    #[arg(long, value_name = "DIR")]
    render: Option<PathBuf>,
    /// Replace files that exist.
    #[arg(long)]
    overwrite: bool,
    /// Print the report as JSON instead of text.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Form {
    #[value(name = "3d")]
    ThreeD,
    #[value(name = "2d")]
    TwoD,
}

/// An image that has been read.
struct Image {
    camera: RpcCamera,
    pixels: Grid<[f32; 3]>,
}

/// Runs `skysweep splats`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    match (&args.command, &args.make.dsm, &args.make.output) {
        (Some(Command::Render(args)), ..) => render::run(args, global),
        (None, Some(dsm), Some(output)) => make(&args.make, dsm, output, global),
        _ => bail!("expected DSM, IMAGE and -o OUT.ply"),
    }
}

fn make(args: &MakeArgs, dsm: &Path, output: &Path, global: Global) -> anyhow::Result<Outcome> {
    for path in [Some(output), args.report.as_deref()].into_iter().flatten() {
        ensure!(
            args.overwrite || !path.exists(),
            "the output exists: give --overwrite to replace it: {}",
            path.display()
        );
    }
    let read = map_surface::read(dsm, args.vertical, &Log)?;
    let dem = &read.dem;
    let origin = Surface::middle(&dem.heights, dem.geotransform)
        .with_context(|| format!("the surface model has no height: {}", dsm.display()))?;
    let surface = Surface::new(&dem.heights, dem.geotransform, origin);
    let confidence = args.confidence.as_deref().map(confidence).transpose()?;
    let corrections = Corrections::for_surface(dsm, &crate::corrections_of(args.corrections.as_deref()))?;
    let images = args.images.iter().map(|path| image(path, &corrections)).collect::<anyhow::Result<Vec<_>>>()?;
    let mut views = Vec::with_capacity(images.len());
    for (path, image) in args.images.iter().zip(&images) {
        let size = (image.pixels.width(), image.pixels.height());
        let camera = RpcSplatCamera::new(&image.camera, &read.projection, origin, size)?
            .with_context(|| format!("the image does not see the surface model: {}", path.display()))?;
        views.push(SplatView { camera, image: &image.pixels });
    }
    let config = SplatConfig {
        division: DivisionConfig { error_m: args.error, colour_error: args.colour_error, ..DivisionConfig::default() },
        colour: ColourFit::default(),
        uniform_side: args.uniform,
        compare: args.compare,
        ..SplatConfig::default()
    };
    let scene = make_splats(&surface, confidence.as_ref(), &views, &config)?;
    let layout = SplatLayout {
        form: if args.form == Form::TwoD { SplatForm::Discs } else { SplatForm::Ellipsoids },
        sh_degree: args.sh_degree,
    };
    let local = LocalOrigin::new(read.projection.definition(), "ellipsoid", origin);
    io::splat_ply::write(output, &scene.splats, &local, layout, args.overwrite)?;
    write_renderings(args, &scene.renderings)?;
    tell(args, output, global, &scene.report)?;
    Ok(Outcome::Complete)
}

fn write_renderings(args: &MakeArgs, renderings: &[Grid<[f32; 3]>]) -> anyhow::Result<()> {
    let Some(folder) = &args.render else { return Ok(()) };
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder: {}", folder.display()))?;
    for (path, rendering) in args.images.iter().zip(renderings) {
        let name = path.file_stem().unwrap_or_default();
        let picture = rendering.map(|p| p.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8));
        write_png_rgb(folder.join(name).with_extension("png"), &picture, args.overwrite)?;
    }
    Ok(())
}

fn confidence(path: &Path) -> anyhow::Result<Grid<f32>> {
    Ok(read_dem(path).context("the confidence")?.heights)
}

fn image(path: &Path, corrections: &Corrections) -> anyhow::Result<Image> {
    let rpc = io::rpc::read_for_image(path)?;
    let source = ImageSource::open(path)?;
    let pixels = source.read_colour(source.window())?;
    let correction = corrections.for_image(path, &Log);
    Ok(Image { camera: RpcCamera { rpc: rpc.rpc, correction }, pixels })
}

fn tell(args: &MakeArgs, output: &Path, global: Global, report: &SplatReport) -> anyhow::Result<()> {
    let images = args.images.iter().zip(&report.views).map(|(path, view)| {
        let mut value = serde_json::to_value(view)?;
        value["image"] = path.display().to_string().into();
        Ok(value)
    });
    let images: Vec<Value> = images.collect::<anyhow::Result<_>>()?;
    let mut value = serde_json::to_value(report)?;
    value["views"] = images.into();
    value["output"] = output.display().to_string().into();
    value["error_bound_m"] = args.error.into();
    value["colour_bound"] = serde_json::to_value(args.colour_error)?;
    if let Some(path) = &args.report {
        let text = serde_json::to_string_pretty(&value)? + "\n";
        io::write_bytes(path, text.as_bytes(), args.overwrite)?;
    }
    if args.json {
        print::json(&value)?;
    } else if !global.is_quiet() {
        print::text(&summary(args, output, report))?;
    }
    Ok(())
}

fn summary(args: &MakeArgs, output: &Path, report: &SplatReport) -> String {
    let share = 100.0 * report.splats as f64 / report.cells.max(1) as f64;
    let mut text = format!(
        "splats     {} for {} cells ({share:.1} %)\nplanes     within {:.3} m\n",
        report.splats, report.cells, report.plane_error_max_m
    );
    if let Some(heights) = report.mean_height {
        text += &format!(
            "heights    RMSE {:.3} m, MAE {:.3} m, median {:.3} m\n",
            heights.rmse_m, heights.mae_m, heights.median_m
        );
    }
    for (path, view) in args.images.iter().zip(&report.views) {
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
        text += &format!(
            "image      PSNR {} dB, SSIM {}, {:.1} % covered, sees {:.1} % of the cells: {}\n",
            number(view.psnr_db),
            number(view.ssim),
            100.0 * view.coverage,
            100.0 * view.seen,
            path.display()
        );
    }
    for point in &report.uniform {
        text += &format!("uniform    {} splats of {} cells: RMSE {:.3} m\n", point.splats, point.side, point.rmse_m);
    }
    if let Some(count) = report.uniform_at_equal_rmse {
        text +=
            &format!("equal RMSE takes {count:.0} uniform splats, {:.1} times as many\n", count / report.splats as f64);
    }
    text + &format!("written    {}\n", output.display())
}
