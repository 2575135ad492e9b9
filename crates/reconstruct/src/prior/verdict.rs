//! Which buildings of a city model the images confirm and which they refute.
//!
//! The heights of the coarse levels are found without the model, so that they tell what the images
//! show by themselves. A building is refuted where the images show another height for its roof more
//! often than the model's: it was pulled down, was never built, or is wrong by metres. Where the
//! images show neither, on small roofs and on roofs without texture, a model is believed as much as
//! it was right elsewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// A building with fewer pixels, in all views together, is not judged: the coarse heights of a few
/// pixels are those of what is around them.
const PIXELS_MIN: usize = 50;
/// Least share of a building's pixels that show a height: fewer are what chance gives.
const SHOWN_MIN: f64 = 0.3;
/// A building that fewer of its pixels confirm is refuted, whatever the others show.
const CONFIRMED_MIN: f64 = 0.1;
/// Share of the judged buildings that must be confirmed for the others to be believed.
const RIGHT_MIN: f64 = 0.9;

/// What the images say about a building.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Confirmed,
    Refuted,
    Open,
}

/// Returns the buildings that are not to be used. `differences` are the heights found minus those
/// of the model, metres, of all views by the number of the building.
pub(crate) fn refuted(differences: &BTreeMap<u32, Vec<f32>>, tolerance_m: f32) -> BTreeSet<u32> {
    let verdicts: BTreeMap<u32, Verdict> =
        differences.iter().map(|(number, all)| (*number, verdict(all, tolerance_m))).collect();
    let count = |wanted: Verdict| verdicts.values().filter(|v| **v == wanted).count();
    let (right, wrong) = (count(Verdict::Confirmed), count(Verdict::Refuted));
    let is_believed = right > 0 && right as f64 >= RIGHT_MIN * (right + wrong) as f64;
    let is_out = |v: Verdict| v == Verdict::Refuted || (v == Verdict::Open && !is_believed);
    verdicts.into_iter().filter(|(_, v)| is_out(*v)).map(|(number, _)| number).collect()
}

fn verdict(differences: &[f32], tolerance_m: f32) -> Verdict {
    let mut sorted = differences.to_vec();
    sorted.sort_by(f32::total_cmp);
    let own = sorted.iter().filter(|d| d.abs() <= tolerance_m).count();
    let is_other = |middle_m: f32| middle_m.abs() > 2.0 * tolerance_m;
    let other = densest(&sorted, 2.0 * tolerance_m, is_other).map_or(0, |range| range.len());
    let share = |count: usize| count as f64 / sorted.len() as f64;
    if sorted.len() < PIXELS_MIN {
        Verdict::Open
    } else if own >= other && share(own) >= SHOWN_MIN {
        Verdict::Confirmed
    } else if share(own) < CONFIRMED_MIN || (other > own && share(other) >= SHOWN_MIN) {
        Verdict::Refuted
    } else {
        Verdict::Open
    }
}

/// Returns the range of sorted values that holds most of them within a width, among the ranges
/// whose middle is wanted; `None` if there is none.
pub(crate) fn densest(sorted: &[f32], width: f32, is_wanted: impl Fn(f32) -> bool) -> Option<Range<usize>> {
    let (mut best, mut from): (Option<Range<usize>>, usize) = (None, 0);
    for to in 1..=sorted.len() {
        while sorted[to - 1] - sorted[from] > width {
            from += 1;
        }
        let is_more = best.as_ref().is_none_or(|best| to - from > best.len());
        if is_more && is_wanted(0.5 * (sorted[from] + sorted[to - 1])) {
            best = Some(from..to);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A building whose pixels show the model's height, another one 5 m lower, and anything.
    fn building(right: usize, lower: usize, anything: usize) -> Vec<f32> {
        let noise = (0..anything).map(|i| ((i * 7919) % 601) as f32 * 0.1 - 30.0);
        (0..right).map(|_| 0.2).chain((0..lower).map(|_| -5.0)).chain(noise).collect()
    }

    #[test]
    fn buildings_at_another_height_are_refuted_and_right_ones_with_noise_are_not() {
        let of = |all: Vec<f32>| verdict(&all, 1.0);
        assert_eq!(of(building(100, 0, 100)), Verdict::Confirmed);
        assert_eq!(of(building(0, 100, 100)), Verdict::Refuted);
        assert_eq!(of(building(40, 100, 60)), Verdict::Refuted);
        assert_eq!(of(building(50, 20, 200)), Verdict::Open);
        assert_eq!(of(building(0, 0, 200)), Verdict::Refuted);
        assert_eq!(of(building(20, 20, 0)), Verdict::Open);
    }

    #[test]
    fn what_the_images_do_not_show_is_believed_where_the_model_was_right() {
        let model = |wrong: u32| -> BTreeMap<u32, Vec<f32>> {
            let judged = (1..=20).map(|n| (n, if n <= wrong { building(0, 90, 10) } else { building(90, 0, 10) }));
            judged.chain([(21, building(20, 0, 0))]).collect()
        };
        assert!(refuted(&model(0), 1.0).is_empty());
        assert_eq!(refuted(&model(2), 1.0), BTreeSet::from([1, 2]));
        assert_eq!(refuted(&model(5), 1.0), BTreeSet::from([1, 2, 3, 4, 5, 21]));
        assert_eq!(refuted(&BTreeMap::from([(7, building(20, 0, 0))]), 1.0), BTreeSet::from([7]));
    }

    #[test]
    fn the_densest_range_is_the_longest_one_that_is_wanted() {
        let sorted = [-9.0, -3.0, -2.5, -2.0, 0.0, 0.1, 0.2, 0.3, 8.0];
        assert_eq!(densest(&sorted, 1.0, |_| true), Some(4..8));
        assert_eq!(densest(&sorted, 1.0, |middle| middle < -1.0), Some(1..4));
        assert_eq!(densest(&[], 1.0, |_| true), None);
    }
}
