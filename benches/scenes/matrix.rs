//! Runs every preset on every scene and collects cost and accuracy.

use std::path::Path;

use numeric::upper_median;
use serde::Serialize;

use crate::pyramid;
use crate::run::{self, Cost, Metrics};
use crate::scenes::{Scene, Truth};

/// The presets, fastest first.
pub(crate) const PRESETS: [&str; 3] = ["fast", "balanced", "accurate"];
/// The preset that the goals apply to.
pub(crate) const DEFAULT: &str = "balanced";

/// The presets without filled voids, in the order of [`PRESETS`], for comparison with other
/// programs' unfilled surfaces. They run on measured scenes.
pub(crate) const UNFILLED: [&str; 3] = ["fast --fill none", "balanced --fill none", "accurate --fill none"];
/// The default preset with every void filled, for comparison with other programs' filled surfaces.
/// It runs on measured scenes.
pub(crate) const FILLED: &str = "balanced --fill all";

/// Relative difference of two median times that is taken as noise.
const NOISE: f64 = 0.05;

/// One goal, and the value that was reached.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Reached {
    pub(crate) metric: &'static str,
    pub(crate) value: f64,
    pub(crate) least: f64,
    pub(crate) greatest: f64,
    pub(crate) met: bool,
}

/// Results of one scene with one preset.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Row {
    pub(crate) scene: &'static str,
    /// `simulated`, `independent`, `measured`, `peer` or `pyramid`.
    pub(crate) truth: &'static str,
    pub(crate) preset: &'static str,
    pub(crate) megapixels: f64,
    pub(crate) cpu_s: f64,
    pub(crate) cpu_s_per_megapixel: f64,
    pub(crate) wall_s: f64,
    pub(crate) peak_mb: f64,
    pub(crate) metrics: Metrics,
    /// User seconds of S2P on the same scene, where the shared data know them.
    pub(crate) s2p_cpu_s: Option<f64>,
    pub(crate) goals: Vec<Reached>,
    /// Another preset is at least as fast and as good in MAE and completeness, and better in one of
    /// the three.
    pub(crate) dominated: bool,
    /// Cost of each run.
    pub(crate) runs: Vec<Cost>,
}

impl Row {
    /// Returns a metric by name, or NaN where the scene has no such metric.
    pub(crate) fn metric(&self, name: &str) -> f64 {
        self.metrics.iter().find(|(known, _)| known == name).map_or(f64::NAN, |(_, value)| *value)
    }

    /// Whether the errors are against a truth.
    pub(crate) fn has_truth(&self) -> bool {
        matches!(self.truth, "simulated" | "independent" | "measured")
    }

    fn new(scene: &Scene, preset: &'static str, runs: Vec<Cost>, metrics: Metrics) -> anyhow::Result<Self> {
        let median = |f: fn(&Cost) -> f64| {
            let mut all: Vec<f64> = runs.iter().map(f).collect();
            upper_median(&mut all).unwrap_or(f64::NAN)
        };
        let (megapixels, cpu_s) = (scene.megapixels()?, median(|c| c.cpu_s));
        let truth = match scene.truth {
            Truth::Simulated => "simulated",
            Truth::Independent => "independent",
            Truth::Measured { .. } => "measured",
            Truth::Peer { .. } => "peer",
            Truth::Pyramid { .. } => "pyramid",
        };
        let mut row = Self {
            scene: scene.name,
            truth,
            preset,
            megapixels,
            cpu_s,
            cpu_s_per_megapixel: cpu_s / megapixels,
            wall_s: median(|c| c.wall_s),
            peak_mb: median(|c| c.peak_mb),
            metrics,
            s2p_cpu_s: None,
            goals: Vec::new(),
            dominated: false,
            runs,
        };
        let goals = scene.goals.iter().filter(|_| preset == DEFAULT).map(|&(metric, least, greatest)| {
            let value = row.metric(metric);
            Reached { metric, value, least, greatest, met: (least..=greatest).contains(&value) }
        });
        row.goals = goals.collect();
        Ok(row)
    }

    /// Returns whether another row of the same scene and fill is at least as good in everything and
    /// better in something. Times that differ by less than [`NOISE`] count as equal.
    fn is_dominated_by(&self, other: &Self) -> bool {
        let errors = |row: &Self| [row.metric("mae"), 1.0 - row.metric("completeness_1")];
        let pairs = || errors(other).into_iter().zip(errors(self));
        let faster = other.cpu_s < (1.0 - NOISE) * self.cpu_s;
        let not_slower = other.cpu_s <= (1.0 + NOISE) * self.cpu_s;
        let fill = |row: &Self| row.preset.split_once(' ').map(|(_, fill)| fill);
        let comparable = self.scene == other.scene && fill(self) == fill(other);
        let no_worse = comparable && not_slower && pairs().all(|(a, b)| a <= b);
        no_worse && (faster || pairs().any(|(a, b)| a < b))
    }
}

/// Runs all scenes and presets once, then all of them again, `runs` times.
pub(crate) fn measure(scenes: &[Scene], folder: &Path, runs: usize) -> anyhow::Result<Vec<Row>> {
    let mut cells: Vec<(&Scene, &'static str, Vec<Cost>, Metrics)> =
        scenes.iter().flat_map(|scene| presets(scene).map(move |p| (scene, p, Vec::new(), Metrics::new()))).collect();
    let out = folder.join("out");
    for round in 0..runs {
        for (scene, preset, costs, metrics) in &mut cells {
            costs.push(run::dsm(&scene.images, preset, &out)?);
            if round == 0 {
                *metrics = accuracy(scene, &out.join("dsm/dsm.tif"))?;
            }
            println!("{round} {} {preset}: {:?}", scene.name, costs.last());
        }
    }
    let rows: anyhow::Result<Vec<Row>> =
        cells.into_iter().map(|(scene, preset, costs, metrics)| Row::new(scene, preset, costs, metrics)).collect();
    let mut rows = rows?;
    let dominated: Vec<bool> = rows.iter().map(|row| rows.iter().any(|other| row.is_dominated_by(other))).collect();
    rows.iter_mut().zip(dominated).for_each(|(row, dominated)| row.dominated = dominated && row.has_truth());
    Ok(rows)
}

fn presets(scene: &Scene) -> impl Iterator<Item = &'static str> + use<> {
    let measured = matches!(scene.truth, Truth::Measured { .. });
    let fills = UNFILLED.into_iter().chain([FILLED]).filter(move |_| measured);
    PRESETS.into_iter().chain(fills)
}

fn accuracy(scene: &Scene, dsm: &Path) -> anyhow::Result<Metrics> {
    let Truth::Pyramid { peers } = &scene.truth else { return run::evaluate(dsm, &scene.truth, &scene.folder) };
    let mut all = pyramid::measure(dsm)?;
    for (prefix, peer) in peers {
        all.extend(pyramid::measure(peer)?.into_iter().map(|(name, value)| (format!("{prefix}_{name}"), value)));
    }
    Ok(all)
}
