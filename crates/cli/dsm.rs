//! `skysweep dsm`: satellite images with RPCs in, a georeferenced DSM out.

use std::path::PathBuf;

use crs::{CrsRequest, VerticalDatum};
use jobs::dsm::{
    DsmConfig, DsmError, DsmReport, DsmSetting, Fill, HeightRange, ImagePair, MapBounds, Preset, SweepError,
};

use crate::error::{OVERWRITE, with_hint};
use crate::progress::ShowOptions;
use crate::{Global, Outcome};

/// Make a surface model from two or more satellite images with RPCs.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "With no option but the images and -o, everything is chosen from the scene, and each choice is \
                        printed with its reason. Example: skysweep dsm left.tif right.tif -o out"
)]
pub(crate) struct Args {
    /// The images, two or more: anything GDAL reads, with its RPC inside or beside it.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Folder for the results.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Cell size of the DSM in metres [default: the coarsest image's].
    #[arg(long, value_name = "METRES")]
    gsd: Option<f64>,
    /// CRS of the DSM: auto, or a projected EPSG code [default: the scene's UTM zone].
    #[arg(long, value_name = "CRS", default_value = "auto", hide_default_value = true)]
    crs: CrsRequest,
    /// Use the CRS although the scene lies far outside its area of use.
    #[arg(long)]
    force: bool,
    /// Area of the DSM in its CRS [default: the ground that at least two images see].
    #[arg(long, num_args = 4, value_names = ["X_MIN", "Y_MIN", "X_MAX", "Y_MAX"], allow_negative_numbers = true)]
    bounds: Option<Vec<f64>>,
    /// Heights to search, metres above the ellipsoid [default: from tie points].
    #[arg(long, num_args = 2, value_names = ["LO", "HI"], allow_negative_numbers = true, conflicts_with = "dem")]
    height_range: Option<Vec<f64>>,
    /// Coarse elevation model from which the heights to search are taken.
    #[arg(long, value_name = "FILE")]
    dem: Option<PathBuf>,
    /// City model (CityJSON, CityGML) whose roofs are expected: they are searched and favoured, but
    /// the images decide.
    #[arg(long, value_name = "MODEL")]
    prior: Option<PathBuf>,
    /// What the heights of the DSM are measured from: ellipsoid, egm96, egm2008 or an EPSG code.
    #[arg(long, value_name = "DATUM")]
    vertical: Option<VerticalDatum>,
    /// Speed against accuracy.
    #[arg(long, value_enum, default_value_t = PresetName::Balanced)]
    preset: PresetName,
    /// Voids to close from the heights around them, marked in filled.tif: none, justified (narrow
    /// voids, voids behind buildings, voids between known heights where the images have texture) or
    /// all within reach of known heights.
    #[arg(long, value_enum, default_value_t = FillName::Justified)]
    fill: FillName,
    /// Pairs of images to match, by position: 1-2,1-3 [default: all that are useful].
    #[arg(long, value_name = "I-J,…", value_delimiter = ',', value_parser = parse_pair)]
    pairs: Option<Vec<ImagePair>>,
    /// Images to compute heights for, by position: 1,3 [default: all].
    #[arg(long, value_name = "I,…", value_delimiter = ',', value_parser = parse_position)]
    reference: Option<Vec<usize>>,
    /// Use the RPCs as they are, without a correction of their pointing.
    #[arg(long)]
    no_pointing: bool,
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Memory limit, megabytes; a scene that takes more is computed by chunks [default: 4000].
    #[arg(long, value_name = "MB")]
    memory: Option<u64>,
    /// Side of the chunks of a large scene, cells [default: as large as the memory allows].
    #[arg(long, value_name = "CELLS")]
    chunk: Option<usize>,
    /// Side of the tiles that are fused at a time, cells; it changes the memory needed, never the
    /// result.
    #[arg(long, value_name = "CELLS", default_value_t = 1024)]
    tile: usize,
    /// Replace existing results.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    show: ShowOptions,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum PresetName {
    Fast,
    Balanced,
    Accurate,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum FillName {
    None,
    Justified,
    All,
}

/// Parses `2-3` into the pair (1, 2): people count positions from 1.
fn parse_pair(text: &str) -> Result<ImagePair, String> {
    let (i, j) = text.split_once('-').ok_or_else(|| format!("expected two positions like 1-2, found {text:?}"))?;
    let pair = ImagePair::new(parse_position(i)?, parse_position(j)?);
    if pair.first == pair.second {
        return Err(format!("a pair needs two different images, found {text:?}"));
    }
    Ok(pair)
}

/// Parses a position, which people count from 1, into one counted from 0.
fn parse_position(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(n) if n > 0 => Ok(n - 1),
        _ => Err(format!("expected the position of an image, counted from 1, found {text:?}")),
    }
}

impl Args {
    fn config(&self) -> DsmConfig {
        let (crs_epsg, datum) = match self.crs {
            CrsRequest::Auto => (None, None),
            CrsRequest::Epsg { horizontal, vertical } => (Some(horizontal), vertical),
        };
        let range = |v: &Vec<f64>| Some(HeightRange::new(*v.first()?, *v.get(1)?));
        let bounds = |b: &Vec<f64>| <[f64; 4]>::try_from(b.as_slice()).ok().map(MapBounds::from);
        let mut config = DsmConfig::new(self.images.clone(), self.output.clone());
        config.gsd_m = self.gsd;
        config.crs_epsg = crs_epsg;
        config.force_crs = self.force;
        config.bounds = self.bounds.as_ref().and_then(bounds);
        config.height_range_m = self.height_range.as_ref().and_then(range);
        config.dem = self.dem.clone();
        config.prior = self.prior.clone();
        config.vertical = self.vertical.or(datum).unwrap_or_default();
        config.preset = match self.preset {
            PresetName::Fast => Preset::Fast,
            PresetName::Balanced => Preset::Balanced,
            PresetName::Accurate => Preset::Accurate,
        };
        config.fill = match self.fill {
            FillName::None => Fill::None,
            FillName::Justified => Fill::Justified,
            FillName::All => Fill::All,
        };
        config.pairs = self.pairs.clone();
        config.references = self.reference.clone();
        config.pointing = !self.no_pointing;
        config.threads = self.threads;
        config.memory_mb = self.memory;
        config.chunk = self.chunk;
        config.tile = self.tile;
        config.overwrite = self.overwrite;
        config
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let report =
        args.show.watch(global, &args.output, |watcher| jobs::dsm::run(&args.config(), watcher)).map_err(|error| {
            let hint = hint(&error);
            with_hint(error, hint)
        })?;
    args.show.print(global, &report, || summary(args, &report))?;
    let failed = report.chunks.as_ref().map_or(0, |chunks| chunks.failed.len());
    let what = || format!("chunks that could not be computed, whose cells are void: {failed}; the report names them");
    Ok(if failed == 0 { Outcome::Complete } else { Outcome::Partial(what()) })
}

/// Returns the options that help against an error.
fn hint(error: &DsmError) -> Option<&'static str> {
    Some(match error {
        DsmError::Exists { .. } => OVERWRITE,
        DsmError::NoTies { .. } => "--height-range LO HI gives the heights to search, and --dem takes them from a file",
        DsmError::RangeMissesScene { .. } => "without --height-range the heights are found from tie points",
        DsmError::Memory { .. } => "--memory MB raises the limit, and --bounds makes the area smaller",
        DsmError::BoundsMissScene { .. } => "without --bounds the DSM covers all the ground that two images see",
        DsmError::Prior { .. } => "`skysweep city info MODEL` checks a city model",
        DsmError::Value { setting, .. } => match setting {
            DsmSetting::CellSize => "the cell size is set by --gsd",
            DsmSetting::Crs => "the CRS is set by --crs; --force uses it outside its area of use",
            DsmSetting::Bounds => "the grid is set by --bounds and --gsd",
            DsmSetting::HeightRange => "the heights are set by --height-range",
            DsmSetting::Dem => "the elevation model is set by --dem",
            DsmSetting::Pairs => "the pairs are set by --pairs",
            DsmSetting::References => "the images to compute heights for are set by --reference",
            DsmSetting::Threads => "the number of threads is set by --threads",
            DsmSetting::ChunkSide => "the chunks are set by --chunk",
            DsmSetting::TileSide => "the tiles are set by --tile",
            _ => return None,
        },
        DsmError::Sweep(SweepError::TooManyHypotheses { .. } | SweepError::HeightsTooFar { .. }) => {
            "--height-range LO HI gives the heights to search"
        }
        _ => return None,
    })
}

fn summary(args: &Args, report: &DsmReport) -> String {
    let s = &report.surface;
    let share = |n: usize| 100.0 * n as f64 / s.cells.max(1) as f64;
    let seconds: f64 = report.stages.iter().map(|t| t.seconds).sum();
    format!(
        "DSM        {}\n\
         cells      {} ({:.1} % observed, {:.1} % filled, {:.1} % void)\n\
         picture    {}\n\
         report     {}\n\
         time       {seconds:.1} s\n",
        args.output.join("dsm/dsm.tif").display(),
        s.cells,
        share(s.observed),
        share(s.filled),
        share(s.void),
        args.output.join("dsm/relief.png").display(),
        args.output.join("report/report.json").display(),
    )
}
