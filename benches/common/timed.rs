//! Runs of the command with their processor time.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use serde_json::Value;

use crate::places;

/// Report and times of a run.
pub(crate) struct Timed {
    pub(crate) report: Value,
    pub(crate) user_s: f64,
    pub(crate) system_s: f64,
    pub(crate) wall_s: f64,
}

/// Runs `skysweep dsm` as a user would run it with a memory limit.
pub(crate) fn dsm(images: &[PathBuf], out: &Path, memory_mb: u64, options: &[&str]) -> anyhow::Result<Timed> {
    // The standard library cannot measure the processor time of a child; bash can.
    let output = Command::new("bash")
        .args(["-c", "TIMEFORMAT='times %U %S %R'; time \"$@\"", "bash"])
        .arg(places::skysweep())
        .args(["dsm", "--overwrite", "--json", "-q", "--progress", "none", "--memory", &memory_mb.to_string()])
        .args(options)
        .arg("-o")
        .arg(out)
        .args(images)
        .output()?;
    let errors = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "skysweep dsm on {} images: {errors}", images.len());
    let report: Value = serde_json::from_slice(&output.stdout)?;
    let times = errors.lines().find_map(|l| l.strip_prefix("times ")).context("bash printed no times")?;
    let seconds: Vec<f64> = times.split(' ').map(str::parse).collect::<Result<_, _>>()?;
    let [user_s, system_s, wall_s] = seconds[..] else { anyhow::bail!("bash printed other times: {times}") };
    Ok(Timed { report, user_s, system_s, wall_s })
}
