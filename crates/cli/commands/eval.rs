//! `skysweep eval`: how far a surface model is from a reference.
//!
//! The files decide what is compared: height grids (the reference may be a LAS cloud), surfaces
//! (both are meshes, city models or clouds), or maps in the pixels of a camera (both are `.npy`, or
//! `--maps` names their kind).

use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};
use city::Lod;
use crs::VerticalDatum;
use eval::{AlignmentMethod, EvalConfig, SurfaceComparisonConfig};
use jobs::error::JobError;
use jobs::eval::{
    EvalKind, EvalRequirements, EvalTarget, GridEvalConfig, MapEvalConfig, MapKind, MinCompleteness, SurfaceEvalConfig,
};
use numeric::Progress;

use crate::error::with_hint;
use crate::options::named;
use crate::progress::ShowOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep eval`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Surface model to evaluate, on any grid, or the folder of a run of skysweep dsm; or a mesh,
    /// city model or cloud (OBJ, PLY, CityJSON, CityGML, LAS, LAZ) if REF is one, too; or a map of
    /// depths, normals or a mask (.npy).
    test: PathBuf,
    /// Reference of the same kind. For a grid it may also be a LAS or LAZ cloud; errors are then
    /// measured at its cells.
    #[arg(value_name = "REF")]
    reference: PathBuf,
    /// What is removed before the comparison [default: xyz for grids; surfaces and maps are
    /// compared as they are].
    #[arg(long, value_parser = named(&AlignmentMethod::CHOICES))]
    align: Option<AlignmentMethod>,
    /// Radius of the horizontal search of --align xyz and nuth-kaab, in metres.
    #[arg(long, value_name = "METRES", default_value_t = 5.0)]
    search_m: f64,
    /// Class raster on any grid (read at the nearest cell): one more column per class.
    #[arg(long, value_name = "FILE")]
    classes: Option<PathBuf>,
    /// Classes that are left out of everything, the alignment too (water is often 9).
    #[arg(long, value_name = "N", value_delimiter = ',', allow_negative_numbers = true)]
    skip: Vec<i32>,
    /// Raster on any grid: only cells where it is not zero count (read at the nearest cell).
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// Terrain model, to find what stands above it [default: from the class ground, else estimated
    /// from REF].
    #[arg(long, value_name = "FILE")]
    dtm: Option<PathBuf>,
    /// Confidence of each cell of TEST, on its grid, more is better [default: confidence.tif beside
    /// TEST]. Adds rows for the most confident 95 to 50 % of REF's cells.
    #[arg(long, value_name = "FILE")]
    confidence: Option<PathBuf>,
    /// Raster of building numbers (0 ground, −1 tree) on any grid: buildings lost, trees found.
    #[arg(long, value_name = "FILE")]
    buildings: Option<PathBuf>,
    /// Least height above the terrain of cells that count as standing, in metres.
    #[arg(long, value_name = "METRES", default_value_t = EvalConfig::default().standing_m)]
    standing_m: f64,
    /// Side of the cells into which a point cloud REF is gridded, in metres [default: TEST's].
    #[arg(long, value_name = "METRES")]
    ref_cell: Option<f64>,
    /// Thresholds in metres: of completeness_T and pag_T [default: 0.5,1,2.5,7.5], or of precision,
    /// recall and F-score of surfaces [default: 0.1,0.2,0.5,1].
    #[arg(long, value_name = "METRES", value_delimiter = ',')]
    thresholds: Vec<f64>,
    /// Vertical datum of TEST's heights, if the file names none or a wrong one: ellipsoid, egm96,
    /// egm2008 or EPSG:n.
    #[arg(long, value_name = "DATUM")]
    test_vertical: Option<VerticalDatum>,
    /// Vertical datum of REF's heights, likewise.
    #[arg(long, value_name = "DATUM")]
    ref_vertical: Option<VerticalDatum>,
    /// Folder for report.html, report.json and the error map [default: RUN/eval for a surface model
    /// RUN/dsm/dsm.tif that skysweep made, else none].
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Write the page alone to this file.
    #[arg(long, value_name = "OUT.html")]
    html: Option<PathBuf>,
    /// Write no report that was not asked for.
    #[arg(long, conflicts_with = "output")]
    no_report: bool,
    /// Write the errors (test − reference, metres) on the reference grid to this file.
    #[arg(long, value_name = "OUT.tif")]
    error_map: Option<PathBuf>,
    /// Replace files that exist, also files that no evaluation wrote.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    show: ShowOptions,
    /// The files are maps of this kind in the pixels of one camera [default: found by shape and
    /// type of .npy files].
    #[arg(long, value_parser = named(&MapKind::CHOICES), value_name = "KIND")]
    maps: Option<MapKind>,
    /// Exit with 1 if the MAE over all cells is above this, in metres; for surfaces the mean
    /// distance of TEST to REF.
    #[arg(long, value_name = "METRES")]
    max_mae: Option<f64>,
    /// Exit with 1 if the completeness over all cells is below this share (0 to 1), at 1 m unless T
    /// names another threshold.
    #[arg(long, value_name = "[T=]SHARE", value_delimiter = ',')]
    min_completeness: Vec<MinCompleteness>,
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    #[command(flatten)]
    surface: SurfaceArgs,
}

/// Options for surfaces that are not grids.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Surfaces (meshes, city models, clouds)")]
struct SurfaceArgs {
    /// Samples per square metre of a mesh, up to a million in all.
    #[arg(long, value_name = "N", default_value_t = SurfaceComparisonConfig::default().samples_per_m2)]
    samples_per_m2: f64,
    /// Seed of the samples.
    #[arg(long, value_name = "N", default_value_t = 0)]
    sample_seed: u64,
    /// D of M3C2: diameter in which normals are estimated, in metres.
    #[arg(long, value_name = "METRES", default_value_t = SurfaceComparisonConfig::default().normal_scale_m)]
    normal_scale: f64,
    /// d of M3C2: diameter of its cylinders, in metres.
    #[arg(long, value_name = "METRES", default_value_t = SurfaceComparisonConfig::default().cylinder_m)]
    cylinder: f64,
    /// Length of the cylinders on either side, in metres.
    #[arg(long, value_name = "METRES", default_value_t = SurfaceComparisonConfig::default().cylinder_reach_m)]
    cylinder_reach: f64,
    /// Registration error, part of M3C2's level of detection, in metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    registration: f64,
    /// Edge of the voxels of the volumetric overlap, in metres.
    #[arg(long, value_name = "METRES", default_value_t = SurfaceComparisonConfig::default().voxel_m)]
    voxel: f64,
    /// Level of detail of city models, such as 2.2 [default: the highest of each object up to 2.x].
    #[arg(long, value_name = "LOD")]
    lod: Option<Lod>,
    /// Use every object of a city model that has surfaces, not only buildings.
    #[arg(long)]
    all_objects: bool,
}

/// Runs `skysweep eval`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    if let Some(max_mae) = args.max_mae {
        ensure!(max_mae >= 0.0, "--max-mae is {max_mae}, expected a number of metres");
    }
    let kind = match args.maps {
        Some(_) => EvalKind::Maps,
        None => jobs::eval::detect_kind(&args.test, &args.reference),
    };
    let missed = match kind {
        EvalKind::Maps => maps(args, global)?,
        EvalKind::Surfaces => surfaces(args, global)?,
        _ => grids(args, global)?,
    };
    Ok(if missed.is_empty() { Outcome::Complete } else { Outcome::Partial(missed.join("; ")) })
}

/// Runs a comparison while its progress is shown.
fn watch<T>(args: &Args, global: Global, job: impl FnOnce(&dyn Progress) -> Result<T, JobError>) -> anyhow::Result<T> {
    args.show.watch(global, args.output.as_deref().unwrap_or(Path::new("")), job).map_err(hinted)
}

/// Refuses options that only height grids have.
fn refuse_grid_options(args: &Args, what: &str) -> anyhow::Result<()> {
    let given = [
        ("--align", args.align.is_some_and(|align| !matches!(align, AlignmentMethod::None))),
        ("--classes", args.classes.is_some()),
        ("--confidence", args.confidence.is_some()),
        ("--buildings", args.buildings.is_some()),
        ("--skip", !args.skip.is_empty()),
        ("--mask", args.mask.is_some()),
        ("--dtm", args.dtm.is_some()),
        ("--ref-cell", args.ref_cell.is_some()),
        ("--html", args.html.is_some()),
        ("--error-map", args.error_map.is_some()),
    ];
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) => bail!("{option} is for height grids, and these are {what}: leave it out"),
        None => Ok(()),
    }
}

fn requirements(args: &Args) -> EvalRequirements {
    EvalRequirements { max_mae: args.max_mae, min_completeness: args.min_completeness.clone() }
}

/// Compares height grids and returns the requirements that were missed.
fn grids(args: &Args, global: Global) -> anyhow::Result<Vec<String>> {
    let report = watch(args, global, |watcher| jobs::eval::compare_grids(&grid_config(args), watcher))?;
    let has_none = report.report_page.is_none() && report.report_failure.is_none();
    let is_news = has_none && args.html.is_none() && !args.no_report;
    let hint = if is_news { "report     none; -o DIR writes one (page, JSON, error map)\n" } else { "" };
    args.show.print(global, &report, || report.table() + report.files().as_str() + hint)?;
    Ok(report.missed().to_vec())
}

fn grid_config(args: &Args) -> GridEvalConfig {
    let mut config = GridEvalConfig::new(args.test.clone(), args.reference.clone());
    config.alignment = args.align.unwrap_or(AlignmentMethod::Xyz);
    config.search_m = args.search_m;
    if !args.thresholds.is_empty() {
        config.thresholds_m = args.thresholds.clone();
    }
    config.classes = args.classes.clone();
    config.skip = args.skip.clone();
    config.mask = args.mask.clone();
    config.terrain = args.dtm.clone();
    config.confidence = args.confidence.clone();
    config.objects = args.buildings.clone();
    config.standing_m = args.standing_m;
    config.reference_cell_m = args.ref_cell;
    config.test_vertical = args.test_vertical;
    config.reference_vertical = args.ref_vertical;
    config.target = match (&args.output, args.no_report) {
        (Some(folder), _) => EvalTarget::Folder(folder.clone()),
        (None, true) => EvalTarget::Nowhere,
        (None, false) => EvalTarget::RunFolder,
    };
    config.page = args.html.clone();
    config.error_map = args.error_map.clone();
    config.threads = args.threads;
    config.overwrite = args.overwrite;
    config.requirements = requirements(args);
    config
}

/// Compares surfaces and returns the requirements that were missed.
fn surfaces(args: &Args, global: Global) -> anyhow::Result<Vec<String>> {
    refuse_grid_options(args, "surfaces")?;
    let report = watch(args, global, |watcher| jobs::eval::evaluate_surfaces(&surface_config(args), watcher))?;
    let files = report.written.as_ref().map(|path| format!("report     {}\n", path.display())).unwrap_or_default();
    args.show.print(global, &report, || report.table() + &files)?;
    Ok(report.missed().to_vec())
}

fn surface_config(args: &Args) -> SurfaceEvalConfig {
    let given = &args.surface;
    let mut config = SurfaceEvalConfig::new(args.test.clone(), args.reference.clone());
    if !args.thresholds.is_empty() {
        config.thresholds_m = args.thresholds.clone();
    }
    config.samples_per_m2 = given.samples_per_m2;
    config.sample_seed = given.sample_seed;
    config.normal_scale_m = given.normal_scale;
    config.cylinder_m = given.cylinder;
    config.cylinder_reach_m = given.cylinder_reach;
    config.registration_m = given.registration;
    config.voxel_m = given.voxel;
    config.lod = given.lod;
    config.all_objects = given.all_objects;
    config.test_vertical = args.test_vertical;
    config.reference_vertical = args.ref_vertical;
    config.output = args.output.clone();
    config.threads = args.threads;
    config.overwrite = args.overwrite;
    config.requirements = requirements(args);
    config
}

/// Compares maps and returns the requirements that were missed.
fn maps(args: &Args, global: Global) -> anyhow::Result<Vec<String>> {
    refuse_grid_options(args, "maps")?;
    ensure!(args.output.is_none(), "maps are compared on the terminal or with --json: leave -o out");
    ensure!(args.min_completeness.is_empty(), "--min-completeness is not for maps: leave it out");
    let mut config = MapEvalConfig::new(args.test.clone(), args.reference.clone());
    config.kind = args.maps;
    config.max_mae = args.max_mae;
    config.threads = args.threads;
    let report = watch(args, global, |watcher| jobs::eval::compare_maps(&config, watcher))?;
    args.show.print(global, &report, || report.table())?;
    Ok(report.missed)
}

/// Adds the option that helps with an error.
fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the vertical datum of the test") => Some("give --test-vertical"),
        Some("the vertical datum of the reference") => Some("give --ref-vertical"),
        Some("the error map") => Some("leave --error-map out"),
        Some("the kind of the maps") => Some("name their kind with --maps"),
        Some("the classes") => Some("give --classes"),
        _ => None,
    };
    with_hint(error, hint)
}
