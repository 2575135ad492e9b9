//! `skysweep eval`: how far a surface model is from a reference.
//!
//! What is compared follows from the files: height grids (the reference may be a LAS cloud), surfaces (both are meshes, city models or
//! clouds), or maps in the pixels of a camera (both are `.npy`, or `--maps` says so).

mod grids;
mod inputs;
mod maps;
mod output;
mod surface_inputs;
mod surfaces;
mod vertical;

use std::path::PathBuf;

use anyhow::{bail, ensure};
use crs::VerticalDatum;
use eval::{Alignment, EvalConfig, EvalInput, Evaluation, evaluate};
use report::{EvaluationReport, Protocol};

use crate::{Global, Outcome, print};
use inputs::Inputs;
use output::Target;

/// Arguments of `skysweep eval`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The surface model that is evaluated, on any grid; a mesh, city model or cloud (OBJ, PLY, CityJSON, CityGML, LAS, LAZ) where
    /// REF is one, too; or a map of depths, normals or a mask (.npy).
    test: PathBuf,
    /// What is believed, of the same kind; a LAS or LAZ cloud may stand for a grid, errors are then measured at its cells.
    #[arg(value_name = "REF")]
    reference: PathBuf,
    /// What is removed before the comparison [default: xyz for grids; surfaces and maps are compared as they are].
    #[arg(long, value_enum)]
    align: Option<Align>,
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
    /// Terrain model, for what stands above it [default: from the class ground, else estimated from REF].
    #[arg(long, value_name = "FILE")]
    dtm: Option<PathBuf>,
    /// How far each cell of TEST is to be believed, more is better, on its grid (dsm/confidence.tif): rows for what remains when
    /// the least believed cells are dropped, 95 to 50 % of REF's cells.
    #[arg(long, value_name = "FILE")]
    confidence: Option<PathBuf>,
    /// Least height above the terrain of what stands, in metres.
    #[arg(long, value_name = "METRES", default_value_t = EvalConfig::default().standing_m)]
    standing_m: f64,
    /// Side of the cells into which a point cloud REF is laid, in metres [default: TEST's].
    #[arg(long, value_name = "METRES")]
    ref_cell: Option<f64>,
    /// Thresholds in metres: of completeness_T and pag_T [default: 0.5,1,2.5,7.5], or of precision, recall and F-score of
    /// surfaces [default: 0.1,0.2,0.5,1].
    #[arg(long, value_name = "METRES", value_delimiter = ',')]
    thresholds: Vec<f64>,
    /// What TEST's heights are above, where the file does not say or is wrong: ellipsoid, egm96, egm2008 or EPSG:n.
    #[arg(long, value_name = "DATUM")]
    test_vertical: Option<VerticalDatum>,
    /// What REF's heights are above, likewise.
    #[arg(long, value_name = "DATUM")]
    ref_vertical: Option<VerticalDatum>,
    /// Folder for report.html, report.json and the error map [default: RUN/eval for a surface model RUN/dsm/dsm.tif that
    /// skysweep made, else none].
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
    /// Replace files that exist, also those that no evaluation wrote.
    #[arg(long)]
    overwrite: bool,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    surface: surfaces::SurfaceArgs,
    /// The files are maps of this kind in the pixels of one camera [default: found by shape and type of .npy files].
    #[arg(long, value_enum, value_name = "KIND")]
    maps: Option<maps::MapKind>,
    /// Exit with 1 when the MAE over all cells is above this, in metres; of surfaces the mean distance of TEST to REF.
    #[arg(long, value_name = "METRES")]
    max_mae: Option<f64>,
    /// Exit with 1 when the completeness over all cells is below this share (0 to 1), at 1 m unless T says otherwise.
    #[arg(long, value_name = "[T=]SHARE", value_delimiter = ',')]
    min_completeness: Vec<LeastCompleteness>,
}

/// `--align`.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Align {
    /// Nothing is removed.
    None,
    /// The median of the differences.
    Z,
    /// The translation with the least NMAD, then the median of the differences.
    Xyz,
    /// The translation that slopes and aspects tell (Nuth and Kääb 2011), then the median of the differences.
    NuthKaab,
}

impl From<Align> for Alignment {
    fn from(align: Align) -> Self {
        match align {
            Align::None => Self::None,
            Align::Z => Self::Z,
            Align::Xyz => Self::Xyz,
            Align::NuthKaab => Self::NuthKaab,
        }
    }
}

/// A completeness that must be reached.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LeastCompleteness {
    threshold_m: f64,
    share: f64,
}

impl std::str::FromStr for LeastCompleteness {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (threshold, share) = text.split_once('=').unwrap_or(("1", text));
        let number = |part: &str| part.trim().parse::<f64>().map_err(|_| format!("\"{part}\" is no number"));
        let (threshold_m, share) = (number(threshold)?, number(share)?);
        if !(0.0..=1.0).contains(&share) {
            return Err(format!("{share} is no share: expected 0 to 1"));
        }
        Ok(Self { threshold_m, share })
    }
}

/// Runs `skysweep eval`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    if let Some(max_mae) = args.max_mae {
        ensure!(max_mae >= 0.0, "--max-mae is {max_mae}, expected a number of metres");
    }
    let both = |is: fn(&PathBuf) -> bool| is(&args.test) && is(&args.reference);
    let missed = if args.maps.is_some() || both(|path| io::maps::is_npy(path)) {
        maps::run(args)?
    } else if both(|path| io::surfaces::is_surface(path)) {
        surfaces::run(args, global)?
    } else {
        grids(args, global)?
    };
    missed.iter().for_each(|line| tracing::error!("{line}"));
    Ok(if missed.is_empty() { Outcome::Complete } else { Outcome::Partial })
}

/// Refuses options that only height grids have.
fn refuse_grid_options(args: &Args, what: &str) -> anyhow::Result<()> {
    let given = [
        ("--align", args.align.is_some_and(|align| !matches!(align, Align::None))),
        ("--classes", args.classes.is_some()),
        ("--confidence", args.confidence.is_some()),
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

/// Compares height grids; the requirements that were missed.
fn grids(args: &Args, global: Global) -> anyhow::Result<Vec<String>> {
    let (config, target) = (config(args), Target::of(args));
    output::check(args, target.as_ref())?;
    let inputs = Inputs::read(args, config.alignment)?;
    let input = EvalInput {
        classes: inputs.classes.as_ref().map(|(classes, _)| classes),
        mask: inputs.mask.as_ref(),
        terrain: inputs.terrain.as_ref(),
        confidence: inputs.confidence.as_ref(),
        ..EvalInput::new(
            &inputs.test.heights,
            &inputs.reference.heights,
            &inputs.test_from_reference,
            inputs.metres_from_cells,
        )
    };
    let found = evaluate(&input, &config)?;
    let protocol = protocol(args, config, &inputs, &found);
    let report = EvaluationReport { protocol: &protocol, found: &found, reference: &inputs.reference.heights };
    let written = output::write(args, target.as_ref(), &inputs, &report)?;
    if args.json {
        print::json(&report.json())?;
    } else {
        print::text(&report.table())?;
        if !global.is_quiet() {
            print::text(&(written.join("\n") + "\n"))?;
        }
    }
    Ok(protocol.missed)
}

/// What the numbers mean, from arguments and inputs.
fn protocol(args: &Args, config: EvalConfig, inputs: &Inputs, found: &Evaluation) -> Protocol {
    let reference = &inputs.reference;
    let crs = match (reference.horizontal_epsg, &reference.crs_wkt) {
        (Some(code), _) => format!("EPSG:{code}"),
        (None, Some(_)) => "a coordinate system without an EPSG code".into(),
        (None, None) => "no coordinate system".into(),
    };
    let name = |path: &PathBuf| path.display().to_string();
    Protocol {
        test: name(&args.test),
        reference: name(&args.reference),
        size: (reference.heights.width(), reference.heights.height()),
        cell_m: inputs.metres_from_cells.cell_size_m(),
        crs,
        horizontal_epsg: reference.horizontal_epsg,
        vertical: inputs.vertical.clone(),
        classes: inputs.classes.as_ref().map(|(_, source)| source.clone()),
        mask: args.mask.as_ref().map(name),
        terrain: args.dtm.as_ref().map(name),
        notes: inputs.notes.iter().cloned().chain(notes(found, &config)).collect(),
        missed: missed(args, found),
        config,
    }
}

fn config(args: &Args) -> EvalConfig {
    let mut thresholds_m = if args.thresholds.is_empty() { vec![0.5, 1.0, 2.5, 7.5] } else { args.thresholds.clone() };
    thresholds_m.extend(args.min_completeness.iter().map(|least| least.threshold_m));
    thresholds_m.sort_by(f64::total_cmp);
    thresholds_m.dedup();
    EvalConfig {
        alignment: args.align.unwrap_or(Align::Xyz).into(),
        search_m: args.search_m,
        thresholds_m,
        skip: args.skip.clone(),
        standing_m: args.standing_m,
    }
}

/// What a reader of the numbers must know.
fn notes(found: &Evaluation, config: &EvalConfig) -> Vec<String> {
    /// Below this, the NMAD hardly depends on the shift.
    const FLAT: f64 = 1.02;
    let mut notes = Vec::new();
    if let Some(search) = found.search {
        if search.at_edge {
            notes.push(format!(
                "the best shift is at the edge of the search ({} m): the true one may be outside, see --search-m",
                search.radius_m
            ));
        }
        if search.contrast < FLAT {
            notes.push(
                "the ground is too flat for a horizontal shift to be found: the one reported is arbitrary".into(),
            );
        }
    }
    if let Some(nk) = found.nuth_kaab.filter(|nk| !nk.converged) {
        notes.push(format!(
            "nuth-kaab did not settle (last correction {:.3} m, NMAD {:.3} m before and {:.3} m after): compare with --align xyz",
            nk.last_step_m, nk.nmad_before_m, nk.nmad_after_m
        ));
    }
    if !config.skip.is_empty() && found.skipped_cells == 0 {
        notes.push("no valid reference cell has a skipped class".into());
    }
    notes
}

/// The requirements that are not met, in words.
fn missed(args: &Args, found: &Evaluation) -> Vec<String> {
    let mae = found.overall.errors.map_or(f64::INFINITY, |errors| errors.mae);
    let mae = args.max_mae.filter(|&most| mae > most).map(|most| format!("mae is {mae:.3} m, allowed are {most} m"));
    let completeness = args.min_completeness.iter().filter_map(|least| {
        let share = found.overall.completeness(least.threshold_m).unwrap_or(0.0);
        let LeastCompleteness { threshold_m, share: needed } = least;
        (share < *needed).then(|| format!("completeness_{threshold_m} is {share:.4}, required are {needed}"))
    });
    mae.into_iter().chain(completeness).collect()
}
