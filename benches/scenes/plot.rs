//! Processor seconds per megapixel against error and against incompleteness, with the Pareto front.
//!
//! The left plots show the error (MAE), the right plots the incompleteness (the share of the
//! reference's cells without an error below 1 m). The upper plots show the real scene with LiDAR
//! truth: skysweep's surfaces without filled voids beside other programs' unfilled surfaces. The
//! lower plots show the simulated scenes with the default fill. There the line joins the presets'
//! means over all scenes instead of a Pareto front, because scenes do not compete.

use report::{Axis, Chart};

use crate::matrix::{PRESETS, Row, UNFILLED};
use crate::peers::Peer;

/// Mark of each preset, in the order of [`PRESETS`].
const MARKS: [&str; 3] = ["dot3", "dot", "dot2"];

/// One mark of a plot.
#[derive(Clone)]
struct Point {
    cost: f64,
    error: f64,
    label: String,
    mark: Mark,
}

#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Preset(usize),
    Peer,
}

/// Points of one scene, in the order of the presets.
type Series = Vec<Point>;

/// The four plots as one SVG.
pub(crate) fn sheet(rows: &[Row], peers: &[Peer]) -> String {
    let mae = |row: &Row| row.metric("mae");
    let incomplete = |row: &Row| 100.0 * (1.0 - row.metric("completeness_1"));
    let peers_by = |error: fn(&Peer) -> f64| -> Vec<Point> {
        peers.iter().filter(|p| p.scene == "jax_068" && !p.filled).filter_map(|p| peer_point(p, error(p))).collect()
    };
    let jax = |title: &str, label: &str, error: fn(&Row) -> f64, peers: Vec<Point>| {
        let mut all = series(rows, "measured", UNFILLED, error);
        all.push(peers);
        let front = front(all.iter().flatten());
        plot(title, label, &all, &front)
    };
    let simulated = |title: &str, label: &str, error: fn(&Row) -> f64| {
        let all = series(rows, "simulated", PRESETS, error);
        plot(title, label, &all, &means(&all))
    };
    let (metres, percent) = ("MAE, m", "cells not within 1 m, %");
    let charts = [
        jax("JAX_068 against LiDAR, no void filled: error", metres, mae, peers_by(|p| p.mae)),
        jax(
            "JAX_068 against LiDAR, no void filled: incompleteness",
            percent,
            incomplete,
            peers_by(|p| 100.0 * (1.0 - p.completeness_1)),
        ),
        simulated("Simulated scenes: error", metres, mae),
        simulated("Simulated scenes: incompleteness", percent, incomplete),
    ];
    let key = [
        ("dot3", "fast"),
        ("dot", "balanced (default)"),
        ("dot2", "accurate"),
        (
            "whisker",
            "(square) other programs. Dashed: the presets of one scene. Line: Pareto front; below, the mean over \
             scenes",
        ),
    ];
    Chart::sheet(&charts, 2, &key)
}

fn series(rows: &[Row], truth: &str, presets: [&str; 3], error: fn(&Row) -> f64) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    let mut scene = "";
    for row in rows.iter().filter(|row| row.truth == truth) {
        let Some(preset) = presets.iter().position(|preset| *preset == row.preset) else { continue };
        if row.scene != scene {
            all.push(Series::new());
            scene = row.scene;
        }
        let mark = Mark::Preset(preset);
        let label =
            if row.preset == presets[1] { row.scene.trim_start_matches("jax_068 ").to_owned() } else { String::new() };
        let point = Point { cost: row.cpu_s_per_megapixel, error: error(row), label, mark };
        if let Some(series) = all.last_mut() {
            series.push(point);
        }
    }
    all
}

fn peer_point(peer: &Peer, error: f64) -> Option<Point> {
    let views: Vec<String> = peer.views.iter().map(usize::to_string).collect();
    let few = views.len() <= 3;
    let label = format!("{} {}", peer.tool, if few { views.join("-") } else { format!("{} views", views.len()) });
    Some(Point { cost: peer.cpu_s? / peer.megapixels?, error, label, mark: Mark::Peer })
}

fn plot(title: &str, label: &str, all: &[Series], line: &[(f64, f64)]) -> Chart {
    let points = || all.iter().flatten();
    let x = Axis::logarithmic("CPU seconds per megapixel", points().map(|p| p.cost));
    let mut chart = Chart::new(title, x, Axis::logarithmic(label, points().map(|p| p.error)));
    for series in all.iter().filter(|series| series.iter().all(|p| p.mark != Mark::Peer)) {
        chart.line("rule", series.iter().map(|p| (p.cost, p.error)));
    }
    chart.line("line2", line.iter().copied());
    for point in points() {
        match point.mark {
            Mark::Preset(i) => chart.dot(MARKS[i], point.cost, point.error),
            Mark::Peer => chart.square("whisker", point.cost, point.error),
        }
        chart.note(point.cost, point.error, &point.label);
    }
    chart
}

/// Returns the mean of each preset over the scenes.
fn means(all: &[Series]) -> Vec<(f64, f64)> {
    let mean = |preset: usize| {
        let points: Vec<&Point> = all.iter().filter_map(|series| series.get(preset)).collect();
        let sum = points.iter().fold((0.0, 0.0), |(cost, error), p| (cost + p.cost, error + p.error));
        (sum.0 / points.len() as f64, sum.1 / points.len() as f64)
    };
    if all.is_empty() { Vec::new() } else { (0..PRESETS.len()).map(mean).collect() }
}

/// Returns the Pareto front as a step line: the points that no other point beats in both values.
fn front<'a>(points: impl Iterator<Item = &'a Point>) -> Vec<(f64, f64)> {
    let mut sorted: Vec<(f64, f64)> =
        points.map(|p| (p.cost, p.error)).filter(|(cost, error)| cost.is_finite() && error.is_finite()).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut front: Vec<(f64, f64)> = Vec::new();
    for (cost, error) in sorted {
        match front.last().copied() {
            Some((_, best)) if error >= best => {}
            Some((_, best)) => front.extend([(cost, best), (cost, error)]),
            None => front.push((cost, error)),
        }
    }
    front
}
