//! For each view, the choice of the views that it is compared with.

use std::collections::BTreeMap;

use geo::Polygon;

use crate::planning::places::Places;
use crate::planning::view_geometry::{ViewGeometry, angle_merit};
use crate::tuning::SweepTuning;
use crate::values::ImagePair;

/// Views that are used over one place, where there are more. Errors of heights fall with the root
/// of the number of views, while time and memory grow with it.
const VIEWS: usize = 16;
/// Views by which the heights of a chunk are found, over one place: two that confirm a height, and
/// one more for each that may be hidden or clouded there. Towers stand in any of them.
const PROBING_VIEWS: usize = 4;
/// Least rating of an angle, so that tie points decide among pairs with bad angles.
const MERIT_MIN: f64 = 0.05;

/// The part of the ground that each view shows; `None` for a view that is not used.
pub type Parts = Vec<Option<Polygon<f64>>>;

/// For each view, the views that it can be compared with, the best ones first.
pub struct SourceCandidates<'a> {
    by_merit: Vec<Vec<usize>>,
    /// Sum of the merits of the sources that a view would have if all saw the same ground.
    worth: Vec<f64>,
    outlines: &'a [Polygon<f64>],
    usual: usize,
}

impl<'a> SourceCandidates<'a> {
    /// Rates the pairs that can be compared, by the number of their tie points and their angles.
    /// `references` are the views that get heights; all when `None`.
    pub fn of(
        geometry: &'a ViewGeometry,
        ties: &BTreeMap<ImagePair, usize>,
        references: Option<&[usize]>,
        tuning: &SweepTuning,
    ) -> Self {
        let merit = |i: usize, j: usize| {
            let pair = ImagePair::new(i, j);
            let angle_deg = geometry.pair(pair).map_or(0.0, |p| p.angle_deg);
            // One more, so that angles decide where nothing was matched.
            (1 + ties.get(&pair.ordered()).copied().unwrap_or(0)) as f64 * angle_merit(angle_deg).max(MERIT_MIN)
        };
        let n = geometry.outlines.len();
        let rated = |i: usize| {
            let is_asked = references.is_none_or(|r| r.contains(&i));
            let is_pair = |j: &usize| ties.contains_key(&ImagePair::new(i, *j).ordered());
            let mut own: Vec<usize> = (0..n).filter(|j| is_asked && is_pair(j)).collect();
            own.sort_by(|&a, &b| merit(i, b).total_cmp(&merit(i, a)).then(a.cmp(&b)));
            own
        };
        let by_merit: Vec<Vec<usize>> = (0..n).map(rated).collect();
        let worth = |(i, own): (usize, &Vec<usize>)| own.iter().take(tuning.sources).map(|&j| merit(i, j)).sum();
        let worth = by_merit.iter().enumerate().map(worth).collect();
        Self { by_merit, worth, outlines: &geometry.outlines, usual: tuning.sources }
    }

    /// Keeps the best `VIEWS` views over each place of the ground, and at most twice as many in
    /// all. `parts` are the parts of the ground that the views show.
    pub fn best_views(&self, ground: &Polygon<f64>, parts: Parts) -> Parts {
        self.best(VIEWS, ground, parts)
    }

    /// Keeps the best `PROBING_VIEWS` in the same way: enough to tell which heights there are.
    pub fn probing_views(&self, ground: &Polygon<f64>, parts: Parts) -> Parts {
        self.best(PROBING_VIEWS, ground, parts)
    }

    fn best(&self, count: usize, ground: &Polygon<f64>, mut parts: Parts) -> Parts {
        let mut order: Vec<usize> = (0..parts.len()).filter(|i| parts[*i].is_some()).collect();
        if order.len() <= count {
            return parts;
        }
        order.sort_by(|&a, &b| self.worth[b].total_cmp(&self.worth[a]).then(a.cmp(&b)));
        let best = Places::over(ground).choose(order.into_iter().map(|i| (i, &self.outlines[i])), count);
        parts.iter_mut().enumerate().filter(|(i, _)| !best.contains(i)).for_each(|(_, part)| *part = None);
        parts
    }

    /// Chooses the sources of each view over all that it shows.
    pub fn choose_everywhere(&self) -> Vec<Vec<usize>> {
        self.choose(&self.outlines.iter().cloned().map(Some).collect::<Parts>())
    }

    /// Chooses the sources of each view over the part of it that counts, in the frame of the
    /// outlines. A view without a part has no sources and is none.
    pub fn choose(&self, parts: &[Option<Polygon<f64>>]) -> Vec<Vec<usize>> {
        let choose = |(part, own): (&Option<Polygon<f64>>, &Vec<usize>)| {
            let Some(part) = part else { return Vec::new() };
            let seen = own.iter().filter(|j| parts[**j].is_some()).map(|j| (*j, &self.outlines[*j]));
            Places::over(part).choose(seen, self.usual)
        };
        parts.iter().zip(&self.by_merit).map(choose).collect()
    }
}

/// Returns the largest parallax of the pairs of views and sources, pixels per metre.
pub fn widest_parallax(sources: &[Vec<usize>], geometry: &ViewGeometry) -> f64 {
    let used = sources.iter().enumerate().flat_map(|(i, s)| s.iter().map(move |&j| ImagePair::new(i, j)));
    used.filter_map(|pair| geometry.pair(pair)).map(|p| p.parallax_px_per_m).fold(0.0, f64::max)
}
