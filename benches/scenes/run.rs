//! Runs the command and reads its report.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use anyhow::{Context, ensure};
use serde::Serialize;
use serde_json::Value;

use crate::places::skysweep;
use crate::scenes::Truth;

/// Cost of one run.
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct Cost {
    /// Processor seconds in user mode.
    pub(crate) cpu_s: f64,
    /// Wall seconds.
    pub(crate) wall_s: f64,
    /// Largest resident memory, megabytes.
    pub(crate) peak_mb: f64,
}

fn checked(output: Output) -> anyhow::Result<Output> {
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Ok(output)
}

/// Makes a simulated scene.
pub(crate) fn simulate(arguments: &[&str], folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)?;
    let made = Command::new(skysweep()).arg("simulate").args(arguments).arg("-o").arg(folder).arg("-q").output()?;
    checked(made).map(|_| ()).with_context(|| format!("skysweep simulate {}", arguments.join(" ")))
}

/// Runs `skysweep dsm` with a preset. `preset` may hold further options after the preset's name.
pub(crate) fn dsm(images: &[PathBuf], preset: &str, out: &Path) -> anyhow::Result<Cost> {
    // The standard library cannot measure the processor time of a child; bash can.
    let output = Command::new("bash")
        .args(["-c", "TIMEFORMAT='times %U %R'; time \"$@\"", "bash"])
        .arg(skysweep())
        .args(["dsm", "--preset"])
        .args(preset.split(' '))
        .args(["--overwrite", "--json", "-q", "--progress", "none", "-o"])
        .arg(out)
        .args(images)
        .output()?;
    let output = checked(output)?;
    let errors = String::from_utf8_lossy(&output.stderr);
    let report: Value = serde_json::from_slice(&output.stdout)?;
    let times = errors.lines().find_map(|l| l.strip_prefix("times ")).context("bash printed no times")?;
    let mut seconds = times.split(' ').map(str::parse::<f64>);
    let mut next = || seconds.next().context("bash printed too few times")?.context("bash printed no number");
    Ok(Cost { cpu_s: next()?, wall_s: next()?, peak_mb: report["peak_memory_mb"].as_f64().unwrap_or(f64::NAN) })
}

/// Least share of the cells that a tenth of the confidence must hold to count for the gap.
const GAP_SHARE: f64 = 0.01;

/// Names and values of metrics.
pub(crate) type Metrics = Vec<(String, f64)>;

/// Runs `skysweep eval --align xyz` and returns the metrics over all cells, `median_abs` (the
/// median of |error|), `volume_iou`, `overreach`, and what [`quality`] finds. In simulated scenes
/// water does not count, and the true terrain is used.
pub(crate) fn evaluate(dsm: &Path, truth: &Truth, folder: &Path) -> anyhow::Result<Metrics> {
    let mut command = Command::new(skysweep());
    command.arg("eval").arg(dsm);
    match truth {
        Truth::Simulated => {
            let file = |name: &str| folder.join("truth").join(name);
            command.arg(file("dsm.tif")).arg("--dtm").arg(file("dtm.tif"));
            command.arg("--classes").arg(file("classes.tif")).args(["--skip", "9"]);
            command.arg("--buildings").arg(file("buildings.tif"));
        }
        Truth::Independent => {
            command.arg(folder.join("truth_dsm.tif")).args(["--ref-vertical", "ellipsoid"]);
            command.arg("--buildings").arg(folder.join("truth_buildings.tif"));
        }
        Truth::Measured { path, vertical } | Truth::Peer { path, vertical } => {
            command.arg(path).args(["--test-vertical", vertical, "--ref-vertical", vertical]);
        }
        Truth::Pyramid { .. } => return Ok(Metrics::new()),
    }
    command.arg("--confidence").arg(dsm.with_file_name("confidence.tif"));
    let output = checked(command.args(["--align", "xyz", "--json", "--no-report"]).output()?)?;
    let report: Value = serde_json::from_slice(&output.stdout)?;
    let all = report["metrics"].as_object().context("the evaluation has no member \"metrics\"")?;
    let mut out: Metrics = all.iter().filter_map(|(k, v)| Some((k.clone(), v.as_f64()?))).collect();
    let mut add = |name: &str, value: Option<f64>| out.extend(value.map(|value| (name.to_owned(), value)));
    // The alignment takes the median out, so the median of |error| is the MAD.
    add("median_abs", all.get("nmad").and_then(Value::as_f64).map(|nmad| nmad / 1.4826));
    add("volume_iou", report.pointer("/standing/volume_m3/iou").and_then(Value::as_f64));
    add("overreach", report.pointer("/sharpness/overreach_m/median").and_then(Value::as_f64));
    for kept in report["coverages"].as_array().into_iter().flatten() {
        let of = |name: &str| kept.pointer(name).and_then(Value::as_f64);
        let share = of("/coverage").context("a coverage without its share")?;
        add(&at_coverage("mae", share), of("/metrics/mae"));
        add(&at_coverage("completeness_1", share), of("/metrics/completeness_1"));
    }
    out.extend(quality(&report));
    Ok(out)
}

/// Returns the metrics of observed and filled cells, edges, buildings, trees, σ and confidence. A
/// metric that the report does not have is left out.
fn quality(report: &Value) -> Metrics {
    const NAMES: [(&str, &str); 16] = [
        ("observed_ratio", "/origins/observed/metrics/valid_ratio"),
        ("observed_mae", "/origins/observed/metrics/mae"),
        ("observed_completeness_1", "/origins/observed/metrics/completeness_1"),
        ("observed_pag_1", "/origins/observed/metrics/pag_1"),
        ("filled_ratio", "/origins/filled/metrics/valid_ratio"),
        ("filled_mae", "/origins/filled/metrics/mae"),
        ("filled_pag_1", "/origins/filled/metrics/pag_1"),
        ("edge_mae", "/edges/edge/mae"),
        ("edge_completeness_1", "/edges/edge/completeness_1"),
        ("outline_cells", "/outlines/median_cells"),
        ("buildings", "/objects/buildings"),
        ("buildings_lost", "/objects/lost"),
        ("buildings_damaged", "/objects/damaged"),
        ("trees_right", "/objects/trees_right"),
        ("below_1_sigma", "/sigma/observed/below_1_sigma"),
        ("below_2_sigma", "/sigma/observed/below_2_sigma"),
    ];
    let number = |pointer: &str| report.pointer(pointer).and_then(Value::as_f64);
    let mut out: Metrics =
        NAMES.iter().filter_map(|(name, pointer)| Some(((*name).to_owned(), number(pointer)?))).collect();
    let tenths: Vec<[f64; 3]> = (0..10)
        .filter_map(|k| {
            let of = |name: &str| number(&format!("/reliability/tenths/{k}/{name}"));
            let n = of("n")?;
            let (promised, right) = (of("promised").unwrap_or(f64::NAN), of("right").unwrap_or(f64::NAN));
            for (name, value) in [("confidence_n", n), ("promised", promised), ("right", right)] {
                out.extend((!value.is_nan()).then(|| (of_tenth(name, k), value)));
            }
            Some([n, promised, right])
        })
        .collect();
    let cells: f64 = tenths.iter().map(|[n, ..]| n).sum();
    let counts = tenths.iter().filter(|[n, ..]| *n > 0.0 && *n >= GAP_SHARE * cells);
    let gap = counts.map(|[_, promised, right]| (promised - right).abs()).reduce(f64::max);
    out.extend(gap.map(|gap| ("reliability_gap".to_owned(), gap)));
    out
}

/// Returns the name of a metric of a tenth of the confidence.
pub(crate) fn of_tenth(metric: &str, tenth: usize) -> String {
    format!("{metric}_tenth_{tenth}")
}

/// Returns the name of a metric over the most believed cells, where `share` is their share of all
/// reference cells.
pub(crate) fn at_coverage(metric: &str, share: f64) -> String {
    format!("{metric}_at_{:.0}", 100.0 * share)
}
