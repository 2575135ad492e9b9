//! Heights that the surface itself hides.
//!
//! A height is observed where two views see it. A pit between houses, whose bottom more probable
//! heights hide from all views but one, was not seen: something else looks like it. A few of them
//! would make the ground of a whole quarter too low.

use raster::{Grid, lowest};
use sweep::fusion::{GridSight, occlusion_bounds};

/// Only heights that are hardly more often wrong than right hide the ground: a single wrong one
/// would throw a long shadow. On weak surfaces most of the ground itself lies just below one half.
pub(super) const TRUSTED: f32 = 0.45;
/// Bounds of classes of probability. Heights of one class are hidden by those of higher ones only:
/// of two heights that exclude each other, the more probable one stands. Heights above the last
/// bound are kept: most of them are right.
const CLASSES: [f32; 4] = [0.0, TRUSTED, 0.6, 0.75];
/// A surface hides what lies behind it where it is as high this many cells to each side: the edge
/// of a roof is often found a cell too far out, where two views see past it to the ground.
const REACH: usize = 1;

/// Drops the heights that lie more than `tolerance_m` below what more probable ones hide from all
/// views but one. `right` is the probability of each height.
pub(crate) fn drop_hidden(height_m: &mut Grid<f32>, right: &Grid<f32>, sights: &[GridSight], tolerance_m: f32) {
    for class in CLASSES.windows(2) {
        let is_in_class = |i: &usize| !height_m.data()[*i].is_nan() && (class[0]..class[1]).contains(&right.data()[*i]);
        let doubted: Vec<usize> = (0..height_m.data().len()).filter(is_in_class).collect();
        let bounds = occlusion_bounds(&solid(height_m, right, class[1]), sights, &doubted);
        for (bound_m, i) in bounds.into_iter().zip(doubted).filter(|(bound_m, _)| *bound_m < f32::INFINITY) {
            let height = &mut height_m.data_mut()[i];
            if *height < bound_m - tolerance_m {
                *height = f32::NAN;
            }
        }
    }
}

/// Returns the lowest height around each cell, NaN where one around is not known with a probability
/// of `right_min`.
fn solid(height_m: &Grid<f32>, right: &Grid<f32>, right_min: f32) -> Grid<f32> {
    let mut known = height_m.clone();
    let cells = known.data_mut().iter_mut().zip(right.data());
    cells.filter(|(h, right)| h.is_nan() || **right < right_min).for_each(|(h, _)| *h = f32::MIN);
    lowest(&known, REACH).map(|h| if *h == f32::MIN { f32::NAN } else { *h })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two houses of 20 m on flat ground, and a pit of 5 × 5 m in the street between them.
    fn street(pit_m: f32) -> Grid<f32> {
        let mut height_m = Grid::filled(80, 40, 0.0f32);
        (10..30).for_each(|y| [15..30, 50..65].into_iter().for_each(|house| height_m.row_mut(y)[house].fill(20.0)));
        (18..23).for_each(|y| height_m.row_mut(y)[38..43].fill(pit_m));
        height_m
    }

    /// Returns the number of heights that are dropped.
    fn dropped(pit_m: f32, right_in_pit: f32, leans: &[f64]) -> usize {
        let mut height_m = street(pit_m);
        let right = height_m.map(|h| if *h == pit_m { right_in_pit } else { 0.8 });
        let [images, gaps] = [true, false].map(|value| height_m.map(|_| value));
        let sight = |lean: &f64| GridSight { cells_per_m: [*lean, 0.0], images: images.clone(), gaps: gaps.clone() };
        let sights: Vec<GridSight> = leans.iter().map(sight).collect();
        drop_hidden(&mut height_m, &right, &sights, 1.0);
        height_m.data().iter().filter(|h| h.is_nan()).count()
    }

    #[test]
    fn a_pit_that_houses_hide_from_all_but_one_view_is_dropped() {
        assert_eq!(dropped(-60.0, 0.5, &[0.4, -0.2]), 25);
    }

    #[test]
    fn a_pit_that_two_views_see_stays() {
        assert_eq!(dropped(-60.0, 0.5, &[0.02, -0.02, 0.4]), 0);
    }

    #[test]
    fn the_more_probable_one_of_two_heights_stays() {
        assert_eq!(dropped(-60.0, 0.9, &[0.4, -0.2]), 0);
    }

    #[test]
    fn ground_beside_a_house_stays_where_the_roof_reaches_a_cell_too_far() {
        assert_eq!(dropped(-0.5, 0.5, &[0.4, -0.2]), 0);
    }
}
