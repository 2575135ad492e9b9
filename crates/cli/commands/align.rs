//! `skysweep align`: a COLMAP model brought to the world by GPS positions of its images, by points
//! known in both, or by hand on a page.

use std::path::PathBuf;

use anyhow::ensure;
use colmap::align::{AlignConfig, NoiseConfig};
use crs::{CrsRequest, VerticalDatum};
use formats::colmap::ColmapEncoding;
use jobs::align::{AlignJobConfig, AlignJobReport, ManualAlignConfig};
use jobs::align_page::{AlignPage, AlignPageConfig};
use numeric::Choice;

use crate::corrections::code_of;
use crate::error::with_hint;
use crate::options::named;
use crate::progress::WriteOptions;
use crate::{Global, Outcome, print};

/// Arguments of `skysweep align`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The positions are a CSV with the columns name, lon, lat, height (GPS of the images) or x, y, z, lon, lat, \
                        height (points of the model); easting, northing instead of lon, lat with --crs. The model that is written \
                        is in metres from the origin in OUT/origin.json, along the axes of the map.\n\n\
                        With --page, the points of the model are laid over a map by hand, in the browser of this computer: \
                        skysweep align model --page run -o aligned --open"
)]
pub(crate) struct Args {
    /// Folder of a COLMAP model (text or binary).
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Known positions.
    #[arg(
        long,
        visible_alias = "gps",
        visible_alias = "pairs",
        value_name = "FILE.csv",
        required_unless_present = "page",
        conflicts_with = "page"
    )]
    positions: Option<PathBuf>,
    /// Folder to write: the model, origin.json, similarity.json, align.json.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Projected EPSG code of the world [default: the UTM zone of the positions].
    #[arg(long, value_name = "CRS")]
    crs: Option<CrsRequest>,
    /// What the heights of the positions, or of the map of --page, are above: ellipsoid, egm96,
    /// egm2008 or an EPSG code [default: as the map says, else ellipsoid].
    #[arg(long, value_name = "DATUM", alias = "vertical")]
    positions_vertical: Option<VerticalDatum>,
    /// Largest residual of an inlier, metres [default: estimated from the residuals].
    #[arg(long, value_name = "METRES")]
    threshold: Option<f64>,
    /// Do not take the tilt from the up direction of the cameras where the positions do not
    /// determine it.
    #[arg(long)]
    no_gravity: bool,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", default_value_t = AlignConfig::default().seed)]
    seed: u64,
    /// Text or binary files.
    #[arg(long, value_parser = named(&ColmapEncoding::CHOICES), default_value = "bin")]
    encoding: ColmapEncoding,
    #[command(flatten)]
    page: PageArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    /// Exit with 1 when the root mean square residual is above this, metres.
    #[arg(long, value_name = "METRES")]
    max_rmse: Option<f64>,
    #[command(flatten)]
    write: WriteOptions,
}

/// Options of the alignment by hand.
#[derive(Debug, clap::Args)]
#[group(id = "page options")]
struct PageArgs {
    /// Lay the points over a map by hand, on a page in the browser: an ortho, a satellite image
    /// on a map, a surface model or the folder of a run, and footprints to draw over it. The first
    /// raster sets the coordinate system; heights are those of the first surface model.
    #[arg(
        long,
        value_name = "RUN|FILE",
        num_args = 1..,
        conflicts_with_all = ["crs", "threshold", "noise", "max_rmse"]
    )]
    page: Vec<PathBuf>,
    /// Folder of the photographs [default: the one around the model that has them].
    #[arg(long, value_name = "DIR", requires = "page")]
    images: Option<PathBuf>,
    /// Port on 127.0.0.1 [default: a free one].
    #[arg(long, requires = "page", value_parser = clap::value_parser!(u16).range(1..))]
    port: Option<u16>,
    /// End after this time [default: with Ctrl-C].
    #[arg(long = "for", value_name = "SECONDS", requires = "page")]
    seconds: Option<f64>,
    /// Open the page in the browser.
    #[arg(long, requires = "page")]
    open: bool,
}

/// Options of the repetition under noise.
#[derive(Debug, clap::Args)]
#[group(id = "noise options")]
struct NoiseArgs {
    /// Repeat the alignment with noise and report what changes: mean and standard deviation over
    /// seeds.
    #[arg(long)]
    noise: bool,
    /// Standard deviations of the positions, metres along each axis.
    #[arg(long, value_name = "METRES", value_delimiter = ',', default_value = "1,3,5")]
    noise_translation: Vec<f64>,
    /// Standard deviations of the heading, degrees.
    #[arg(long, value_name = "DEGREES", value_delimiter = ',', default_value = "5,10,15")]
    noise_rotation: Vec<f64>,
    /// Seeds per level.
    #[arg(long, value_name = "N", default_value_t = NoiseConfig::default().seeds, value_parser = clap::value_parser!(u64).range(1..=1000))]
    noise_seeds: u64,
    /// Also write the model of every level and seed to this folder.
    #[arg(long, value_name = "DIR", requires = "noise")]
    noise_output: Option<PathBuf>,
}

/// Runs `skysweep align`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let Some(positions) = &args.positions else { return by_hand(args, global) };
    let config = config(args, positions)?;
    let report =
        args.write.show.watch(global, &args.output, |watcher| jobs::align::run(&config, watcher)).map_err(|error| {
            let hint = match error.setting() {
                Some("the threshold of the residuals") => Some("give --threshold a number of metres above 0"),
                Some("the map of the positions") => Some("give the map of the positions with --crs"),
                Some("the reference system") => Some("choose another --crs"),
                _ => None,
            };
            with_hint(error, hint)
        })?;
    args.write.show.print(global, &report, || report.text(&args.output))?;
    Ok(outcome(args, &report))
}

/// Serves the page of an alignment by hand.
fn by_hand(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut align = ManualAlignConfig::new(args.model.clone(), args.output.clone());
    align.images.clone_from(&args.page.images);
    align.vertical = args.positions_vertical;
    align.use_gravity = !args.no_gravity;
    align.encoding = args.encoding;
    align.overwrite = args.write.overwrite;
    let mut config = AlignPageConfig::new(align, args.page.page.clone());
    config.view.port = args.page.port;
    config.view.seconds = args.page.seconds;
    let show = args.write.show;
    let report = show.watch(global, &args.output, |watcher| {
        let page = AlignPage::open(&config, watcher)?;
        if show.json {
            let reason = "for this computer and this run alone".to_owned();
            watcher.choice(&Choice { name: "address".to_owned(), value: page.url(), reason });
        } else {
            // Without standard output the page still works; it may open itself.
            let _ = print::text(&format!("{}\n", page.url()));
        }
        if args.page.open {
            page.open_browser()?;
        }
        page.serve(watcher)
    });
    let report = report.map_err(|error| {
        let hint = (error.setting() == Some("the port")).then_some("leave --port out for a free one");
        with_hint(error, hint)
    })?;
    show.print(global, &report, || match &report.saved {
        Some(saved) => saved.text(&args.output),
        None => "saved      nothing\n".to_owned(),
    })?;
    Ok(match report.saved {
        Some(_) => Outcome::Complete,
        None => Outcome::Partial("the page ended, and nothing had been saved on it".to_owned()),
    })
}

fn config(args: &Args, positions: &std::path::Path) -> anyhow::Result<AlignJobConfig> {
    let mut config = AlignJobConfig::new(args.model.clone(), positions.to_owned(), args.output.clone());
    let (code, datum) = code_of(args.crs, "--crs")?;
    ensure!(datum.is_none(), "--crs takes a code without one of heights; --positions-vertical names their datum");
    config.crs_epsg = code;
    config.vertical = args.positions_vertical.unwrap_or_default();
    config.threshold_m = args.threshold;
    config.use_gravity = !args.no_gravity;
    config.seed = args.seed;
    config.encoding = args.encoding;
    config.noise = args.noise.noise.then(|| NoiseConfig {
        translation_m: args.noise.noise_translation.clone(),
        rotation_deg: args.noise.noise_rotation.clone(),
        seeds: args.noise.noise_seeds,
    });
    config.noise_output.clone_from(&args.noise.noise_output);
    config.overwrite = args.write.overwrite;
    Ok(config)
}

/// Whether a requested threshold was missed.
fn outcome(args: &Args, report: &AlignJobReport) -> Outcome {
    match args.max_rmse {
        Some(most) if report.rmse_m > most => {
            let found = report.rmse_m;
            Outcome::Partial(format!("the residuals have a root mean square of {found:.3} m, allowed are {most} m"))
        }
        _ => Outcome::Complete,
    }
}
