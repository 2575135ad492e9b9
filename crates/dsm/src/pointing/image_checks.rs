//! What the tie points show about the images themselves: an image that does not belong to the
//! others, an image whose pointing is grossly off.

use camera::ImageCorrection;

use crate::pointing::ties::{PairTies, TIES_MIN};

/// A pointing error larger than this is gross, pixels: the deviation that the adjustment expects.
/// The raw pointing of the real scenes of WorldView, Pléiades and ZY-3 is 0.5 to 6 pixels off.
const GROSS_PX: f64 = 10.0;

/// Returns the views that tie points do not connect with most of the others; none when all are
/// connected. The pointing of such a view is not known. [`TIES_MIN`] ties make a connection.
pub(crate) fn unconnected(views: usize, ties: &[PairTies]) -> Vec<usize> {
    let mut group: Vec<usize> = (0..views).collect();
    for t in ties.iter().filter(|t| t.ties.len() >= TIES_MIN) {
        let (a, b) = (group[t.pair.first], group[t.pair.second]);
        group.iter_mut().filter(|g| **g == a.max(b)).for_each(|g| *g = a.min(b));
    }
    let size = |g: usize| group.iter().filter(|x| **x == g).count();
    let count = |g: usize| ties.iter().filter(|t| group[t.pair.first] == g).map(|t| t.ties.len()).sum::<usize>();
    let largest = (0..views).max_by_key(|&g| (size(g), count(g), views - g)).unwrap_or(0);
    if size(largest) < 2 { Vec::new() } else { (0..views).filter(|&v| group[v] != largest).collect() }
}

/// Returns the views whose corrections are further from those of every other view than pointing
/// errors go, with the distance to the nearest one in pixels.
pub(crate) fn grossly_off(corrections: &[ImageCorrection]) -> Vec<(usize, f64)> {
    let shift = |i: usize| corrections[i].translation_px;
    let apart = |i: usize, j: usize| (shift(i)[0] - shift(j)[0]).hypot(shift(i)[1] - shift(j)[1]);
    let n = corrections.len();
    let nearest = |i: usize| (0..n).filter(|&j| j != i).map(|j| apart(i, j)).fold(f64::INFINITY, f64::min);
    (0..n).map(|i| (i, nearest(i))).filter(|(_, d)| d.is_finite() && *d > GROSS_PX).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use camera::ImagePoint;
    use reconstruct::ImagePair;
    use sweep::pointing::Tie;

    fn ties(first: usize, second: usize, apart_px: f64) -> PairTies {
        let tie = |i: usize| {
            let at = ImagePoint::new(i as f64 * 7.0, i as f64 * 3.0);
            Tie { reference: at, source: ImagePoint::new(at.sample + apart_px, at.line), correlation: 0.9 }
        };
        PairTies::new(ImagePair { first, second }, (0..20).map(tie).collect())
    }

    #[test]
    fn the_largest_group_stays() {
        assert_eq!(unconnected(4, &[ties(0, 1, 5.0), ties(1, 3, 5.0)]), [2]);
        assert_eq!(unconnected(5, &[ties(0, 1, 5.0), ties(2, 3, 5.0), ties(3, 4, 5.0)]), [0, 1]);
        assert_eq!(unconnected(3, &[]), Vec::<usize>::new());
    }

    #[test]
    fn the_odd_one_is_named_or_both_of_two() {
        let off = |x: f64| ImageCorrection::translation(x, 1.0);
        assert_eq!(grossly_off(&[off(2.0), off(-38.0), off(0.0)]), [(1, 38.0)]);
        assert_eq!(grossly_off(&[off(7.0), off(-7.0)]).len(), 2);
        assert!(grossly_off(&[off(5.0), off(-4.0), off(0.0)]).is_empty());
    }
}
