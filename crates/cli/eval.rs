//! `skysweep eval`: how far a surface model is from a reference.

mod inputs;
mod report;

use std::path::PathBuf;

use anyhow::{Context, ensure};
use eval::{Alignment, EvalConfig, EvalInput, Evaluation, evaluate};
use geodesy::{Crs, VerticalDatum};
use io::raster::{Band, BandData, CogRaster, write_cog};

use crate::{Outcome, print};
use inputs::Inputs;

/// Arguments of `skysweep eval`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The surface model that is evaluated, on any grid.
    test: PathBuf,
    /// The surface model that is believed; errors are measured at its cells.
    #[arg(value_name = "REF")]
    reference: PathBuf,
    /// What is removed before the comparison.
    #[arg(long, value_enum, default_value_t = Align::Xyz)]
    align: Align,
    /// Radius of the horizontal search of --align xyz, in metres.
    #[arg(long, value_name = "METRES", default_value_t = 5.0)]
    search_m: f64,
    /// Class raster on any grid (read at the nearest cell): one more column per class.
    #[arg(long, value_name = "FILE")]
    classes: Option<PathBuf>,
    /// Classes that are left out of everything, the alignment too (water is often 9).
    #[arg(long, value_name = "N", value_delimiter = ',', requires = "classes", allow_negative_numbers = true)]
    skip: Vec<i32>,
    /// Thresholds of completeness_T and pag_T, in metres.
    #[arg(long, value_name = "METRES", value_delimiter = ',', default_value = "0.5,1,2.5,7.5")]
    thresholds: Vec<f64>,
    /// What TEST's heights are above, where the file does not say or is wrong: ellipsoid, egm96, egm2008 or EPSG:n.
    #[arg(long, value_name = "DATUM")]
    test_vertical: Option<VerticalDatum>,
    /// What REF's heights are above, likewise.
    #[arg(long, value_name = "DATUM")]
    ref_vertical: Option<VerticalDatum>,
    /// Write the errors (test − reference, metres) on the reference grid to this file.
    #[arg(long, value_name = "OUT.tif")]
    error_map: Option<PathBuf>,
    /// Replace an error map that exists.
    #[arg(long)]
    overwrite: bool,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Exit with 1 when the MAE over all cells is above this, in metres.
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
}

impl From<Align> for Alignment {
    fn from(align: Align) -> Self {
        match align {
            Align::None => Self::None,
            Align::Z => Self::Z,
            Align::Xyz => Self::Xyz,
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
pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    if let Some(max_mae) = args.max_mae {
        ensure!(max_mae >= 0.0, "--max-mae is {max_mae}, expected a number of metres");
    }
    let config = config(args);
    let mut inputs = Inputs::read(args)?;
    let input = EvalInput {
        test: &inputs.test.heights,
        reference: &inputs.reference.heights,
        test_from_reference: &inputs.test_from_reference,
        metres_from_cells: inputs.metres_from_cells,
        classes: inputs.classes.as_ref(),
    };
    let found = evaluate(&input, &config)?;
    inputs.notes.extend(notes(&found, &config));
    let missed = missed(args, &found);
    if let Some(path) = &args.error_map {
        write_error_map(path, &inputs, &found, args.overwrite)?;
    }
    let run = report::Run { args, config: &config, inputs: &inputs, found: &found, missed: &missed };
    let text = if args.json { run.json()? } else { run.table() };
    print::text(&text)?;
    missed.iter().for_each(|line| tracing::error!("{line}"));
    Ok(if missed.is_empty() { Outcome::Complete } else { Outcome::Partial })
}

fn config(args: &Args) -> EvalConfig {
    let mut thresholds_m = args.thresholds.clone();
    thresholds_m.extend(args.min_completeness.iter().map(|least| least.threshold_m));
    thresholds_m.sort_by(f64::total_cmp);
    thresholds_m.dedup();
    EvalConfig { alignment: args.align.into(), search_m: args.search_m, thresholds_m, skip: args.skip.clone() }
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

fn write_error_map(path: &PathBuf, inputs: &Inputs, found: &Evaluation, overwrite: bool) -> anyhow::Result<()> {
    let horizontal = inputs.reference.horizontal_epsg.context(
        "an error map takes the coordinate system of the reference, which has no EPSG code: leave --error-map out",
    )?;
    let bands = [Band { description: "error_m", data: BandData::F32(&found.errors) }];
    let raster = CogRaster::new(&bands, inputs.reference.geotransform, Crs::ellipsoidal(horizontal));
    Ok(write_cog(path, &raster, overwrite)?)
}
