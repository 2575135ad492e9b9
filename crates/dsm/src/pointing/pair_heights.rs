//! Whether the pairs of an image see other heights than the pairs without it: its pointing is then
//! off along the line of sight, which ties of one pair cannot tell from a height.

use std::collections::{BTreeMap, BTreeSet};

use numeric::upper_median;

use crate::pointing::ties::TIES_MIN;

/// A pair whose heights of the same ground are further from those of another pair than this many
/// pixels of parallax has an image that is off along its line of sight.
const APART_PX: f64 = 20.0;

/// Heights of the ground points of a pair under the cameras of the providers, by track.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PairHeights {
    pub(crate) views: [usize; 2],
    pub(crate) height_m: BTreeMap<usize, f64>,
    /// Parallax of the pair, pixels per metre.
    pub(crate) px_per_m: f64,
}

impl PairHeights {
    /// Returns how far the heights of two pairs are apart on ground that both see, pixels of
    /// parallax; `None` where they share fewer than [`TIES_MIN`] points. Heights of different
    /// ground, such as roofs here and streets there, say nothing.
    fn apart_px(&self, other: &Self) -> Option<f64> {
        let shared = self.height_m.iter().filter_map(|(track, own)| Some(other.height_m.get(track)? - own));
        let mut differences: Vec<f64> = shared.collect();
        let median = upper_median(&mut differences).filter(|_| differences.len() >= TIES_MIN)?;
        Some(median.abs() * self.px_per_m.min(other.px_per_m))
    }
}

/// Finds an image whose pairs see other heights than the pairs without it: the image, and how far
/// it is off in pixels. `correction_px` is the correction that the adjustment found for an image.
///
/// Any of three images could be the wrong one. The one with the largest correction is then named.
pub(crate) fn off_along_sight(pairs: &[PairHeights], correction_px: impl Fn(usize) -> f64) -> Option<(usize, f64)> {
    let others = |i: usize| pairs[i + 1..].iter().map(move |other| (&pairs[i], other));
    let both = (0..pairs.len()).flat_map(others);
    let apart: Vec<(BTreeSet<usize>, f64)> =
        both.filter_map(|(a, b)| Some((a.views.into_iter().chain(b.views).collect(), a.apart_px(b)?))).collect();
    let largest = |without: Option<usize>| {
        let of = apart.iter().filter(|(views, _)| without.is_none_or(|view| !views.contains(&view)));
        of.map(|(_, px)| *px).fold(0.0, f64::max)
    };
    let apart_px = largest(None);
    if apart_px <= APART_PX {
        return None;
    }
    let views: BTreeSet<usize> = pairs.iter().flat_map(|pair| pair.views).collect();
    let order = |a: &usize, b: &usize| {
        let rest = largest(Some(*a)).total_cmp(&largest(Some(*b)));
        rest.then(correction_px(*b).total_cmp(&correction_px(*a)))
    };
    views.into_iter().min_by(order).map(|view| (view, apart_px))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_whose_pairs_disagree_is_named() {
        let pair = |a, b, height_m| PairHeights {
            views: [a, b],
            height_m: (0..20).map(|track| (track, height_m + track as f64)).collect(),
            px_per_m: 0.5,
        };
        assert_eq!(off_along_sight(&[pair(0, 1, 200.0), pair(0, 2, 203.0), pair(1, 2, 198.0)], |_| 0.0), None);
        let four = [
            pair(0, 1, 200.0),
            pair(0, 2, 320.0),
            pair(1, 2, 90.0),
            pair(0, 3, 201.0),
            pair(1, 3, 199.0),
            pair(2, 3, 400.0),
        ];
        assert_eq!(off_along_sight(&four, |_| 0.0).map(|(view, _)| view), Some(2));
        let three = [pair(0, 1, 200.0), pair(0, 2, 320.0), pair(1, 2, 90.0)];
        let named = off_along_sight(&three, |view| [1.0, 2.0, 30.0][view]);
        assert_eq!(named.map(|(view, _)| view), Some(2));
        assert_eq!(off_along_sight(&[pair(0, 1, 200.0)], |_| 0.0), None);
    }

    #[test]
    fn roofs_of_one_pair_and_streets_of_another_are_no_contradiction() {
        let pair = |views, first: usize, height_m| PairHeights {
            views,
            height_m: (first..first + 40).map(|track| (track, height_m)).collect(),
            px_per_m: 0.5,
        };
        assert_eq!(off_along_sight(&[pair([0, 1], 0, 200.0), pair([0, 2], 40, 300.0)], |_| 0.0), None);
        let of_both = off_along_sight(&[pair([0, 1], 0, 200.0), pair([0, 2], 20, 300.0)], |_| 0.0);
        assert_eq!(of_both.map(|(_, px)| px), Some(50.0));
    }
}
