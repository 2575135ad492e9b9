//! Running the command and reading what it says.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, ensure};
use serde_json::Value;

use crate::scenes::Scene;

/// What one run took.
pub(crate) struct Cost {
    /// Processor seconds in user mode.
    pub(crate) user_s: f64,
    /// Wall seconds.
    pub(crate) wall_s: f64,
    /// Largest resident memory, megabytes.
    pub(crate) peak_mb: f64,
}

/// Runs `skysweep dsm` with default options.
pub(crate) fn dsm(scene: &Scene, out: &Path) -> anyhow::Result<Cost> {
    // bash times the command and its threads; nothing in std does.
    let output = Command::new("bash")
        .args(["-c", "TIMEFORMAT='times %U %R'; time \"$@\"", "bash"])
        .args([env!("CARGO_BIN_EXE_skysweep"), "dsm", "--overwrite", "--json", "-q", "--progress", "none", "-o"])
        .arg(out)
        .args(&scene.images)
        .output()?;
    let errors = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{}: {errors}", scene.name);
    let report: Value = serde_json::from_slice(&output.stdout)?;
    let times = errors.lines().find_map(|l| l.strip_prefix("times ")).context("bash printed no times")?;
    let mut seconds = times.split(' ').map(str::parse::<f64>);
    let mut next = || seconds.next().context("bash printed too few times")?.context("bash printed no number");
    Ok(Cost { user_s: next()?, wall_s: next()?, peak_mb: report["peak_memory_mb"].as_f64().unwrap_or(f64::NAN) })
}

/// Runs `skysweep eval --align xyz` and returns the metrics over all cells, and `median_abs`, the median of |error|.
pub(crate) fn evaluate(dsm: &Path, truth: &Path, vertical: Option<&str>) -> anyhow::Result<Vec<(String, f64)>> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_skysweep"));
    command.arg("eval").arg(dsm).arg(truth).args(["--align", "xyz", "--json", "--no-report"]);
    if let Some(datum) = vertical {
        command.args(["--test-vertical", datum, "--ref-vertical", datum]);
    }
    let output = command.output()?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout)?;
    let all = report["metrics"].as_object().context("the evaluation has no member \"metrics\"")?;
    let mut out: Vec<(String, f64)> = all.iter().filter_map(|(k, v)| Some((k.clone(), v.as_f64()?))).collect();
    // The alignment takes the median out, so the median of |error| is the MAD.
    let nmad = all.get("nmad").and_then(Value::as_f64).context("the evaluation has no nmad")?;
    out.push(("median_abs".to_owned(), nmad / 1.4826));
    Ok(out)
}
