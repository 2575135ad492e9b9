//! Writes the results as JSON, as Markdown tables and as plots.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use serde::Serialize;

use crate::machine::machine;
use crate::matrix::{DEFAULT, Reached, Row};
use crate::peers::Peer;
use crate::plot;
use crate::quality::{quality_table, reliability_table};
use crate::run::at_coverage;

/// All results, with the machine and the date.
#[derive(Serialize)]
pub(crate) struct Results {
    date: String,
    machine: String,
    runs: usize,
    minutes: f64,
    rows: Vec<Row>,
    peers: Vec<Peer>,
}

impl Results {
    pub(crate) fn new(rows: Vec<Row>, peers: Vec<Peer>, runs: usize, took: Duration) -> Self {
        Self { date: date(), machine: machine(), runs, minutes: took.as_secs_f64() / 60.0, rows, peers }
    }

    /// Returns the tables.
    pub(crate) fn markdown(&self) -> String {
        let Self { date, machine, runs, minutes, .. } = self;
        let mut text = format!(
            "Made by `make bench` ({date}, {machine}, {runs} runs, {minutes:.0} minutes): the release binary, \
             default options, medians. \
             CPU is user time of the whole command, Mpx are those of all images. Errors in metres after an xyz \
             alignment; shares \
             are of all cells of the reference, so voids count as failures. ◦ marks a preset that another one beats \
             in all of \
             CPU, MAE and completeness.\n\n\
             | scene | preset | CPU s | CPU s/Mpx | wall s | peak MB | MAE | RMSE | NMAD | < 1 m % | coverage % | \
             volume IoU % | overreach m |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
        );
        for row in self.rows.iter().filter(|row| row.has_truth()) {
            text.push_str(&line(row));
        }
        text.push_str(&quality_table(&self.rows));
        text.push_str(&reliability_table(&self.rows));
        text.push_str(&self.goal_table());
        text.push_str(&self.peer_table());
        text.push_str(&self.coverage_table());
        text
    }

    /// Returns the table of goals, with S2P's time on the same scene.
    fn goal_table(&self) -> String {
        let mut text = String::from(
            "\nWhat was promised of the default preset, and S2P's time on the same scene:\n\n\
             | scene | result (promised) | CPU s | S2P CPU s | wall s | peak MB |\n|---|---|---|---|---|---|\n",
        );
        for row in self.rows.iter().filter(|row| !row.goals.is_empty()) {
            let goals: Vec<String> = row.goals.iter().map(goal).collect();
            let s2p = row.s2p_cpu_s.map_or("–".to_owned(), |s| format!("{s:.0}"));
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "| {} | {} | {:.1} | {s2p} | {:.1} | {:.0} |",
                row.scene,
                goals.join("; "),
                row.cpu_s,
                row.wall_s,
                row.peak_mb
            );
        }
        text
    }

    fn peer_table(&self) -> String {
        let mut text = String::from(
            "\nOther programs on the same images (`benches/peers/`):\n\n\
             | program | scene | input | CPU s | CPU s/Mpx | MAE | RMSE | NMAD | < 1 m % | coverage % \
             |\n|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for peer in &self.peers {
            let known = |value: Option<String>| value.unwrap_or_else(|| "–".to_owned());
            let cpu = known(peer.cpu_s.map(|seconds| format!("{seconds:.0}")));
            let per_megapixel = known(peer.cpu_s.zip(peer.megapixels).map(|(s, mpx)| format!("{:.1}", s / mpx)));
            let note = if peer.cpu_note.is_empty() { String::new() } else { format!(" ({})", peer.cpu_note) };
            let _ = writeln!(
                text,
                "| {} | {} | {} | {cpu}{note} | {per_megapixel} | {:.3} | {:.2} | {:.3} | {:.1} | {:.1} |",
                peer.tool,
                peer.scene,
                peer.input,
                peer.mae,
                peer.rmse,
                peer.nmad,
                100.0 * peer.completeness_1,
                100.0 * peer.valid_ratio
            );
        }
        text
    }

    /// The default preset without its least believed cells, beside unfilled surfaces of other
    /// programs.
    fn coverage_table(&self) -> String {
        let mut text = String::from(
            "\nAt equal coverage: the cells that skysweep's default preset believes most (`dsm/confidence.tif`), \
             filled cells among them, \
             beside unfilled surfaces of other programs. Their share of the reference is the other program's \
             coverage, rounded up to \
             the next twentieth.\n\n\
             | program | input | coverage % | MAE | < 1 m % | skysweep coverage % | MAE | < 1 m % \
             |\n|---|---|---|---|---|---|---|---|\n",
        );
        for peer in self.peers.iter().filter(|peer| !peer.filled) {
            let names: Vec<String> = peer.views.iter().map(|v| format!("{v:03}")).collect();
            let scene = match names.len() {
                7 => "jax_068 7 views".to_owned(),
                _ => format!("jax_068 {}", names.join("-")),
            };
            let Some(row) = self.rows.iter().find(|row| row.preset == DEFAULT && row.scene == scene) else {
                continue;
            };
            let share = (20.0 * peer.valid_ratio).ceil() / 20.0;
            let mae = row.metric(&at_coverage("mae", share));
            if mae.is_nan() {
                continue;
            }
            let _ = writeln!(
                text,
                "| {} | {} | {:.1} | {:.3} | {:.1} | {:.0} | {mae:.3} | {:.1} |",
                peer.tool,
                peer.input,
                100.0 * peer.valid_ratio,
                peer.mae,
                100.0 * peer.completeness_1,
                100.0 * share,
                100.0 * row.metric(&at_coverage("completeness_1", share))
            );
        }
        text
    }

    /// Writes JSON, Markdown and plots.
    pub(crate) fn write(&self, folder: &Path) -> anyhow::Result<()> {
        fs::create_dir_all(folder)?;
        fs::write(folder.join("scenes.json"), serde_json::to_string_pretty(self)? + "\n")?;
        fs::write(folder.join("scenes.md"), self.markdown())?;
        fs::write(folder.join("scenes.svg"), plot::sheet(&self.rows, &self.peers))?;
        Ok(())
    }
}

fn line(row: &Row) -> String {
    let mark = if row.dominated { " ◦" } else { "" };
    let percent = |name: &str| 100.0 * row.metric(name);
    format!(
        "| {} | {}{mark} | {:.2} | {:.2} | {:.2} | {:.0} | {:.3} | {:.2} | {:.3} | {:.1} | {:.1} | {:.1} | {:+.2} |\n",
        row.scene,
        row.preset,
        row.cpu_s,
        row.cpu_s_per_megapixel,
        row.wall_s,
        row.peak_mb,
        row.metric("mae"),
        row.metric("rmse"),
        row.metric("nmad"),
        percent("completeness_1"),
        percent("valid_ratio"),
        percent("volume_iou"),
        row.metric("overreach"),
    )
}

fn goal(goal: &Reached) -> String {
    let bound = if goal.least > 0.0 {
        format!("{} to {}", goal.least, goal.greatest)
    } else {
        format!("≤ {}", goal.greatest)
    };
    format!("{} {:.3} ({bound}{})", goal.metric, goal.value, if goal.met { "" } else { ", MISSED" })
}

/// Today, in UTC.
fn date() -> String {
    let output = Command::new("date").args(["-u", "+%Y-%m-%d"]).output();
    output.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned()).unwrap_or_default()
}
