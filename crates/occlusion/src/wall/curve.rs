//! Lines and circles that separate the upper cells from the lower ones.
//!
//! Positions are (columns, rows) from the middle of four cells.

/// A line, or a circle: a x + b y + c + k (x² + y²) with a² + b² = 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Curve {
    pub(super) a: f32,
    pub(super) b: f32,
    pub(super) c: f32,
    pub(super) k: f32,
}

impl Curve {
    /// Returns the signed distance of a position in cells: exact for lines, approximate for
    /// circles.
    #[inline]
    pub(super) fn at(&self, [x, y]: [f32; 2]) -> f32 {
        self.a * x + self.b * y + self.c + self.k * (x * x + y * y)
    }

    /// Returns a line relative to a position that is (columns, rows) further.
    pub(super) fn line_from(&self, [columns, rows]: [f32; 2]) -> Self {
        Self { c: self.c + self.a * columns + self.b * rows, ..*self }
    }

    /// Returns whether two lines separate the cells around in nearly the same way.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (self.a * other.b - self.b * other.a).abs() < 0.02
            && self.a * other.a + self.b * other.b > 0.0
            && (self.c - other.c).abs() < 0.04
    }
}
