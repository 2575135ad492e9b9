//! Tie points of pairs of views, joined to tracks over all views.
//!
//! Ties that share a place in a view belong to one ground point. A track sees each view once: where
//! joined ties would give a view two places, they contradict each other, and the tie with the lower
//! correlation is left out. What it would have joined stays apart.

use std::collections::BTreeMap;

use camera::ImagePoint;

use super::intersect::Track;
use super::pair::Tie;

/// A tie point with the views in which its places lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedTie {
    /// View of the reference place.
    pub reference: usize,
    /// View of the source place.
    pub source: usize,
    /// The tie.
    pub tie: Tie,
}

/// Joins ties to tracks. Returns the tracks, ordered by their first places, and the number of ties
/// that contradict better ones.
///
/// ```
/// use camera::ImagePoint;
/// use sweep::pointing::{PlacedTie, Tie, join_ties};
///
/// let place = |x: f64| ImagePoint::new(x, 1.0);
/// let tie = |a, x: f64, b, y: f64| {
///     let tie = Tie { reference: place(x), source: place(y), correlation: 0.9 };
///     PlacedTie { reference: a, source: b, tie }
/// };
/// let (tracks, contradictory) = join_ties(&[tie(0, 5.0, 1, 6.0), tie(1, 6.0, 2, 7.0)]);
/// assert_eq!(tracks, [vec![(0, place(5.0)), (1, place(6.0)), (2, place(7.0))]]);
/// assert_eq!(contradictory, 0);
/// ```
pub fn join_ties(ties: &[PlacedTie]) -> (Vec<Track>, usize) {
    let mut forest = Forest::default();
    let ends: Vec<(usize, usize)> =
        ties.iter().map(|t| (forest.node(t.reference, t.tie.reference), forest.node(t.source, t.tie.source))).collect();
    let mut best: Vec<usize> = (0..ties.len()).collect();
    best.sort_by(|&a, &b| ties[b].tie.correlation.total_cmp(&ties[a].tie.correlation).then(a.cmp(&b)));
    let contradictory = best.into_iter().filter(|&i| !forest.join(ends[i])).count();
    (forest.tracks(), contradictory)
}

/// Places joined to trees (union–find).
#[derive(Default)]
struct Forest {
    numbers: BTreeMap<(usize, u64, u64), usize>,
    parent: Vec<usize>,
    /// Places of the tree of each root; empty for other nodes.
    seen: Vec<Track>,
}

impl Forest {
    /// Returns the number of a place, which is new if need be.
    fn node(&mut self, view: usize, place: ImagePoint) -> usize {
        let next = self.parent.len();
        let node = *self.numbers.entry((view, place.sample.to_bits(), place.line.to_bits())).or_insert(next);
        if node == next {
            self.parent.push(next);
            self.seen.push(vec![(view, place)]);
        }
        node
    }

    fn root(&mut self, mut node: usize) -> usize {
        while self.parent[node] != node {
            self.parent[node] = self.parent[self.parent[node]];
            node = self.parent[node];
        }
        node
    }

    /// Joins the trees of two places. Returns false where they see one view at two places.
    fn join(&mut self, (a, b): (usize, usize)) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return true;
        }
        let sees = |track: &Track, view: usize| track.iter().any(|(other, _)| *other == view);
        if self.seen[b].iter().any(|(view, _)| sees(&self.seen[a], *view)) {
            return false;
        }
        let moved = std::mem::take(&mut self.seen[b]);
        self.seen[a].extend(moved);
        self.parent[b] = a;
        true
    }

    /// Returns the trees of two or more places.
    fn tracks(self) -> Vec<Track> {
        let mut tracks: Vec<Track> = self.seen.into_iter().filter(|track| track.len() > 1).collect();
        tracks.iter_mut().for_each(|track| track.sort_by_key(|(view, _)| *view));
        let first = |track: &Track| (track[0].0, track[0].1.sample, track[0].1.line);
        tracks.sort_by(|a, b| {
            let (a, b) = (first(a), first(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
        });
        tracks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tie((reference, x): (usize, f64), (source, y): (usize, f64), correlation: f32) -> PlacedTie {
        let place = |x: f64| ImagePoint::new(x, 2.0 * x);
        PlacedTie { reference, source, tie: Tie { reference: place(x), source: place(y), correlation } }
    }

    fn views(track: &Track) -> Vec<usize> {
        track.iter().map(|(view, _)| *view).collect()
    }

    #[test]
    fn a_chain_and_a_star_are_one_track_each() {
        let chain = [tie((0, 1.0), (1, 2.0), 0.9), tie((1, 2.0), (2, 3.0), 0.8), tie((2, 3.0), (3, 4.0), 0.9)];
        let star = [tie((1, 50.0), (3, 60.0), 0.9), tie((1, 50.0), (0, 70.0), 0.7)];
        let ties: Vec<PlacedTie> = chain.into_iter().chain(star).collect();
        let (tracks, contradictory) = join_ties(&ties);
        assert_eq!(tracks.iter().map(views).collect::<Vec<_>>(), [vec![0, 1, 2, 3], vec![0, 1, 3]]);
        assert_eq!(contradictory, 0);
    }

    #[test]
    fn the_weaker_of_contradictory_ties_is_left_out() {
        // The last tie would give view 0 two places, 1 and 9.
        let ties = [
            tie((0, 1.0), (1, 2.0), 0.95),
            tie((0, 9.0), (2, 3.0), 0.9),
            tie((2, 3.0), (3, 4.0), 0.85),
            tie((1, 2.0), (2, 3.0), 0.8),
        ];
        let (tracks, contradictory) = join_ties(&ties);
        assert_eq!(tracks.iter().map(views).collect::<Vec<_>>(), [vec![0, 1], vec![0, 2, 3]]);
        assert_eq!(contradictory, 1);
        let mut reversed = ties;
        reversed.reverse();
        assert_eq!(join_ties(&reversed), (tracks, 1));
    }

    #[test]
    fn a_corner_found_twice_in_a_view_keeps_its_better_place() {
        let (tracks, contradictory) = join_ties(&[tie((0, 1.0), (1, 2.0), 0.8), tie((0, 1.0), (1, 2.5), 0.9)]);
        assert_eq!((tracks[0][1].1.sample, tracks.len(), contradictory), (2.5, 1, 1));
    }
}
