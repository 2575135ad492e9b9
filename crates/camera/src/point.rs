//! Points in an image.

use serde::{Deserialize, Serialize};

/// A position in an image. The centre of the upper-left pixel is (0, 0).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ImagePoint {
    /// Column, pixels.
    pub sample: f64,
    /// Row, pixels.
    pub line: f64,
}

impl ImagePoint {
    /// Makes a point from its column and row.
    pub const fn new(sample: f64, line: f64) -> Self {
        Self { sample, line }
    }
}
