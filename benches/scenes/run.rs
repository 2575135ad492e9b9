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

/// Names and values of metrics.
pub(crate) type Metrics = Vec<(String, f64)>;

/// Runs `skysweep eval --align xyz` and returns the metrics over all cells, `median_abs` (the
/// median of |error|), `volume_iou` and `overreach`. In simulated scenes water does not count, and
/// the true terrain is used.
pub(crate) fn evaluate(dsm: &Path, truth: &Truth, folder: &Path) -> anyhow::Result<Metrics> {
    let mut command = Command::new(skysweep());
    command.arg("eval").arg(dsm);
    match truth {
        Truth::Simulated => {
            let file = |name: &str| folder.join("truth").join(name);
            command.arg(file("dsm.tif")).arg("--dtm").arg(file("dtm.tif"));
            command.arg("--classes").arg(file("classes.tif")).args(["--skip", "9"]);
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
    Ok(out)
}

/// Returns the name of a metric over the most believed cells, where `share` is their share of all
/// reference cells.
pub(crate) fn at_coverage(metric: &str, share: f64) -> String {
    format!("{metric}_at_{:.0}", 100.0 * share)
}
