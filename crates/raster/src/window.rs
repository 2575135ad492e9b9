//! Rectangles of pixels.

use serde::{Deserialize, Serialize};

/// Rectangle of whole pixels: `[x, x + width) × [y, y + height)`. It may reach outside an image.
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
    /// Returns the window of a whole image.
    pub const fn whole(width: usize, height: usize) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// Returns the common part of two windows, or `None` if they do not overlap.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let x0 = self.x.max(other.x);
        let y0 = self.y.max(other.y);
        let x1 = end(self.x, self.width).min(end(other.x, other.width));
        let y1 = end(self.y, self.height).min(end(other.y, other.height));
        (x1 > x0 && y1 > y0).then(|| Self { x: x0, y: y0, width: (x1 - x0) as usize, height: (y1 - y0) as usize })
    }

    /// Returns the least window that holds two.
    pub fn union(&self, other: &Self) -> Self {
        let (x, y) = (self.x.min(other.x), self.y.min(other.y));
        let x1 = end(self.x, self.width).max(end(other.x, other.width));
        let y1 = end(self.y, self.height).max(end(other.y, other.height));
        Self { x, y, width: x1.abs_diff(x) as usize, height: y1.abs_diff(y) as usize }
    }

    /// Returns the window grown by `margin` pixels on every side.
    pub fn grown(&self, margin: usize) -> Self {
        let m = margin as i64;
        let grown = |side: usize| side.saturating_add(margin.saturating_mul(2));
        Self {
            x: self.x.saturating_sub(m),
            y: self.y.saturating_sub(m),
            width: grown(self.width),
            height: grown(self.height),
        }
    }
}

/// Returns one past the last pixel, saturated at the end of the number range.
fn end(start: i64, length: usize) -> i64 {
    start.saturating_add(i64::try_from(length).unwrap_or(i64::MAX))
}
