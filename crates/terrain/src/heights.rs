//! The heights that objects are searched in.

use raster::Grid;

/// A surface without pits, with its noise.
pub(crate) struct Heights<'a> {
    /// Heights without forests, metres.
    pub(crate) clear: &'a Grid<f32>,
    /// All heights, metres.
    pub(crate) whole: &'a Grid<f32>,
    /// Side of a cell, metres.
    pub(crate) cell_m: f64,
    /// Noise of the heights, metres.
    pub(crate) noise_m: f64,
}
