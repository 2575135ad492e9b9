//! Rectangles of pixels.

use serde::{Deserialize, Serialize};

/// A rectangle of whole pixels: `[x, x + width) × [y, y + height)`. It may reach outside an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Window {
    /// First column.
    pub x: i64,
    /// First row.
    pub y: i64,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Window {
    /// The window of a whole image.
    pub const fn whole(width: usize, height: usize) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// The common part of two windows, or `None` when they do not overlap.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let x0 = self.x.max(other.x);
        let y0 = self.y.max(other.y);
        let x1 = (self.x + self.width as i64).min(other.x + other.width as i64);
        let y1 = (self.y + self.height as i64).min(other.y + other.height as i64);
        (x1 > x0 && y1 > y0).then(|| Self { x: x0, y: y0, width: (x1 - x0) as usize, height: (y1 - y0) as usize })
    }

    /// The window grown by `margin` pixels on every side.
    pub fn grown(&self, margin: usize) -> Self {
        let m = margin as i64;
        Self { x: self.x - m, y: self.y - m, width: self.width + 2 * margin, height: self.height + 2 * margin }
    }
}
