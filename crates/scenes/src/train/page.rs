//! The page of a training: curves of the loss, and the views that were held out.

use std::path::Path;

use raster::Grid;
use report::{Axis, Chart, JobPage, MapLayer};
use serde::Serialize;

use super::report::LossPoint;
use job::files::FileError;
use job::report_page;

/// Longest side of a view on the page, pixels.
const SIDE_MAX: usize = 640;
/// Columns between the two pictures.
const GAP: usize = 8;

/// Writes a report and its page.
pub(super) fn write(
    path: &Path,
    lead: &str,
    report: &impl Serialize,
    losses: &[LossPoint],
    layers: Vec<MapLayer>,
    overwrite: bool,
) -> Result<(), FileError> {
    let value = serde_json::to_value(report)?;
    let page = JobPage { layers, plots: plots(losses), ..JobPage::of_report("Training", lead, &value) };
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

/// Returns a map of the page from a picture of [`beside`].
pub(super) fn layer(name: &str, picture: Grid<[u8; 3]>) -> MapLayer {
    MapLayer {
        name: name.to_owned(),
        picture,
        caption: "The image on the left, the splats on the right; this view was not trained on.".to_owned(),
        legend: None,
    }
}

/// Returns a picture in bytes.
pub(super) fn bytes(picture: &Grid<[f32; 3]>) -> Grid<[u8; 3]> {
    picture.map(|p| p.map(|c| if c.is_finite() { (255.0 * c.clamp(0.0, 1.0)).round() as u8 } else { 0 }))
}

/// Returns two pictures of one size side by side, thinned to the size of the page.
pub(super) fn beside(left: &Grid<[f32; 3]>, right: &Grid<[f32; 3]>) -> Grid<[u8; 3]> {
    let step = left.width().max(left.height()).div_ceil(SIDE_MAX).max(1);
    let (width, height) = (left.width().div_ceil(step), left.height().div_ceil(step));
    let mut out = Grid::filled(2 * width + GAP, height, [255u8; 3]);
    for (start, picture) in [(0, bytes(left)), (width + GAP, bytes(right))] {
        for y in 0..height {
            for x in 0..width {
                out[(start + x, y)] = picture[(x * step, y * step)];
            }
        }
    }
    out
}
