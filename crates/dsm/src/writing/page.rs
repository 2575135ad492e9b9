//! The page of a run: maps, residuals, times and choices.

use crs::Crs;
use numeric::percentile;
use report::{Axis, Chart, JobPage, JobTable, PageLink, PictureError, PointResidual, grouped, residual_map};

use crate::config::DsmConfig;
use crate::report::{ControlReport, DsmReport};
use crate::writing::image_tables::{days, file_name, image_table, quality_table};
use crate::writing::pictures::RunMaps;

/// Number of bars of a histogram.
const BARS: usize = 60;
/// Percentile of σ at which its histogram ends.
const SIGMA_END: f64 = 99.0;
/// Most images with bars of their own.
const IMAGES_MAX: usize = 60;
/// Most images with a map of residuals; those with the largest residuals are shown.
const MAPS_MAX: usize = 12;

/// Returns the page.
///
/// # Errors
/// [`PictureError`] for maps without cells.
pub(crate) fn html(
    config: &DsmConfig,
    report: &DsmReport,
    (crs, cell_m): (&Crs, f64),
    maps: &RunMaps,
    links: Vec<PageLink>,
) -> Result<String, PictureError> {
    let surface = &report.surface;
    let share = |n: usize| format!("{:.1} %", 100.0 * n as f64 / surface.cells.max(1) as f64);
    let expected = surface.counts.expected_share().map_or("–".to_owned(), |share| format!("{:.0} %", 100.0 * share));
    let seconds: f64 = report.stages.iter().map(|stage| stage.seconds).sum();
    let name = config.output.file_name().unwrap_or_default().to_string_lossy();
    let pointing = &report.pointing;
    let mut page = JobPage {
        title: format!("Surface model {name}"),
        lead: format!(
            "{} cells of {:.2} m from {} images: {} observed, {} filled, {} void. {} {}, heights above: {}.",
            grouped(surface.cells),
            cell_m,
            report.images.len(),
            share(surface.counts.observed),
            share(surface.counts.filled),
            share(surface.counts.void),
            days(report),
            crs.horizontal_definition(),
            crs.vertical,
        ),
        cards: vec![
            (share(surface.counts.observed), "of the cells observed"),
            (share(surface.counts.filled), "filled, hatched on the maps"),
            (expected, "of the heights expected to be right"),
            (median_text(maps.sigma()), "median σ of a height"),
            (format!("{:.2} px", pointing.residual_after_px), "residual of the tie points"),
            (format!("{seconds:.0} s"), "time"),
        ],
        notes: report.warnings.clone(),
        layers: maps.layers(),
        hatched: Some(maps.filled.clone()),
        ..JobPage::default()
    };
    page.plots.extend(histogram("Heights", "height, m", maps.heights(), None));
    page.plots.extend(histogram("Standard deviations", "σ, m", maps.sigma(), Some(SIGMA_END)));
    page.plots.extend(residual_plot(report));
    page.plots.extend(residual_maps(report));
    page.plots.push(time_plot(report));
    page.tables = vec![image_table(report), quality_table(report)];
    page.tables.extend(report.pointing.control.as_ref().map(control_table));
    page.tables.extend([pair_table(report), choice_table(report)]);
    page.links = links;
    page.facts = facts(report);
    page.html()
}

fn median_text(sigma: &raster::Grid<f32>) -> String {
    let mut values: Vec<f64> = sigma.data().iter().filter(|v| v.is_finite()).map(|&v| f64::from(v)).collect();
    percentile(&mut values, 50.0).map_or("–".to_owned(), |median| format!("{median:.2} m"))
}

/// Returns the histogram of a map up to a percentile; `None` without values.
fn histogram(
    title: &str,
    label: &str,
    map: &raster::Grid<f32>,
    end_percentile: Option<f64>,
) -> Option<(Chart, String, String)> {
    let mut values: Vec<f64> = map.data().iter().filter(|v| v.is_finite()).map(|&v| f64::from(v)).collect();
    let low = if end_percentile.is_some() { 0.0 } else { percentile(&mut values, 0.0)? };
    let high = percentile(&mut values, end_percentile.unwrap_or(100.0))?.max(low + 1e-3);
    let width = (high - low) / BARS as f64;
    let mut counts = [0usize; BARS];
    for value in values.iter().filter(|v| (low..=high).contains(*v)) {
        counts[(((value - low) / width) as usize).min(BARS - 1)] += 1;
    }
    let share = |count: usize| 100.0 * count as f64 / values.len() as f64;
    let most = counts.iter().copied().max().unwrap_or(0);
    let y = Axis::linear("share of the cells, %", 0.0, 1.08 * share(most));
    let mut chart = Chart::new(title, Axis::linear(label, low, high), y);
    for (i, &count) in counts.iter().enumerate() {
        let from = low + i as f64 * width;
        chart.bar("bar", (from, from + 0.9 * width), share(count));
    }
    let rest = end_percentile.map_or(String::new(), |end| format!(" The highest {:.0} % are left out.", 100.0 - end));
    Some((chart, title.to_owned(), format!("Filled cells are included.{rest}")))
}

/// Returns the residuals of the tie points by image; `None` without any.
fn residual_plot(report: &DsmReport) -> Option<(Chart, String, String)> {
    let images = &report.pointing.images;
    let known: Vec<f64> = images.iter().map(|i| i.residual_px).collect();
    let most = known.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    if most <= 0.0 || known.len() > IMAGES_MAX {
        return None;
    }
    let names = Axis::names("image", (1..=known.len()).map(|number| number.to_string()));
    let mut chart = Chart::new("Residuals", names, Axis::linear("residual, px", 0.0, 1.1 * most));
    for (i, value) in known.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        chart.bar("bar", (i as f64 + 0.15, i as f64 + 0.85), *value);
    }
    let caption = "Robust standard deviation of the tie points of each image after the correction, outliers included.";
    Some((chart, "Residuals by image".to_owned(), caption.to_owned()))
}

/// Returns the residuals of the tie points at their places in the images.
fn residual_maps(report: &DsmReport) -> Vec<(Chart, String, String)> {
    let images = &report.pointing.images;
    let mut chosen: Vec<usize> = (0..images.len()).filter(|&i| !images[i].tie_residuals_px.is_empty()).collect();
    chosen.sort_by(|&a, &b| images[b].residual_px.total_cmp(&images[a].residual_px));
    chosen.truncate(MAPS_MAX);
    chosen.sort_unstable();
    let map = |i: usize| {
        let image = &images[i];
        let point = |&[sample, line, along, across]: &[f64; 4]| PointResidual {
            at: [sample, line],
            residual_px: [along, across],
        };
        let points: Vec<PointResidual> = image.tie_residuals_px.iter().map(point).collect();
        let size = report.images.get(i)?.size;
        let title = format!("Residuals in image {}", i + 1);
        let (chart, magnification) = residual_map(&title, size, &points)?;
        let caption = format!(
            "{} of {} tie points of {}, drawn {magnification} times as long as they are.",
            points.len(),
            image.inliers,
            file_name(&image.path),
        );
        Some((chart, title, caption))
    };
    chosen.into_iter().filter_map(map).collect()
}

fn time_plot(report: &DsmReport) -> (Chart, String, String) {
    let stages = &report.stages;
    let most = stages.iter().map(|stage| stage.seconds).fold(0.0, f64::max);
    let names = Axis::names("stage", (1..=stages.len()).map(|number| number.to_string()));
    let mut chart = Chart::new("Times", names, Axis::linear("wall time, s", 0.0, 1.1 * most));
    for (i, stage) in stages.iter().enumerate() {
        chart.bar("bar", (i as f64 + 0.15, i as f64 + 0.85), stage.seconds);
    }
    let named: Vec<String> = (1..).zip(stages).map(|(n, s)| format!("{n} {} {:.1} s", s.stage, s.seconds)).collect();
    (chart, "Times".to_owned(), format!("{}.", named.join(", ")))
}

fn pair_table(report: &DsmReport) -> JobTable {
    let row = |pair: &crate::PairReport| {
        let g = &pair.geometry;
        vec![
            format!("{} and {}", pair.images.0, pair.images.1),
            format!("{:.1}", g.angle_deg),
            format!("{:.0} %", 100.0 * g.overlap),
            format!("{:.2}", g.parallax_px_per_m),
            pair.ties.to_string(),
        ]
    };
    JobTable {
        title: "Pairs".to_owned(),
        heads: ["images", "angle, °", "overlap", "parallax, px/m", "tie points"].map(str::to_owned).to_vec(),
        rows: report.pairs.iter().map(row).collect(),
    }
}

fn control_table(control: &ControlReport) -> JobTable {
    JobTable {
        title: "Residuals of the ground points".to_owned(),
        heads: ControlReport::HEADS.map(str::to_owned).to_vec(),
        rows: control.rows().into_iter().map(Vec::from).collect(),
    }
}

fn choice_table(report: &DsmReport) -> JobTable {
    JobTable {
        title: "Choices".to_owned(),
        heads: ["what", "value", "reason"].map(str::to_owned).to_vec(),
        rows: report.choices.iter().map(|c| vec![c.name.clone(), c.value.clone(), c.reason.clone()]).collect(),
    }
}

fn facts(report: &DsmReport) -> Vec<(String, String)> {
    let (pointing, range) = (&report.pointing, &report.height_range_m);
    let mut facts = vec![
        ("program".to_owned(), format!("skysweep {}", report.version)),
        ("heights searched".to_owned(), format!("{:.1} to {:.1} m above the ellipsoid", range.low_m, range.high_m)),
        (
            "pointing".to_owned(),
            format!(
                "{} tracks, {} of them no outliers; residual {:.2} px before the correction, {:.2} px after",
                pointing.tracks, pointing.inliers, pointing.residual_before_px, pointing.residual_after_px
            ),
        ),
        ("speckle removed".to_owned(), format!("{} cells", report.surface.counts.speckle_removed)),
    ];
    if let Some(control) = &pointing.control {
        let error = |value: Option<f64>| value.map_or("–".to_owned(), |v| format!("{v:.2} m"));
        let text = format!(
            "{} control points, {} check points; CE90 {}, LE90 {}",
            control.control.len(),
            control.checks.len(),
            error(control.ce90_m),
            error(control.le90_m)
        );
        facts.push(("ground points".to_owned(), text));
    }
    if let Some(reference) = &pointing.reference {
        let [east, north, up] = reference.shift_m;
        let [x, y, z] = reference.deviation_m;
        let text = format!(
            "{}: moved by {east:.2} m east, {north:.2} m north, {up:.2} m up, with standard errors of {x:.2}, {y:.2} \
             and {z:.2} m; NMAD {:.2} m before, {:.2} m after",
            file_name(&reference.path),
            reference.nmad_before_m,
            reference.nmad_after_m
        );
        facts.push(("reference".to_owned(), text));
    }
    if let Some(chunks) = &report.chunks {
        let text = format!(
            "{} computed, {} that no two images see, {} failed",
            chunks.done,
            chunks.unseen,
            chunks.failed.len()
        );
        facts.push(("chunks".to_owned(), text));
    }
    facts.extend(report.peak_memory_mb.map(|mb| ("peak memory".to_owned(), format!("{mb:.0} MB"))));
    facts
}
