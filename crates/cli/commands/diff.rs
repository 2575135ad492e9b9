//! `skysweep diff`: what changed between two surface models.

use std::path::PathBuf;

use change::ChangeConfig;
use crs::VerticalDatum;
use eval::AlignmentMethod;
use jobs::diff::DiffConfig;

use crate::error::hinted;
use crate::options::named;
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep diff`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Surface model of the first date, or the folder of a run of skysweep dsm. The results lie on
    /// its grid.
    before: PathBuf,
    /// Surface model of the second date, on any grid.
    after: PathBuf,
    /// Folder for change.tif, significance.tif, regions.tif, changes.geojson and diff.json.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// What is removed before the comparison; none for surfaces that are aligned already.
    #[arg(long, value_parser = named(&AlignmentMethod::CHOICES), default_value = "xyz")]
    align: AlignmentMethod,
    /// Radius of the horizontal search of --align xyz and nuth-kaab, in metres.
    #[arg(long, value_name = "METRES", default_value_t = 5.0)]
    search_m: f64,
    /// Side of blocks that are moved on their own after that, in metres: against jitter and drifts.
    #[arg(long, value_name = "METRES")]
    align_blocks: Option<f64>,
    /// Standard deviation of the heights of a surface without sigma.tif beside it, in metres.
    #[arg(long, value_name = "METRES")]
    sigma_m: Option<f64>,
    /// Probability that no region is invented.
    #[arg(long, value_name = "P", default_value_t = ChangeConfig::default().confidence)]
    confidence: f64,
    /// Smallest mean change of a region, in metres.
    #[arg(long, value_name = "METRES", default_value_t = ChangeConfig::default().least_change_m)]
    least_change_m: f64,
    /// Smallest area of a region, in m².
    #[arg(long, value_name = "M2", default_value_t = ChangeConfig::default().least_area_m2)]
    least_area_m2: f64,
    /// Distance by which walls may differ without a change, in metres.
    #[arg(long, value_name = "METRES", default_value_t = ChangeConfig::default().position_m)]
    position_m: f64,
    /// Distance by which walls reach too far outwards, in metres, taken off the volumes [default:
    /// 1 % of the wall's height for surfaces of skysweep dsm, else 0].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    overreach_m: Option<f64>,
    /// Let filled cells count as observed.
    #[arg(long)]
    use_filled: bool,
    /// Polygons (GeoPackage or GeoJSON) whose volumes are wanted; written to areas.geojson.
    #[arg(long, value_name = "FILE")]
    areas: Option<PathBuf>,
    /// Layer of a GeoPackage with several.
    #[arg(long, value_name = "NAME", requires = "areas")]
    areas_layer: Option<String>,
    /// Field of the polygons that holds their names.
    #[arg(long, value_name = "NAME", requires = "areas")]
    areas_field: Option<String>,
    /// Vertical datum of the first surface, if the file names none or a wrong one: ellipsoid,
    /// egm96, egm2008 or EPSG:n.
    #[arg(long, value_name = "DATUM")]
    before_vertical: Option<VerticalDatum>,
    /// Vertical datum of the second surface, likewise.
    #[arg(long, value_name = "DATUM")]
    after_vertical: Option<VerticalDatum>,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep diff`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = DiffConfig::new(args.before.clone(), args.after.clone(), args.output.clone());
    (config.alignment, config.search_m, config.sigma_m) = (args.align, args.search_m, args.sigma_m);
    config.block_m = args.align_blocks;
    config.change.confidence = args.confidence;
    config.change.least_change_m = args.least_change_m;
    config.change.least_area_m2 = args.least_area_m2;
    config.change.position_m = args.position_m;
    config.overreach_m = args.overreach_m;
    config.use_filled = args.use_filled;
    config.areas.clone_from(&args.areas);
    config.areas_layer.clone_from(&args.areas_layer);
    config.areas_field.clone_from(&args.areas_field);
    (config.before_vertical, config.after_vertical) = (args.before_vertical, args.after_vertical);
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::diff::run(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
