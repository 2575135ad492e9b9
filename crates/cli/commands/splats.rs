//! `skysweep splats`: Gaussian splats of a surface model and its images, as the PLY that 3DGS
//! viewers and trainers read. `skysweep splats render` looks at them again, through images and
//! perspective cameras, `skysweep splats convert` brings them to other formats, and
//! `skysweep splats label` carries class and object of a city model onto them.

use std::path::{Path, PathBuf};

use anyhow::bail;
use crs::VerticalDatum;
use jobs::error::JobError;
use jobs::splats::{SplatConvertConfig, SplatLabelConfig, SplatRenderConfig, SplatsConfig};
use splats::DivisionConfig;

use crate::corrections::corrections_of;
use crate::error::with_hint;
use crate::options::{Named, named};
use crate::progress::RunOptions;
use crate::{Global, Outcome};

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
    Render(RenderArgs),
    /// Bring splats to another format: PLY of 3DGS or 2DGS, SPZ, SOG, binary glTF.
    Convert(ConvertArgs),
    /// Carry class and object of a city model onto splats.
    Label(LabelArgs),
}

/// Inputs and options of new splats.
#[derive(Debug, clap::Args)]
struct MakeArgs {
    /// The surface model, in a projected CRS in metres, or the folder of a run of skysweep dsm.
    #[arg(required = true, value_name = "DSM")]
    dsm: Option<PathBuf>,
    /// Images with RPCs that give the colours.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// File to write (.ply, .spz, .sog or .glb); its origin goes beside it as OUT.origin.json.
    #[arg(short, long, required = true, value_name = "OUT.ply")]
    output: Option<PathBuf>,
    /// Largest distance of a height from its splat's plane, metres.
    #[arg(long, value_name = "METRES", default_value_t = DivisionConfig::default().error_m)]
    error: f64,
    /// Largest standard deviation of the colours under one splat, in parts of the display range
    /// (inf: geometry alone).
    #[arg(long, value_name = "SHARE", default_value_t = DivisionConfig::default().colour_error)]
    colour_error: f64,
    /// Squares of N cells instead of splats as large as the bounds allow.
    #[arg(long, value_name = "N")]
    uniform: Option<usize>,
    /// Leave out the splats on the walls between cells.
    #[arg(long)]
    no_walls: bool,
    /// Confidence of the cells, 0 to 1, on the grid of the DSM; it becomes opacity [default: full].
    #[arg(long, value_name = "FILE")]
    confidence: Option<PathBuf>,
    /// Corrections of the images' pointing: the report of a run of skysweep dsm, or none [default:
    /// the corrections of the run that made the surface model, for the images that it used].
    #[arg(long, value_name = "report.json|none")]
    corrections: Option<PathBuf>,
    /// Vertical datum of the DSM, where the file does not state it: ellipsoid, egm96, egm2008 or an
    /// EPSG code.
    #[arg(long, value_name = "DATUM", alias = "vertical")]
    dsm_vertical: Option<VerticalDatum>,
    /// Three scales per splat (3DGS) or two (2DGS).
    #[arg(long, action = clap::ArgAction::Set, value_parser = named(&FORMS), default_value = "3d")]
    form: bool,
    /// Degree of the harmonics in the file, 0 to 3; the loaders of the original 3DGS and 2DGS code
    /// want 3.
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
    #[command(flatten)]
    run: RunOptions,
}

/// Whether splats are discs.
const FORMS: [Named<bool>; 2] = [("3d", false, "three scales: ellipsoids"), ("2d", true, "two scales: discs")];

/// Arguments of `skysweep splats render`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples: skysweep splats render splats.ply view_*.tif -o seen; \
                  skysweep splats render splats.ply --cameras views/sparse/0 --pictures views/images -o seen")]
struct RenderArgs {
    /// Splats (PLY of 3DGS or 2DGS, SPZ, SOG, glTF) with their origin beside them. Without one they
    /// lie in the frame of the cameras.
    splats: PathBuf,
    /// Images with RPCs to look through.
    #[arg(value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Perspective cameras to look through: a COLMAP model on the splats' map with origin.json
    /// beside, or a dataset of skysweep priors.
    #[arg(long, value_name = "FOLDER")]
    cameras: Option<PathBuf>,
    /// Folder with the pictures of the perspective cameras; cameras without a picture are rendered
    /// and not compared [default: images of the dataset].
    #[arg(long, value_name = "FOLDER", requires = "cameras")]
    pictures: Option<PathBuf>,
    /// Pixels of a perspective camera that become one, in each direction.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "cameras")]
    shrink: usize,
    /// Corrections of the images' pointing: the report of a run of skysweep dsm, or none [default:
    /// the corrections that the splats were made with].
    #[arg(long, value_name = "report.json|none")]
    corrections: Option<PathBuf>,
    /// Folder to write.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    run: RunOptions,
}

/// Arguments of `skysweep splats convert`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples: skysweep splats convert trained/splats.ply town.sog; \
                  skysweep splats convert trained/splats.ply for_3dgs.ply --form 3d --sh-degree 3")]
struct ConvertArgs {
    /// Splats of any of the formats, recognised by their content.
    splats: PathBuf,
    /// File to write; its ending names the format: .ply, .spz, .sog or .glb. The origin goes beside
    /// it.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Three scales per splat of a PLY (3DGS) or two (2DGS) [default: as they are].
    #[arg(long, value_parser = named(&FORMS))]
    form: Option<bool>,
    /// Degree of the harmonics, 0 to 3: padded with zeros or cut; the loaders of the original 3DGS
    /// and 2DGS code want 3 [default: that of the file].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=3))]
    sh_degree: Option<u8>,
    #[command(flatten)]
    run: RunOptions,
}

/// Arguments of `skysweep splats label`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples: skysweep splats label splats.ply --city buildings.city.json -o labelled.ply; \
                  skysweep splats label trained/splats.ply --city city.gml --transform camera_from_model.json -o labelled.ply")]
struct LabelArgs {
    /// Splats of any format, with their origin beside them where they lie on a map.
    splats: PathBuf,
    /// City model: CityJSON, CityGML, OBJ or PLY.
    #[arg(long, value_name = "CITY")]
    city: PathBuf,
    /// File to write (.ply, which alone holds labels); its origin and the table of the objects go
    /// beside it as OUT.origin.json and OUT.objects.json.
    #[arg(short, long, value_name = "OUT.ply")]
    output: PathBuf,
    /// Greatest distance of a splat's mass from the surface that it takes, as the root of the mean
    /// square, metres.
    #[arg(long, value_name = "METRES", default_value_t = label_defaults().tolerance_m)]
    tolerance: f64,
    /// Similarity from the city model to the frame of the splats (JSON), where they do not lie on
    /// one map.
    #[arg(long, value_name = "FILE")]
    transform: Option<PathBuf>,
    /// Vertical datum of the city model, where its file does not state it: ellipsoid, egm96,
    /// egm2008 or an EPSG code.
    #[arg(long, value_name = "DATUM")]
    model_vertical: Option<VerticalDatum>,
    #[command(flatten)]
    run: RunOptions,
}

/// Returns labels under the default settings.
fn label_defaults() -> SplatLabelConfig {
    SplatLabelConfig::new(PathBuf::new(), PathBuf::new(), PathBuf::new())
}

/// Runs `skysweep splats`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    match (&args.command, &args.make.dsm, &args.make.output) {
        (Some(Command::Render(args)), ..) => render(args, global),
        (Some(Command::Convert(args)), ..) => convert(args, global),
        (Some(Command::Label(args)), ..) => label(args, global),
        (None, Some(dsm), Some(output)) => make(&args.make, dsm, output, global),
        _ => bail!("expected DSM, IMAGE and -o OUT.ply"),
    }
}

fn make(args: &MakeArgs, dsm: &Path, output: &Path, global: Global) -> anyhow::Result<Outcome> {
    let mut config = SplatsConfig::new(dsm.to_owned(), args.images.clone(), output.to_owned());
    config.error_m = args.error;
    config.colour_error = args.colour_error;
    config.uniform_side = args.uniform;
    config.walls = !args.no_walls;
    config.confidence.clone_from(&args.confidence);
    config.corrections = corrections_of(args.corrections.as_deref());
    config.vertical = args.dsm_vertical;
    config.discs = args.form;
    config.sh_degree = args.sh_degree;
    config.compare = args.compare;
    config.report.clone_from(&args.report);
    config.renderings.clone_from(&args.render);
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, output, |watcher| jobs::splats::make(&config, watcher)).map_err(hinted)?;
    show.print(global, &report.to_json()?, || report.text())?;
    Ok(Outcome::Complete)
}

fn render(args: &RenderArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = SplatRenderConfig::new(args.splats.clone(), args.output.clone());
    config.images.clone_from(&args.images);
    config.cameras.clone_from(&args.cameras);
    config.shrink = args.shrink;
    config.pictures.clone_from(&args.pictures);
    config.corrections = corrections_of(args.corrections.as_deref());
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let report =
        args.run.show.watch(global, &args.output, |watcher| jobs::splats::render(&config, watcher)).map_err(hinted)?;
    args.run.show.print(global, &report, || report.text(&args.output))?;
    Ok(Outcome::Complete)
}

fn convert(args: &ConvertArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = SplatConvertConfig::new(args.splats.clone(), args.output.clone());
    config.discs = args.form;
    config.sh_degree = args.sh_degree;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::splats::convert(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text(&args.output))?;
    Ok(Outcome::Complete)
}

fn label(args: &LabelArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = SplatLabelConfig::new(args.splats.clone(), args.city.clone(), args.output.clone());
    config.tolerance_m = args.tolerance;
    config.transform.clone_from(&args.transform);
    config.vertical = args.model_vertical;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::splats::label(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text(&args.output))?;
    Ok(Outcome::Complete)
}

fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the cameras") => Some("give IMAGE or --cameras FOLDER"),
        Some("the place of the splats") => Some("give --transform FILE"),
        _ => None,
    };
    with_hint(error, hint)
}
