//! The results, as a table for people and JSON for programs.

use std::fs;
use std::path::Path;

use serde::Serialize;

use crate::run::Cost;
use crate::scenes::Scene;

/// One goal with what was reached.
#[derive(Serialize)]
pub(crate) struct Goal {
    metric: String,
    value: f64,
    least: f64,
    /// `None` where there is no bound.
    greatest: Option<f64>,
    met: bool,
}

/// One scene's results.
#[derive(Serialize)]
pub(crate) struct Row {
    scene: String,
    user_cpu_s: f64,
    wall_s: f64,
    peak_mb: f64,
    s2p_cpu_s: Option<f64>,
    goals: Vec<Goal>,
    metrics: Vec<(String, f64)>,
}

impl Row {
    pub(crate) fn new(scene: &Scene, runs: &[Cost], metrics: Vec<(String, f64)>) -> Self {
        let median = |f: fn(&Cost) -> f64| {
            let mut all: Vec<f64> = runs.iter().map(f).collect();
            all.sort_by(f64::total_cmp);
            all[all.len() / 2]
        };
        let goals = scene.goals.iter().map(|&(metric, least, greatest)| {
            let value = metrics.iter().find(|(name, _)| name == metric).map_or(f64::NAN, |(_, v)| *v);
            let met = (least..=greatest).contains(&value);
            Goal { metric: metric.to_owned(), value, least, greatest: greatest.is_finite().then_some(greatest), met }
        });
        Self {
            scene: scene.name.to_owned(),
            user_cpu_s: median(|c| c.user_s),
            wall_s: median(|c| c.wall_s),
            peak_mb: median(|c| c.peak_mb),
            s2p_cpu_s: scene.s2p_cpu_s,
            goals: goals.collect(),
            metrics,
        }
    }
}

/// A row for the terminal and for Markdown.
pub(crate) fn line(row: &Row) -> String {
    let goals = row.goals.iter().map(|g| {
        let bound = match g.greatest {
            Some(greatest) if g.least > 0.0 => format!("{} to {greatest}", g.least),
            Some(greatest) => format!("≤ {greatest}"),
            None => "–".to_owned(),
        };
        format!("{} {:.3} ({bound}{})", g.metric, g.value, if g.met { "" } else { ", MISSED" })
    });
    let s2p = row.s2p_cpu_s.map_or("–".to_owned(), |s| format!("{s:.0}"));
    format!(
        "| {} | {} | {:.1} | {s2p} | {:.1} | {:.0} |",
        row.scene,
        goals.collect::<Vec<_>>().join("; "),
        row.user_cpu_s,
        row.wall_s,
        row.peak_mb
    )
}

/// Writes both forms.
pub(crate) fn write(folder: &Path, rows: &[Row]) -> anyhow::Result<()> {
    fs::create_dir_all(folder)?;
    fs::write(folder.join("real_scenes.json"), serde_json::to_string_pretty(rows)? + "\n")?;
    let head = "Made by `cargo bench --bench real_scenes`: the release binary, default options, medians of three runs.\n\
                Errors in metres after an xyz alignment, completeness over all cells of the reference; in brackets what \
                is asked for. CPU is user time of the whole command.\n\n\
                | scene | result | CPU s | S2P CPU s | wall s | peak MB |\n|---|---|---|---|---|---|\n";
    let lines: Vec<String> = rows.iter().map(line).collect();
    fs::write(folder.join("real_scenes.md"), format!("{head}{}\n", lines.join("\n")))?;
    Ok(())
}
