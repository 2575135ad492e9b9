//! A view: an image pyramid with its camera.

use camera::RpcCamera;
use raster::Grid;

/// One image of the scene. Invalid pixels (no-data, masked) are NaN on every level.
#[derive(Debug, Clone)]
pub struct View {
    /// The camera of level 0, corrected.
    pub camera: RpcCamera,
    /// Level 0 is the full resolution; each level halves the one before it.
    pub levels: Vec<Grid<f32>>,
    /// Standard deviation of the image noise at level 0, grey values: patches flatter than this carry no information.
    pub noise: f32,
}

impl View {
    /// The noise to expect on a level: averaging four pixels halves it, quantisation apart.
    pub fn noise_at(&self, level: usize) -> f32 {
        self.noise / (1 << level) as f32
    }
}
