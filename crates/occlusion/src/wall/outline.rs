//! Forms of a wall among a few cells: a function of the position that is positive on the upper
//! side.
//!
//! Positions are (columns, rows) from the middle of four cells. The functions are distances in
//! cells: exact for lines, approximate otherwise.

use super::curve::Curve;
use super::sample::Sample;

/// The form of a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Outline {
    /// Straight or round.
    Edge(Curve),
    /// A corner: the intersection of two upper sides.
    Within(Curve, Curve),
    /// A corner: the union of two upper sides.
    Around(Curve, Curve),
    /// A strip that starts at the curve; its width in cells.
    Strip(Curve, f32),
}

impl Outline {
    /// Returns the signed distance of a position, positive on the upper side.
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
