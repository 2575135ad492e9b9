//! Pictures and plots of a page.

use std::fmt::Write;

use eval::{ErrorStatistics, Metrics, cumulative, histogram};

use raster::{Grid, VOID_COLOUR};

use super::numbers::{grouped, percent};
use super::report::EvaluationReport;
use crate::class::class_title;
use crate::escape::escape;
use crate::palette::{MISSING, OUTSIDE, css, diverging};
use crate::picture::{PictureError, data_uri, error_picture, fitted, relief};
use crate::svg::{Axis, Chart};

/// Lowest number of cells of a category that is drawn.
const LEAST_CELLS: usize = 30;

impl EvaluationReport<'_> {
    /// Returns pictures of both surfaces and of the errors.
    pub(super) fn pictures(&self) -> Result<String, PictureError> {
        let (reference, errors) = (fitted(self.reference), fitted(&self.found.errors));
        let (range, (low, high)) = (self.error_range_m(), self.height_range());
        let surface = |heights: &Grid<f32>| relief(heights, self.reference.width(), self.protocol.cell_m, (low, high));
        let key = |colour, text| format!("<span class=\"key\" style=\"background:{}\"></span>{text} ", css(colour));
        let heights =
            format!("Colours from {low:.1} m to {high:.1} m, the same for both. {}", key(VOID_COLOUR, "no height"));
        let test =
            figure(&data_uri(&surface(&fitted(&self.found.aligned)))?, "the evaluated surface", "Evaluated", &heights);
        let truth = figure(&data_uri(&surface(&reference))?, "the reference surface", "Reference", &heights);
        let map = data_uri(&error_picture(&errors, &reference, range))?;
        let caption = format!(
            "Evaluated − reference, metres: blue too low, red too high. {}{}",
            key(MISSING, "missing"),
            key(OUTSIDE, "not evaluated")
        );
        let error = format!(
            "<figure><img src=\"{map}\" alt=\"map of the errors\">{}<figcaption><b>Error.</b> \
              {caption}</figcaption></figure>",
            scale(range)
        );
        Ok(format!("<div class=\"pictures\">{test}{truth}{error}</div>"))
    }

    /// Returns the plots of the distribution and of the breakdowns.
    pub(super) fn plots(&self) -> String {
        let mut plots = vec![self.histogram_plot(), self.cumulative_plot()];
        let slopes =
            self.found.slopes.iter().map(|bin| (format!("{:.0}–{:.0}°", bin.from_deg, bin.to_deg), &bin.metrics));
        plots.extend(categories("Error against slope", "slope of the reference", slopes));
        let classes = self.found.classes.iter().map(|c| (class_title(c.class), &c.metrics));
        let edges = &self.found.edges;
        let edges = [("near edges".to_owned(), &edges.edge), ("elsewhere".to_owned(), &edges.rest)];
        plots.extend(categories("Error by kind of cell", "cells", edges.into_iter().chain(classes)));
        format!("<div class=\"plots\">{}</div>", plots.join(""))
    }

    fn histogram_plot(&self) -> String {
        let range = self.plot_range_m();
        let found = histogram(&self.found.errors, range);
        let (n, width) = (self.found.overall.n.max(1) as f64, 2.0 * range / found.counts.len().max(1) as f64);
        let share = |count: usize| 100.0 * count as f64 / n;
        let highest = found.counts.iter().copied().max().unwrap_or(0);
        let y = Axis::linear("share of cells, %", 0.0, 1.08 * share(highest));
        let mut chart = Chart::new("Histogram of the errors", Axis::linear("error, m", -range, range), y);
        for (i, &count) in found.counts.iter().enumerate() {
            let from = -range + i as f64 * width;
            chart.bar("bar", (from, from + 0.9 * width), share(count));
        }
        if let Some(errors) = self.found.overall.errors.filter(|errors| errors.nmad > 0.0) {
            let density = |x: f64| (-0.5 * ((x - errors.median) / errors.nmad).powi(2)).exp() / errors.nmad;
            let peak = 100.0 * width / std::f64::consts::TAU.sqrt();
            let places = (0..=160).map(|i| -range + f64::from(i) / 80.0 * range);
            chart.line("line2", places.map(|x| (x, peak * density(x))));
        }
        let outside = found.below + found.above;
        plot(
            &chart,
            "Histogram",
            &format!(
                "The line is the normal distribution of the same median and NMAD; {} cells lie outside.",
                grouped(outside)
            ),
        )
    }

    fn cumulative_plot(&self) -> String {
        let range = self.plot_range_m();
        let found = cumulative(&self.found.errors, range);
        let cells = self.found.overall.reference_cells.max(1) as f64;
        let x = Axis::linear("|error| at most, m", 0.0, range);
        let mut chart =
            Chart::new("Cumulative error", x, Axis::linear("share of the reference's cells, %", 0.0, 100.0));
        let valid = 100.0 * self.found.overall.valid_ratio().unwrap_or(0.0);
        chart.line("rule", [(0.0, valid), (range, valid)].into_iter());
        let points = found.error_m.iter().zip(&found.cells);
        chart.line("line", points.map(|(&error, &count)| (error, 100.0 * count as f64 / cells)));
        for &(threshold, _) in self.found.overall.below.iter().filter(|(t, _)| *t <= range) {
            let share = 100.0 * self.found.overall.completeness(threshold).unwrap_or(0.0);
            chart.dot("dot", threshold, share);
        }
        let coverage = percent(self.found.overall.valid_ratio());
        plot(
            &chart,
            "Completeness",
            &format!(
                "Missing cells count as failures: the curve ends at the dashed line, the {coverage} % with any value."
            ),
        )
    }
}

/// Plots MAE, NMAD and LE90 of categories, or returns `None` if no category has enough cells. The
/// scale is logarithmic, because errors at edges are a hundred times those on plains.
fn categories<'a>(title: &str, label: &str, all: impl Iterator<Item = (String, &'a Metrics)>) -> Option<String> {
    let usable = |(name, m): (String, &Metrics)| Some((name, m.n, m.errors.filter(|_| m.n >= LEAST_CELLS)?));
    let drawn: Vec<(String, usize, ErrorStatistics)> = all.filter_map(usable).collect();
    let values = |e: &ErrorStatistics| [e.nmad, e.mae, e.le90];
    if drawn.iter().all(|(_, _, e)| e.le90 <= 0.0) {
        return None;
    }
    let x = Axis::names(label, drawn.iter().map(|(name, ..)| name.clone()));
    let y = Axis::logarithmic("error, m", drawn.iter().flat_map(|(_, _, e)| values(e)));
    let mut chart = Chart::new(title, x, y);
    for (i, (_, _, e)) in drawn.iter().enumerate() {
        let middle = i as f64 + 0.5;
        let lowest = values(e).into_iter().fold(f64::INFINITY, f64::min);
        chart.whisker(middle, lowest, values(e).into_iter().fold(0.0, f64::max));
        for (class, value) in [("dot3", e.le90), ("dot2", e.nmad), ("dot", e.mae)] {
            chart.dot(class, middle, value);
        }
    }
    let mut cells = String::new();
    for (i, (name, n, _)) in drawn.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(cells, "{}{} {}", if i > 0 { ", " } else { "" }, escape(name), grouped(*n));
    }
    Some(plot(&chart, title, &format!("MAE blue, NMAD orange, LE90 grey; the scale is logarithmic. Cells: {cells}.")))
}

fn plot(chart: &Chart, title: &str, caption: &str) -> String {
    format!("<figure>{}<figcaption><b>{title}.</b> {caption}</figcaption></figure>", chart.inline())
}

fn figure(uri: &str, alt: &str, title: &str, caption: &str) -> String {
    format!("<figure><img src=\"{uri}\" alt=\"{alt}\"><figcaption><b>{title}.</b> {caption}</figcaption></figure>")
}

/// Returns the colour bar of the error map.
fn scale(range_m: f64) -> String {
    let mut bar = String::from(
        "<svg class=\"scale\" viewBox=\"0 0 320 34\" shape-rendering=\"crispEdges\" role=\"img\" \
          aria-label=\"colours of the error map\">",
    );
    const STEPS: i32 = 64;
    for i in 0..STEPS {
        let (x, relative) =
            (f64::from(i) * 300.0 / f64::from(STEPS) + 10.0, 2.0 * (f64::from(i) + 0.5) / f64::from(STEPS) - 1.0);
        let _ = write!(
            bar,
            "<rect x=\"{x:.2}\" y=\"0\" width=\"4.8\" height=\"14\" fill=\"{}\"/>",
            css(diverging(relative))
        );
    }
    for (x, anchor, text) in [
        (10, "start", format!("≤ −{range_m} m")),
        (160, "middle", "0".to_owned()),
        (310, "end", format!("≥ +{range_m} m")),
    ] {
        let _ = write!(bar, "<text x=\"{x}\" y=\"29\" text-anchor=\"{anchor}\">{text}</text>");
    }
    bar + "</svg>"
}
