//! Forms that a wall takes among a few cells: where a function of the place is positive, there is
//! the upper side.
//!
//! Places are (columns, rows) from the middle of four cells. The functions are about distances in
//! cells: exactly so for lines.

use super::pattern::Sample;

/// A line, or a circle: a x + b y + c + k (x² + y²) with a² + b² = 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Curve {
    pub(super) a: f32,
    pub(super) b: f32,
    pub(super) c: f32,
    pub(super) k: f32,
}

impl Curve {
    #[inline]
    fn at(&self, [x, y]: [f32; 2]) -> f32 {
        self.a * x + self.b * y + self.c + self.k * (x * x + y * y)
    }

    /// A line as it is seen from a place that is (columns, rows) further.
    pub(super) fn line_from(&self, [columns, rows]: [f32; 2]) -> Self {
        Self { c: self.c + self.a * columns + self.b * rows, ..*self }
    }

    /// Whether two lines say nearly the same of the cells around.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (self.a * other.b - self.b * other.a).abs() < 0.02
            && self.a * other.a + self.b * other.b > 0.0
            && (self.c - other.c).abs() < 0.04
    }
}

/// The form of a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Outline {
    /// Straight or round.
    Edge(Curve),
    /// The corner of what is within both.
    Within(Curve, Curve),
    /// The corner of what is within one or the other.
    Around(Curve, Curve),
    /// Thinner than the cells around show: from the curve on, so many cells wide.
    Strip(Curve, f32),
}

impl Outline {
    /// Positive on the upper side.
    #[inline]
    pub(super) fn at(&self, place: [f32; 2]) -> f32 {
        match self {
            Self::Edge(curve) => curve.at(place),
            Self::Within(one, other) => one.at(place).min(other.at(place)),
            Self::Around(one, other) => one.at(place).max(other.at(place)),
            Self::Strip(side, width) => {
                let inside = side.at(place);
                inside.min(width - inside)
            }
        }
    }

    /// How far the centres on the wrong side are from it, by their weights; anything above `limit`
    /// for more than that.
    pub(super) fn loss(&self, samples: &[Sample], limit: f32) -> f32 {
        let mut sum = 0.0;
        for sample in samples {
            sum += sample.weight * (-sample.side * self.at(sample.place)).max(0.0);
            if sum > limit {
                break;
            }
        }
        sum
    }

    /// The strip from a line on that holds the upper centres and no other; `None` where there is
    /// none.
    pub(super) fn strip(side: Curve, samples: &[Sample]) -> Option<Self> {
        /// Wider strips show themselves as two edges, cells.
        const WIDEST: f32 = 3.0;
        let (mut farthest, mut beyond) = (0.0_f32, f32::INFINITY);
        for sample in samples {
            let inside = side.at(sample.place);
            if sample.side > 0.0 {
                farthest = farthest.max(inside);
            } else if inside > 0.0 {
                beyond = beyond.min(inside);
            }
        }
        (0.0 < farthest && farthest < beyond && beyond < WIDEST)
            .then(|| Self::Strip(side, farthest + (beyond - farthest) / 2.0))
    }
}
