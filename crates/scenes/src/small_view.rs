//! Views of pinhole cameras whose images are made smaller: their cameras and their pixels.

use ::train::PinholeView;
use camera::Lens;
use formats::colmap::ColmapView;

/// Returns the view of a pinhole camera whose image is smaller by a factor; `None` for other
/// lenses.
pub(crate) fn pinhole(view: &ColmapView, lens: &Lens, shrink: usize) -> Option<PinholeView> {
    if !lens.model().is_pinhole() {
        return None;
    }
    let k = shrink as f64;
    let principal = [lens.principal_point().sample, lens.principal_point().line];
    Some(PinholeView {
        rotation: view.pose.rotation,
        centre: view.pose.centre,
        focal_px: lens.focal_px().map(|f| f / k),
        principal_px: principal.map(|p| (p + 0.5) / k - 0.5),
        size: [lens.width() / shrink, lens.height() / shrink],
    })
}

/// Returns the means of squares of pixels.
pub(crate) fn shrunk(size: [usize; 2], by: usize, value: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    let mean = |i: usize| {
        let (x, y) = (i % size[0] * by, i / size[0] * by);
        let sum: f32 = (0..by * by).map(|k| value(x + k % by, y + k / by)).sum();
        sum / (by * by) as f32
    };
    (0..size[0] * size[1]).map(mean).collect()
}
