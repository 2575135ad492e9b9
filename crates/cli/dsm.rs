//! `skysweep dsm`: satellite images with RPCs in, a georeferenced DSM out.

use std::path::PathBuf;

use anyhow::Context;
use crs::{CrsRequest, VerticalDatum};
use jobs::dsm::{DsmConfig, DsmReport, Fill, Preset};

use crate::progress::{ProgressStyle, Watcher};
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
    /// Area of the DSM in its CRS [default: the ground that at least two images see].
    #[arg(long, num_args = 4, value_names = ["X_MIN", "Y_MIN", "X_MAX", "Y_MAX"], allow_negative_numbers = true)]
    bounds: Option<Vec<f64>>,
    /// Heights to search, metres above the ellipsoid [default: from tie points].
    #[arg(long, num_args = 2, value_names = ["LO", "HI"], allow_negative_numbers = true, conflicts_with = "dem")]
    height_range: Option<Vec<f64>>,
    /// A coarse elevation model that tells the heights to search.
    #[arg(long, value_name = "FILE")]
    dem: Option<PathBuf>,
    /// City model (CityJSON, CityGML) whose roofs are expected: searched and favoured, never believed against the images.
    #[arg(long, value_name = "MODEL")]
    prior: Option<PathBuf>,
    /// What the DSM's heights are measured from: ellipsoid, egm96, egm2008 or an EPSG code.
    #[arg(long, value_name = "DATUM")]
    vertical: Option<VerticalDatum>,
    /// Speed against accuracy.
    #[arg(long, value_enum, default_value_t = PresetName::Balanced)]
    preset: PresetName,
    /// Voids to close from their surroundings, marked in filled.tif: none, justified (narrow ones, those behind buildings, those
    /// between known heights where the images show something) or all within reach of known heights.
    #[arg(long, value_enum, default_value_t = FillName::Justified)]
    fill: FillName,
    /// Pairs of images to match, by position: 1-2,1-3 [default: all that are useful].
    #[arg(long, value_name = "I-J,…", value_delimiter = ',', value_parser = parse_pair)]
    pairs: Option<Vec<(usize, usize)>>,
    /// Images to compute heights for, by position: 1,3 [default: all].
    #[arg(long, value_name = "I,…", value_delimiter = ',', value_parser = parse_position)]
    reference: Option<Vec<usize>>,
    /// Use the RPCs as they are.
    #[arg(long)]
    no_pointing: bool,
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Memory to stay under, megabytes; a scene that takes more is computed by chunks [default: 4000].
    #[arg(long, value_name = "MB")]
    memory: Option<u64>,
    /// Side of the chunks that a scene is computed by, cells [default: as large as the memory allows].
    #[arg(long, value_name = "CELLS")]
    chunk: Option<usize>,
    /// Side of the tiles that are fused at a time, cells; it changes memory, never the result.
    #[arg(long, value_name = "CELLS", default_value_t = 1024)]
    tile: usize,
    /// Replace existing results.
    #[arg(long)]
    overwrite: bool,
    /// How progress is shown on stderr.
    #[arg(long, value_enum, default_value_t = ProgressStyle::Bar)]
    progress: ProgressStyle,
    /// Print the report as JSON on stdout.
    #[arg(long)]
    json: bool,
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

/// `2-3` → (1, 2): positions count from 1 for people.
fn parse_pair(text: &str) -> Result<(usize, usize), String> {
    let (i, j) = text.split_once('-').ok_or_else(|| format!("expected two positions like 1-2, found {text:?}"))?;
    let (i, j) = (parse_position(i)?, parse_position(j)?);
    if i == j { Err(format!("a pair needs two different images, found {text:?}")) } else { Ok((i, j)) }
}

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
        let two = |v: &Vec<f64>| Some((*v.first()?, *v.get(1)?));
        DsmConfig {
            gsd_m: self.gsd,
            crs_epsg,
            bounds: self.bounds.as_ref().and_then(|b| b.as_slice().try_into().ok()),
            height_range_m: self.height_range.as_ref().and_then(two),
            dem: self.dem.clone(),
            prior: self.prior.clone(),
            vertical: self.vertical.or(datum).unwrap_or_default(),
            preset: match self.preset {
                PresetName::Fast => Preset::Fast,
                PresetName::Balanced => Preset::Balanced,
                PresetName::Accurate => Preset::Accurate,
            },
            fill: match self.fill {
                FillName::None => Fill::None,
                FillName::Justified => Fill::Justified,
                FillName::All => Fill::All,
            },
            pairs: self.pairs.clone(),
            references: self.reference.clone(),
            pointing: !self.no_pointing,
            threads: self.threads,
            memory_mb: self.memory,
            chunk: self.chunk,
            tile: self.tile,
            overwrite: self.overwrite,
            ..DsmConfig::new(self.images.clone(), self.output.clone())
        }
    }
}

pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let watcher = Watcher::new(args.progress, global);
    let outcome = jobs::dsm::run_dsm(&args.config(), &watcher);
    watcher.finish();
    let report = outcome.context("no DSM was made")?;
    if args.json {
        crate::print::json(&report)?;
    } else if !global.is_quiet() {
        crate::print::text(&summary(args, &report))?;
    }
    let is_whole = report.chunks.as_ref().is_none_or(|c| c.failed.is_empty());
    Ok(if is_whole { Outcome::Complete } else { Outcome::Partial })
}

fn summary(args: &Args, report: &DsmReport) -> String {
    let s = &report.surface;
    let share = |n: usize| 100.0 * n as f64 / s.cells.max(1) as f64;
    let seconds: f64 = report.stages.iter().map(|t| t.seconds).sum();
    format!(
        "DSM        {}\ncells      {} ({:.1} % observed, {:.1} % filled, {:.1} % void)\npicture    {}\nreport     {}\ntime       {seconds:.1} s\n",
        args.output.join("dsm/dsm.tif").display(),
        s.cells,
        share(s.observed),
        share(s.filled),
        share(s.void),
        args.output.join("dsm/relief.png").display(),
        args.output.join("report/report.json").display(),
    )
}
