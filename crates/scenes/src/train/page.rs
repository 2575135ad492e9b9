//! The page of a training: curves of the loss, and the views that were held out.

use std::path::Path;

use raster::Grid;
use report::{Axis, Chart, Comparison, JobPage};
use serde::Serialize;

use super::report::LossPoint;
use job::files::FileError;
use job::report_page;

/// Longest side of a view on the page, pixels.
const SIDE_MAX: usize = 640;
/// Most views with pictures on the page, each of which has about two megabytes. The folder of the
/// renderings has all.
const VIEWS_MAX: usize = 24;

/// Writes a report and its page.
pub(super) fn write(
    path: &Path,
    lead: &str,
    report: &impl Serialize,
    losses: &[LossPoint],
    mut comparisons: Vec<Comparison>,
    overwrite: bool,
) -> Result<(), FileError> {
    let value = serde_json::to_value(report)?;
    let mut page = JobPage { plots: plots(losses), ..JobPage::of_report("Training", lead, &value) };
    if comparisons.len() > VIEWS_MAX {
        page.notes.push(format!("{VIEWS_MAX} of {} held-out views have their pictures here.", comparisons.len()));
        comparisons.truncate(VIEWS_MAX);
    }
    page.comparisons = comparisons;
    report_page::write_page(path, &page, report, overwrite)
}

fn plots(losses: &[LossPoint]) -> Vec<(Chart, String, String)> {
    let Some(last) = losses.last() else { return Vec::new() };
    let iterations = || Axis::linear("iteration", 0.0, f64::from(last.iteration));
    let highest = |of: fn(&LossPoint) -> f64| losses.iter().map(of).fold(f64::MIN_POSITIVE, f64::max);
    let points = |of: fn(&LossPoint) -> f64| losses.iter().map(move |p| (f64::from(p.iteration), of(p)));
    let top = highest(|p| p.total).max(highest(|p| p.colour));
    let mut loss = Chart::new("Loss by iteration", iterations(), Axis::linear("loss", 0.0, 1.05 * top));
    loss.line("line", points(|p| p.total));
    loss.line("line2", points(|p| p.colour));
    let most = highest(|p| p.splats as f64);
    let mut count = Chart::new("Splats by iteration", iterations(), Axis::linear("splats", 0.0, 1.05 * most));
    count.line("line", points(|p| p.splats as f64));
    vec![
        (
            loss,
            "Loss".to_owned(),
            "All terms with their weights, and the term of the colours (second line).".to_owned(),
        ),
        (count, "Splats".to_owned(), "Number of splats, which are split and removed.".to_owned()),
    ]
}

/// Returns what the page shows of a view that was not trained on.
pub(super) fn comparison(
    name: &str,
    truth: &Grid<[f32; 3]>,
    shown: &Grid<[f32; 3]>,
    (psnr_db, ssim, ms_ssim): (Option<f64>, Option<f64>, Option<f64>),
) -> Comparison {
    let number = |value: Option<f64>, digits: usize| value.map_or("none".to_owned(), |v| format!("{v:.digits$}"));
    Comparison {
        name: name.to_owned(),
        truth: thinned(truth),
        shown: thinned(shown),
        caption: format!(
            "This view was not trained on: PSNR {} dB, SSIM {}, MS-SSIM {}.",
            number(psnr_db, 2),
            number(ssim, 3),
            number(ms_ssim, 3)
        ),
    }
}

/// Returns a picture in bytes.
pub(super) fn bytes(picture: &Grid<[f32; 3]>) -> Grid<[u8; 3]> {
    picture.map(|p| p.map(|c| if c.is_finite() { (255.0 * c.clamp(0.0, 1.0)).round() as u8 } else { 0 }))
}

/// Returns a picture thinned to the size of the page.
fn thinned(picture: &Grid<[f32; 3]>) -> Grid<[u8; 3]> {
    let step = picture.width().max(picture.height()).div_ceil(SIDE_MAX).max(1);
    let (width, height) = (picture.width().div_ceil(step), picture.height().div_ceil(step));
    let picture = bytes(picture);
    let pixels = (0..width * height).map(|i| picture[(i % width * step, i / width * step)]).collect();
    Grid::from_vec(width, height, pixels).expect("as many values as pixels")
}
