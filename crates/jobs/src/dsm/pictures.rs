//! What the ties tell about the images themselves: one that does not belong to the rest, two that are one picture, one
//! whose pointing is grossly off.

use camera::ImageCorrection;
use sweep::SweepView;

use crate::dsm::pointing::PairTies;

/// The views whose ties do not connect them with most of the others, none when all are connected: what cannot
/// be tied has a pointing of its own. `needed` ties make a connection.
pub(crate) fn unconnected(views: usize, ties: &[PairTies], needed: usize) -> Vec<usize> {
    let mut group: Vec<usize> = (0..views).collect();
    for t in ties.iter().filter(|t| t.ties.len() >= needed) {
        let (a, b) = (group[t.reference], group[t.source]);
        group.iter_mut().filter(|g| **g == a.max(b)).for_each(|g| *g = a.min(b));
    }
    let size = |g: usize| group.iter().filter(|x| **x == g).count();
    let count = |g: usize| ties.iter().filter(|t| group[t.reference] == g).map(|t| t.ties.len()).sum::<usize>();
    let largest = (0..views).max_by_key(|&g| (size(g), count(g), views - g)).unwrap_or(0);
    if size(largest) < 2 { Vec::new() } else { (0..views).filter(|&v| group[v] != largest).collect() }
}

/// Pairs whose ties lie at the same pixel of both images: one picture under two RPCs.
pub(crate) fn same_picture(ties: &[PairTies], origins: &[[f64; 2]], needed: usize) -> Option<(usize, usize)> {
    /// Two pictures of one ground do not agree to this over a scene with any relief, pixels.
    const SAME_PX: f64 = 0.1;
    let same = |t: &PairTies| {
        let (a, b) = (origins[t.reference], origins[t.source]);
        let apart = |tie: &sweep::pointing::Tie| {
            let samples = tie.source.sample + b[0] - tie.reference.sample - a[0];
            let lines = tie.source.line + b[1] - tie.reference.line - a[1];
            samples.hypot(lines)
        };
        let close = t.ties.iter().filter(|t| apart(t) < SAME_PX).count();
        t.ties.len() >= needed && 10 * close >= 9 * t.ties.len()
    };
    ties.iter().find(|t| same(t)).map(|t| (t.reference, t.source))
}

/// The views whose corrections are further than pointing errors go from every other view's, with that distance in pixels.
pub(crate) fn grossly_off(corrections: &[ImageCorrection]) -> Vec<(usize, f64)> {
    /// Twice the deviation that the adjustment expects.
    const GROSS_PX: f64 = 20.0;
    let shift = |i: usize| corrections[i].translation_px;
    let apart = |i: usize, j: usize| (shift(i)[0] - shift(j)[0]).hypot(shift(i)[1] - shift(j)[1]);
    let n = corrections.len();
    let nearest = |i: usize| (0..n).filter(|&j| j != i).map(|j| apart(i, j)).fold(f64::INFINITY, f64::min);
    (0..n).map(|i| (i, nearest(i))).filter(|(_, d)| d.is_finite() && *d > GROSS_PX).collect()
}

/// Whether a picture has any contrast.
pub(crate) fn is_blank(view: &SweepView) -> bool {
    let mut values = view.levels[0].data().iter().filter(|v| v.is_finite());
    let first = values.next();
    values.all(|v| Some(v) == first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use camera::ImagePoint;
    use sweep::pointing::Tie;

    fn ties(reference: usize, source: usize, apart_px: f64) -> PairTies {
        let tie = |i: usize| {
            let at = ImagePoint::new(i as f64 * 7.0, i as f64 * 3.0);
            Tie { reference: at, source: ImagePoint::new(at.sample + apart_px, at.line), correlation: 0.9 }
        };
        PairTies { reference, source, ties: (0..20).map(tie).collect() }
    }

    #[test]
    fn the_largest_group_stays() {
        assert_eq!(unconnected(4, &[ties(0, 1, 5.0), ties(1, 3, 5.0)], 12), [2]);
        assert_eq!(unconnected(5, &[ties(0, 1, 5.0), ties(2, 3, 5.0), ties(3, 4, 5.0)], 12), [0, 1]);
        assert_eq!(unconnected(3, &[], 12), Vec::<usize>::new());
    }

    #[test]
    fn the_odd_one_is_named_or_both_of_two() {
        let off = |x: f64| ImageCorrection::translation(x, 1.0);
        assert_eq!(grossly_off(&[off(2.0), off(-38.0), off(0.0)]), [(1, 38.0)]);
        assert_eq!(grossly_off(&[off(15.0), off(-15.0)]).len(), 2);
        assert!(grossly_off(&[off(5.0), off(-5.0), off(0.0)]).is_empty());
    }

    #[test]
    fn equal_places_are_one_picture_and_a_shift_is_not() {
        let origins = [[0.0; 2]; 2];
        assert_eq!(same_picture(&[ties(0, 1, 0.02)], &origins, 12), Some((0, 1)));
        assert_eq!(same_picture(&[ties(0, 1, 3.0)], &origins, 12), None);
        assert_eq!(same_picture(&[ties(0, 1, 3.0)], &[[3.0, 0.0], [0.0, 0.0]], 12), Some((0, 1)));
    }
}
