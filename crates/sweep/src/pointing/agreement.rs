//! Ties on which two views agree all over the ground that they share.
//!
//! The strongest corners lie where shadows end, and shadows move with the sun. Patches of a lattice
//! lie on lit ground and roofs as often as these do in the image, in images whose contrast is made
//! even, so that no edge outweighs the rest. They are searched for around the heights of ties and
//! back again. What each says alone is weak, but all true ones have the same pointing error across
//! their height trajectories, which drifts slowly over the image, while shadows are moved by as
//! much as their objects are high. The largest set that agrees is found by the mode of the errors
//! and a plane with Tukey's weights (Beaton and Tukey 1974) that starts there.
//!
//! A quarter of the lattice is searched first. Where the corners agree with it, shadows have not
//! moved them, and the rest is not needed. Where few patches agree, the shadows may have moved the
//! corners so far that the true places lie outside the search: it is repeated to both sides, and
//! around what most agree on.

use std::borrow::Cow;
use std::sync::OnceLock;

use camera::ImagePoint;
use nalgebra::{Matrix3, Vector3};
use numeric::upper_median;
use raster::{gaussian, level_from_level0, level0_from_level};
use rayon::prelude::*;

use super::off_trajectory::{PIECE_M, off_trajectory};
use super::pair::{Pair, Tie, TieConfig};
use super::ties::{ScaledPair, shared_window};
use crate::view::SweepView;

/// Patches tried for each corner that is tried. Those of a scene of 600 × 600 pixels then cover
/// each other by a quarter of their sides, and more would only repeat what these say.
const PATCHES_PER_CORNER: usize = 4;
/// Distance from its expected place within which a patch is searched for, pixels: two storeys under
/// a wide angle along the trajectory, and what shadows have displaced ties across it.
const REACH: i32 = 6;
/// Least correlation. A patch of 15 × 15 pixels of texture as strong as the noise has 0.4 to 0.5,
/// and chance likenesses among these many places reach 0.3.
const LIKENESS_MIN: f32 = 0.3;
/// Surroundings over which mean and contrast are made even, standard deviation in pixels. Of
/// squares that reach 2, 3 and 5 pixels to each side, 3 left the least; this has the same
/// deviation.
const EVEN_PX: f32 = 2.0;
/// Largest distance of the search back from the patch, pixels.
const RETURN_PX: f64 = 1.0;
/// The heights of this many ties around a patch give the height at which it is expected.
const NEAR: usize = 8;
/// Distance from where most errors lie at which one no longer counts, pixels, in the first round:
/// three deviations of the places of weak texture (0.3 px).
const COUNTS_FIRST_PX: f64 = 1.0;
/// The same in the last round for [`MANY`] patches or more. It still holds nine in ten of those
/// places, and less of the shadows that lie beside them to one side. Fewer patches show the mode
/// less sharply, by the fifth root of their number (Silverman 1986), up to [`COUNTS_MOST_PX`].
const COUNTS_LAST_PX: f64 = 0.5;
const COUNTS_MOST_PX: f64 = 0.75;
const MANY: f64 = 500.0;
/// Errors change over the image when a plane holds this many times as many patches as a constant
/// does. A smaller drift stays among the ties that count, and the adjustment sees it.
const PLANE_TIMES: f64 = 1.2;
/// At least one patch in this many agrees, or the views show nothing together. Of chance
/// likenesses one in twelve does: a pixel of the places across that are searched.
const AGREE_ONE_IN: usize = 4;
/// Of few patches a quarter may agree by chance, on the densest of many planes. Those that agree
/// are this many standard deviations more than chance likenesses would be.
const BEYOND_CHANCE: f64 = 5.0;
/// Where at least one patch in this many agrees, the search was in the right place. Of 168 pairs in
/// 20 scenes all of these were right within 0.45 px, and one of the 20 others was wrong by 7 px.
const SURE_ONE_IN: usize = 3;
/// Corners are placed more exactly than patches of any texture. Where as many as this share of them
/// agree with the patches, shadows have not moved them, and they stay as they are. Under one sun
/// nine in ten do (three scenes), under several suns a twentieth to six in seven (seven scenes).
const CORNERS_AGREE: f64 = 0.8;
/// Fewer patches than this do not determine where most agree.
const PATCHES_MIN: usize = 50;
/// Rounds of the plane: a third at the first distance, a third between, a third at the last. It
/// settles in a few.
const ROUNDS: usize = 24;

/// What a tie says: where, and how far from its height trajectory.
#[derive(Clone, Copy)]
struct Sight {
    tie: Tie,
    height_m: f64,
    across_px: f64,
}

/// A view with even contrast, made when its first pair asks for it. Empty by default.
#[derive(Debug, Default)]
pub struct EvenView(OnceLock<SweepView>);

/// On what two views agree over the ground that they share.
#[derive(Debug)]
pub struct Agreement {
    /// Those of the given ties that agree.
    pub ties: Vec<Tie>,
    /// The patches that agree.
    pub patches: Vec<Tie>,
    /// Whether so many of the given ties agree that shadows have not moved them. They are placed
    /// more exactly than patches.
    pub holds_ties: bool,
}

/// Finds the patches on which two views agree over the ground that they share; `None` where they
/// show too little together.
///
/// `ties` say at which heights to search. `even` belongs to the two views, and is kept for their
/// other pairs. All positions are in pixels of the full resolution.
pub fn agreement(
    reference: &SweepView,
    source: &SweepView,
    ties: &[Tie],
    range_m: (f64, f64),
    config: &TieConfig,
    even: [&EvenView; 2],
) -> Option<Agreement> {
    let scaled = ScaledPair::of(&Pair { reference, source }, range_m);
    let pair = scaled.pair();
    let (skip_reference, skip_source) = scaled.skipped;
    let moved = |p: ImagePoint, skipped: usize, f: fn(f64, u32) -> f64| {
        ImagePoint::new(f(p.sample, skipped as u32), f(p.line, skipped as u32))
    };
    let middle_m = 0.5 * (range_m.0 + range_m.1);
    let on_scale = |tie: &Tie| Tie {
        reference: moved(tie.reference, skip_reference, level_from_level0),
        source: moved(tie.source, skip_source, level_from_level0),
        ..*tie
    };
    let (reference, source) = (&pair.reference.camera, &pair.source.camera);
    let sight = |tie: Tie| {
        let off = off_trajectory(reference, source, &tie, middle_m)?;
        Some(Sight { tie, height_m: off.height_m, across_px: off.across_px })
    };
    let known: Vec<Sight> = ties.iter().filter_map(|tie| sight(on_scale(tie))).collect();
    let usual_px = upper_median(&mut known.iter().map(|sight| sight.across_px).collect::<Vec<f64>>())?;
    let [first, rest] = pair.lattice(&known, range_m, config);
    let kept = scaled.skipped == (0, 0);
    let even = [(pair.reference, even[0]), (pair.source, even[1])].map(|(view, even)| {
        if kept { Cow::Borrowed(even.0.get_or_init(|| evened(view))) } else { Cow::Owned(evened(view)) }
    });
    let pair = Pair { reference: &even[0], source: &even[1] };
    let search = |places: &[[f64; 2]], across_px: f64| {
        let patch = |&at: &[f64; 2]| pair.patch(at, height_near(&known, at)?, across_px, config);
        places.par_iter().filter_map(patch).collect::<Vec<Sight>>()
    };
    let holds_ties = |found: &Found| found.plane.held(&known) as f64 >= CORNERS_AGREE * known.len() as f64;
    let some = search(&first, usual_px);
    let quarter = Found::on(some.clone()).filter(|found| found.is_beyond_chance() && holds_ties(found));
    let found = quarter.or_else(|| {
        let mut all = some;
        all.extend(search(&rest, usual_px));
        let places = [first, rest].concat();
        most_agreeing(Found::on(all), usual_px, |across_px| Found::on(search(&places, across_px)))
    })?;
    let full = |sight: &Sight| Tie {
        reference: moved(sight.tie.reference, skip_reference, level0_from_level),
        source: moved(sight.tie.source, skip_source, level0_from_level),
        ..sight.tie
    };
    let agreeing = |sights: &[Sight]| sights.iter().filter(|s| found.plane.holds(s)).map(full).collect::<Vec<Tie>>();
    Some(Agreement { ties: agreeing(&known), patches: agreeing(&found.patches), holds_ties: holds_ties(&found) })
}

/// Returns what most patches agree on, given those `found` around the usual error of the ties;
/// `None` where it may be chance. Where few agree, `around` searches around other errors, in pixels
/// across the trajectories.
fn most_agreeing(found: Option<Found>, usual_px: f64, around: impl Fn(f64) -> Option<Found>) -> Option<Found> {
    if found.as_ref().is_some_and(|found| found.is_one_in(SURE_ONE_IN)) {
        return found;
    }
    let reach = f64::from(REACH);
    let all = [found, around(usual_px - reach), around(usual_px + reach)].into_iter().flatten();
    let best = all.rev().max_by_key(|found| found.held)?;
    let again = around(best.plane.terms[0]);
    again.into_iter().chain([best]).find(Found::is_beyond_chance)
}

/// Patches that were found, and the plane on which most of them lie.
struct Found {
    patches: Vec<Sight>,
    plane: Plane,
    /// Number of patches on the plane.
    held: usize,
}

impl Found {
    /// Finds the plane; `None` for few patches.
    fn on(patches: Vec<Sight>) -> Option<Self> {
        let plane = Plane::of_most(&patches).filter(|_| patches.len() >= PATCHES_MIN)?;
        Some(Self { held: plane.held(&patches), plane, patches })
    }

    /// Returns whether at least one in so many patches lies on the plane.
    fn is_one_in(&self, number: usize) -> bool {
        number * self.held >= self.patches.len()
    }

    /// Returns whether more patches lie on the plane than chance likenesses would.
    fn is_beyond_chance(&self) -> bool {
        let by_chance = self.patches.len() as f64 * 2.0 * self.plane.counts_px / f64::from(2 * REACH + 1);
        self.is_one_in(AGREE_ONE_IN) && self.held as f64 >= by_chance + BEYOND_CHANCE * by_chance.sqrt()
    }
}

/// Returns the finest level of a view with one mean and one contrast everywhere.
///
/// The edges of shadows are the strongest texture there is, and would lead every patch that holds
/// one. Here they count as much as the texture of lit or shaded ground.
fn evened(view: &SweepView) -> SweepView {
    let image = &view.levels[0];
    let noise = view.noise * view.noise;
    let high = image.zip_map(&gaussian(image, EVEN_PX), |value, mean| value - mean);
    let variance = gaussian(&high.map(|value| value * value), EVEN_PX);
    let even = high.zip_map(&variance, |value, variance| value / (variance + noise).sqrt());
    // No patch is flat now. Those that were hold noise, which the correlation tells.
    SweepView { camera: view.camera.clone(), levels: vec![even], noise: 0.0, contrast: Vec::new(), first: view.first }
}

/// Returns the median height of the ties nearest to a place.
fn height_near(known: &[Sight], at: [f64; 2]) -> Option<f64> {
    let square = |sight: &Sight| {
        let place = sight.tie.reference;
        (place.sample - at[0]).powi(2) + (place.line - at[1]).powi(2)
    };
    let mut all: Vec<(f64, f64)> = known.iter().map(|sight| (square(sight), sight.height_m)).collect();
    if all.len() > NEAR {
        all.select_nth_unstable_by(NEAR, |a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        all.truncate(NEAR);
    }
    upper_median(&mut all.into_iter().map(|(_, height_m)| height_m).collect::<Vec<f64>>())
}

impl Pair<'_> {
    /// Returns the centres of a lattice of patches over what the source sees of the reference:
    /// every second one in both directions, and the rest.
    fn lattice(&self, known: &[Sight], range_m: (f64, f64), config: &TieConfig) -> [Vec<[f64; 2]>; 2] {
        let heights = || known.iter().map(|sight| sight.height_m);
        let (low, high) = (heights().fold(range_m.1, f64::min), heights().fold(range_m.0, f64::max));
        let Some(part) = shared_window(self, (low, high.max(low)), config.band_px) else {
            return [Vec::new(), Vec::new()];
        };
        let wanted = (PATCHES_PER_CORNER * config.points) as f64;
        let step = ((part.width * part.height) as f64 / wanted).sqrt().max(f64::from(config.radius));
        let places = |from: i64, length: usize| {
            let count = (length as f64 / step) as usize;
            (0..count).map(move |i| (i % 2, (from as f64 + (i as f64 + 0.5) * step).round()))
        };
        let all = places(part.y, part.height).flat_map(|y| places(part.x, part.width).map(move |x| [x, y]));
        let (first, rest): (Vec<_>, Vec<_>) = all.partition(|[(column, _), (row, _)]| (*column, *row) == (0, 0));
        [first, rest].map(|places| places.into_iter().map(|at| at.map(|(_, place)| place)).collect())
    }

    /// Searches for the patch around a place near where it is expected, and back.
    fn patch(&self, at: [f64; 2], height_m: f64, across_px: f64, config: &TieConfig) -> Option<Sight> {
        let predicted = self.chain(at, 0, height_m).ok()?;
        let [along_sample, along_line] = self.along(at, height_m)?;
        let expected = [-along_line * across_px, along_sample * across_px];
        let (offset, correlation) = self.refine(at, 0, height_m, (expected, REACH), config)?;
        if correlation < LIKENESS_MIN {
            return None;
        }
        let found = [predicted[0] + offset[0], predicted[1] + offset[1]];
        let back = Pair { reference: self.source, source: self.reference };
        let back_predicted = back.chain(found, 0, height_m).ok()?;
        let start = [at[0] - back_predicted[0], at[1] - back_predicted[1]];
        let (end, _) = back.refine(found, 0, height_m, (start, REACH), config)?;
        if (end[0] - start[0]).hypot(end[1] - start[1]) >= RETURN_PX {
            return None;
        }
        let place = |[sample, line]: [f64; 2]| ImagePoint::new(sample, line);
        let tie = Tie { reference: place(at), source: place(found), correlation };
        Some(Sight { tie, height_m, across_px: along_sample * offset[1] - along_line * offset[0] })
    }

    /// Returns the direction of a height trajectory in the source.
    fn along(&self, at: [f64; 2], height_m: f64) -> Option<[f64; 2]> {
        let (from, to) = (self.chain(at, 0, height_m).ok()?, self.chain(at, 0, height_m + PIECE_M).ok()?);
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        (length > 0.0).then(|| [(to[0] - from[0]) / length, (to[1] - from[1]) / length])
    }
}

/// Errors across trajectories that change linearly over the reference.
struct Plane {
    /// Place about which it is written, and the distance that is 1, pixels.
    centre: ImagePoint,
    half: f64,
    /// At the centre, by sample, by line, pixels.
    terms: Vector3<f64>,
    /// Distance from the plane within which errors agree with it, pixels.
    counts_px: f64,
}

impl Plane {
    /// Finds the plane on which most errors lie.
    fn of_most(sights: &[Sight]) -> Option<Self> {
        let span = |value: fn(&Sight) -> f64| {
            let all = || sights.iter().map(value);
            (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
        };
        let (left, right) = span(|sight| sight.tie.reference.sample);
        let (top, bottom) = span(|sight| sight.tie.reference.line);
        let centre = ImagePoint::new(0.5 * (left + right), 0.5 * (top + bottom));
        let half = (0.5 * (right - left).max(bottom - top)).max(1.0);
        let wider = (MANY / sights.len() as f64).powf(0.2);
        let counts_px = (COUNTS_LAST_PX * wider).clamp(COUNTS_LAST_PX, COUNTS_MOST_PX);
        let start = Self { centre, half, terms: Vector3::new(mode(sights)?, 0.0, 0.0), counts_px };
        let (constant, plane) = (start.settled(sights, false)?, start.settled(sights, true)?);
        let held = |plane: &Self| plane.held(sights) as f64;
        Some(if held(&plane) > PLANE_TIMES * held(&constant) { plane } else { constant })
    }

    /// Returns the plane, or else the constant, that settles on most errors from here.
    fn settled(&self, sights: &[Sight], slopes: bool) -> Option<Self> {
        let mut plane = Self { ..*self };
        let fixed = if slopes { 0.0 } else { 1.0 };
        for round in 0..ROUNDS {
            let narrowed = (3.0 * round as f64 / ROUNDS as f64 - 1.0).clamp(0.0, 1.0);
            let counts_px = COUNTS_FIRST_PX + (self.counts_px - COUNTS_FIRST_PX) * narrowed;
            let mut normal = Matrix3::from_diagonal(&Vector3::new(0.0, fixed, fixed));
            let mut right = Vector3::zeros();
            for sight in sights {
                let mut row = plane.row(sight.tie.reference);
                let off = (sight.across_px - row.dot(&plane.terms)) / counts_px;
                let weight = (1.0 - off * off).max(0.0).powi(2);
                (1..3).for_each(|i| row[i] *= 1.0 - fixed);
                normal += row * row.transpose() * weight;
                right += row * (sight.across_px * weight);
            }
            plane.terms = normal.cholesky()?.solve(&right);
        }
        Some(plane)
    }

    /// Returns whether an error lies on the plane.
    fn holds(&self, sight: &Sight) -> bool {
        (sight.across_px - self.row(sight.tie.reference).dot(&self.terms)).abs() <= self.counts_px
    }

    /// Returns how many errors lie on the plane.
    fn held(&self, sights: &[Sight]) -> usize {
        sights.iter().filter(|sight| self.holds(sight)).count()
    }

    fn row(&self, at: ImagePoint) -> Vector3<f64> {
        Vector3::new(1.0, (at.sample - self.centre.sample) / self.half, (at.line - self.centre.line) / self.half)
    }
}

/// Returns the middle of the densest interval of errors.
fn mode(sights: &[Sight]) -> Option<f64> {
    let mut all: Vec<f64> = sights.iter().map(|sight| sight.across_px).collect();
    all.sort_by(f64::total_cmp);
    let within = |from: usize| all[from..].partition_point(|v| *v <= all[from] + COUNTS_FIRST_PX);
    let densest = (0..all.len()).rev().max_by_key(|&from| within(from))?;
    all.get(densest + within(densest) / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Most patches lie on a plane. A third is moved to one side by shadows of unlike length.
    #[test]
    fn the_mode_stays_where_shadows_pull_to_one_side() {
        let fraction = |i: usize, by: f64| (i as f64 * by).fract();
        let sight = |i: usize, slope: f64| {
            let at = ImagePoint::new(900.0 * fraction(i, 0.618_034), 700.0 * fraction(i, 0.414_214));
            let noise = 0.5 * (fraction(i, 0.732_051) - 0.5) + 0.5 * (fraction(i, 0.236_068) - 0.5);
            let shadow = if i.is_multiple_of(3) { 4.0 * fraction(i, 0.645_751) } else { 0.0 };
            let across_px = 1.5 + slope * (at.sample - 450.0) + noise + shadow;
            let tie = Tie { reference: at, source: at, correlation: 0.5 };
            Sight { tie, height_m: 0.0, across_px }
        };
        // A plane has two terms more that shadows can pull at, most at its ends.
        for (slope, within_px) in [(0.0, 0.1), (0.002, 0.2)] {
            let sights: Vec<Sight> = (0..600).map(|i| sight(i, slope)).collect();
            let mean = sights.iter().map(|s| s.across_px).sum::<f64>() / 600.0;
            assert!(mean > 2.0, "the shadows move the mean to {mean}");
            let plane = Plane::of_most(&sights).unwrap();
            for sample in [0.0, 450.0, 900.0] {
                let found = plane.row(ImagePoint::new(sample, 350.0)).dot(&plane.terms);
                let expected = 1.5 + slope * (sample - 450.0);
                assert!((found - expected).abs() < within_px, "{found} instead of {expected}, slope {slope}");
            }
        }
    }

    /// Shadows have moved the ties by more than the search reaches, and a twelfth of the patches
    /// with them.
    #[test]
    fn the_true_error_is_found_beside_that_of_shadows() {
        let fraction = |i: usize, by: f64| (i as f64 * by).fract();
        let sight = |i: usize, across_px: f64| {
            let at = ImagePoint::new(900.0 * fraction(i, 0.618_034), 700.0 * fraction(i, 0.414_214));
            Sight { tie: Tie { reference: at, source: at, correlation: 0.5 }, height_m: 0.0, across_px }
        };
        let around = |true_share: usize, centre_px: f64| {
            // In each hundred, some show the true error, some that of the shadows, if the search
            // reaches them, and the others any.
            let across_px = |i: usize| {
                let near = |px: f64| (px - centre_px).abs() < 6.0;
                let noise = 0.6 * (fraction(i, 0.732_051) - 0.5);
                match i % 100 {
                    kind if kind < true_share && near(0.0) => noise,
                    kind if (60..68).contains(&kind) && near(-7.0) => noise - 7.0,
                    _ => centre_px + 13.0 * (fraction(i, 0.236_068) - 0.5),
                }
            };
            Found::on((0..400).map(|i| sight(i, across_px(i))).collect())
        };
        let usual_px = -7.0;
        let found = |true_share| most_agreeing(around(true_share, usual_px), usual_px, |px| around(true_share, px));
        assert!((around(30, usual_px).unwrap().plane.terms[0] + 7.0).abs() < 0.2);
        assert!(found(30).is_some_and(|found| found.plane.terms[0].abs() < 0.1));
        // Where none shows the true error, the few that shadows have moved may be chance.
        assert!(found(0).is_none());
    }
}
