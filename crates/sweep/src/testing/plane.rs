//! Views of planes for tests.

use camera::{ImagePoint, RpcCamera};
use raster::Grid;

use super::camera::METRES_PER_DEGREE;
use crate::view::SweepView;

/// Returns a smooth texture over the ground, different everywhere, with detail down to a few
/// pixels.
fn texture(east_m: f64, north_m: f64) -> f32 {
    let wave = |a: f64, b: f64, c: f64| (a * east_m + b * north_m + c).sin();
    let value = wave(1.1, 0.3, 0.0) + wave(-0.4, 1.3, 1.0) + wave(0.9, -0.8, 2.0) + wave(0.13, 0.21, 3.0);
    (200.0 + 40.0 * value + 25.0 * wave(2.1, 1.7, 0.5) * wave(0.37, -0.23, 0.2)) as f32
}

/// Renders the view that a camera has of the ground at a constant height.
pub(crate) fn view_of_plane(camera: RpcCamera, size: usize, height_m: f64) -> SweepView {
    let mut image = Grid::filled(size, size, 0.0);
    for line in 0..size {
        for sample in 0..size {
            let at = ImagePoint::new(sample as f64, line as f64);
            let g = camera.localize(at, height_m).expect("the test camera is linear");
            image[(sample, line)] = texture(g.lon_deg * METRES_PER_DEGREE, g.lat_deg * METRES_PER_DEGREE);
        }
    }
    SweepView::new(camera, image)
}
