//! Joint adjustment of the pointing of all views from tie points and control points.
//!
//! Each track gives the residuals of its best ground point, from which the ground point is
//! eliminated (see `reduce`). What is left ties views together that share tracks, so that the
//! normal equations are sparse. They are solved by iteratively reweighted least squares, with
//! Cauchy weights on a robust scale. A weak prior holds what ties cannot determine, such as a
//! common shift of all views, so that corrections stay as small as possible. The order of the
//! corrections is the one with the least Bayesian information criterion, for the number of
//! independent tracks. More than a shift needs strong evidence.

use std::collections::BTreeSet;

use camera::{ImageCorrection, RpcCamera};
use geodesy::LonLatHeight;
use numeric::upper_median;
use rayon::prelude::*;

use super::block_system::BlockSystem;
use super::control::ControlPoint;
use super::intersect::{Known, Track};
use super::model::{ModelOrder, PARAMETERS, Parameters, corrected, half_side};
use super::reduce::Reduced;

/// Parameters of the adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdjustConfig {
    /// Largest order to consider.
    pub max_order: ModelOrder,
    /// Standard deviation of the raw pointing, pixels: the weak prior on what ties cannot
    /// determine.
    pub prior_px: f64,
    /// Standard deviation of what grows with the distance from the centre of an image, pixels per
    /// pixel: the same for drifts and affine terms. At the border of an image it is at most
    /// `prior_px`, so that infinity holds them no closer than the shift.
    pub prior_drift: f64,
}

impl Default for AdjustConfig {
    /// Returns a prior of ten pixels. These are several metres, which providers state for
    /// unadjusted products. Drifts are two pixels in a thousand: published ones are a few pixels in
    /// ten thousand lines (Fraser and Hanley 2005). Ties hardly tell one that all views share from
    /// a tilt or a stretch of the ground, so that it must stay small by itself.
    fn default() -> Self {
        Self { max_order: ModelOrder::Affine, prior_px: 10.0, prior_drift: 2e-3 }
    }
}

/// What an adjustment is made from.
#[derive(Debug, Clone, Copy)]
pub struct Observations<'a> {
    /// Ground points of which only the places in the images are known.
    pub tracks: &'a [Track],
    /// Ground points whose positions are known. A correction is then always looked for.
    pub control: &'a [ControlPoint],
}

/// Result of an adjustment.
#[derive(Debug, Clone)]
pub struct Adjustment {
    /// Order chosen.
    pub order: ModelOrder,
    /// Correction of each view, with the one that its camera had.
    pub corrections: Vec<ImageCorrection>,
    /// Robust standard deviation of the residuals before and after the adjustment, pixels.
    pub residual_px: (f64, f64),
    /// Root mean square of the inliers' residuals after the adjustment, pixels.
    pub rms_px: f64,
    /// Ground point of each track under the corrections; `None` for an outlier.
    pub ground: Vec<Option<LonLatHeight>>,
    /// Robust standard deviation of the residuals in each view after the adjustment, outliers
    /// included, pixels; NaN for a view without tracks.
    pub view_residual_px: Vec<f64>,
    /// Root mean square residual of each control point after the adjustment, in standard
    /// deviations of what was observed; NaN for one that no camera sees.
    pub control_residual: Vec<f64>,
}

/// Largest number of rounds of triangulation and reweighting. The problem is nearly linear, so that
/// the weights settle earlier.
const ROUNDS: usize = 8;
/// Step that ends the rounds, pixels: less than hundreds of ties can resolve.
const SETTLED_PX: f64 = 1e-4;
/// Residuals above this many robust deviations are outliers.
const OUTLIER: f64 = 4.0;
/// Largest total weight of the ties of a scene, in independent ties.
///
/// Neighbouring ties share the errors of relief and light. With full weights hundreds of them would
/// overrule the prior and derive a common shift of all views from a hundredth of a pixel.
const INDEPENDENT: f64 = 25.0;
/// Views that see one scene. A block of more views covers more ground, whose ties have errors of
/// their own.
const VIEWS_OF_A_SCENE: f64 = 8.0;
/// Smallest robust scale, pixels: matching is not more precise.
const SCALE_MIN_PX: f64 = 0.05;
/// Median of the size of a normal deviate, standard deviations.
const NORMAL_MEDIAN: f64 = 0.6745;
/// Least difference of the Bayesian information criteria for which drifts or affine maps take the
/// place of a lower order: "strong" evidence (Kass and Raftery 1995,
/// <https://doi.org/10.1080/01621459.1995.10476572>). Every RPC is off by a shift, few by more, and
/// a drift that ties only seem to have bends the surface. Real drifts, those of JAX_068, differ by
/// nine and more.
const STRONG: f64 = 6.0;
/// Ground points closer to each other than this in their first view are one for the choice of the
/// order, pixels: the side of the patches that are matched, which then share their pixels.
const PATCH_PX: f64 = 15.0;

/// The cameras and observations of an adjustment.
struct Problem<'a> {
    cameras: &'a [RpcCamera],
    sizes: &'a [(usize, usize)],
    tracks: &'a [Track],
    control: Vec<(&'a ControlPoint, Known)>,
    prior_px: f64,
    prior_drift: f64,
}

/// The tracks and control points, reduced under cameras.
struct Round {
    tracks: Vec<Option<Reduced>>,
    control: Vec<Option<Reduced>>,
    /// Robust standard deviation of the residuals of the tracks, pixels.
    scale: f64,
}

/// Adjusts the pointing of `cameras` so that the rays of each track meet. `sizes` are the images'
/// columns and rows.
///
/// Corrections that the cameras have are where the search starts, and what the prior holds them to.
/// Without tracks they stay.
///
/// ```
/// use sweep::pointing::{AdjustConfig, ModelOrder, adjust};
///
/// let found = adjust(&[], &[], &[], &AdjustConfig::default());
/// assert_eq!(found.order, ModelOrder::None);
/// ```
pub fn adjust(cameras: &[RpcCamera], sizes: &[(usize, usize)], tracks: &[Track], config: &AdjustConfig) -> Adjustment {
    adjust_to_control(cameras, sizes, Observations { tracks, control: &[] }, config)
}

/// Adjusts the pointing of `cameras` so that the rays of each track meet, and those of each control
/// point meet at its position, as far as its accuracy says.
pub fn adjust_to_control(
    cameras: &[RpcCamera],
    sizes: &[(usize, usize)],
    Observations { tracks, control }: Observations<'_>,
    config: &AdjustConfig,
) -> Adjustment {
    let control = control.iter().map(|point| (point, point.known())).collect();
    let AdjustConfig { prior_px, prior_drift, .. } = *config;
    let problem = Problem { cameras, sizes, tracks, control, prior_px, prior_drift };
    let raw = problem.fit(ModelOrder::None, None);
    let independent = problem.independent(&raw.1);
    let before = raw.0.residual_px.1;
    let higher = ModelOrder::ALL.into_iter().filter(|order| *order > ModelOrder::None && *order <= config.max_order);
    let mut best: Option<(f64, Adjustment)> = None;
    // Control points are given to be followed.
    let is_free = problem.control.is_empty() || config.max_order == ModelOrder::None;
    let fits = higher.map(|order| problem.fit(order, Some(&raw.1)));
    let candidates = is_free.then(|| (raw.0.clone(), problem.information(&raw.1, ModelOrder::None, independent)));
    let others = fits.map(|(fit, round)| {
        let bic = problem.information(&round, fit.order, independent);
        (fit, bic)
    });
    for (mut fit, bic) in candidates.into_iter().chain(others) {
        fit.residual_px.0 = before;
        let margin = if fit.order > ModelOrder::Translation { STRONG } else { 0.0 };
        if best.as_ref().is_none_or(|(least, _)| bic < *least - margin) {
            best = Some((bic, fit));
        }
    }
    best.map_or(raw.0, |(_, fit)| fit)
}

impl Problem<'_> {
    /// Fits the corrections of one order. `earlier` has ground points to begin with.
    fn fit(&self, order: ModelOrder, earlier: Option<&Round>) -> (Adjustment, Round) {
        let mut x = vec![Parameters::zeros(); self.cameras.len()];
        let mut round: Option<Round> = None;
        for number in 0..if order == ModelOrder::None { 0 } else { ROUNDS } {
            let current = corrected(self.cameras, self.sizes, &x, order);
            let found = self.reduce(&current, order, round.as_ref().or(earlier));
            let step = self.step(&found, &x, number == 0);
            x.iter_mut().zip(&step).for_each(|(x, step)| *x += step);
            round = Some(found);
            if step.iter().all(|step| step.amax() < SETTLED_PX) {
                break;
            }
        }
        let current = corrected(self.cameras, self.sizes, &x, order);
        let round = self.reduce(&current, order, round.as_ref().or(earlier));
        (self.result(order, &current, &round), round)
    }

    /// Reduces all observations under some cameras. `earlier` has ground points to begin with.
    fn reduce(&self, cameras: &[RpcCamera], order: ModelOrder, earlier: Option<&Round>) -> Round {
        let ground = |at: &[Option<Reduced>], i: usize| at[i].as_ref().map(|reduced| reduced.ground);
        let track = |(i, track): (usize, &Track)| {
            let start = earlier.and_then(|round| ground(&round.tracks, i));
            Reduced::of(cameras, self.sizes, track, order, (None, start))
        };
        let tracks: Vec<Option<Reduced>> = self.tracks.par_iter().enumerate().map(track).collect();
        let control = |(point, known): &(&ControlPoint, Known)| {
            Reduced::of(cameras, self.sizes, &point.seen, order, (Some(known), None))
        };
        let control = self.control.iter().map(control).collect();
        let scale = robust_scale(tracks.iter().flatten().map(Reduced::norm_px)).max(SCALE_MIN_PX);
        Round { tracks, control, scale }
    }

    /// Returns the step that minimises the reweighted reduced residuals and the prior about zero.
    fn step(&self, round: &Round, x: &[Parameters], is_first: bool) -> Vec<Parameters> {
        let prior: Vec<Parameters> = x.iter().zip(self.sizes).map(|(x, size)| self.prior_weights(x, *size)).collect();
        let right = x.iter().zip(&prior).map(|(x, weight)| -x.component_mul(weight)).collect();
        let mut system = BlockSystem::diagonal(&prior, right);
        let tracks = || round.tracks.iter().flatten();
        let scenes = (self.cameras.len() as f64 / VIEWS_OF_A_SCENE).max(1.0);
        let share = (INDEPENDENT * scenes / tracks().count().max(1) as f64).min(1.0);
        let scale = round.scale;
        for track in tracks() {
            let weight = share / (1.0 + (track.norm_px() / scale).powi(2)) / (scale * scale);
            track.add_to(&mut system, weight);
        }
        self.add_control(round, &mut system, is_first);
        system.solve().unwrap_or_else(|| vec![Parameters::zeros(); x.len()])
    }

    /// Adds the control points. In the first round they count in full, because all of them show the
    /// common error of the raw pointing. Then each has a Cauchy weight, so that a wrong one yields.
    fn add_control(&self, round: &Round, system: &mut BlockSystem, is_first: bool) {
        let residual = |(reduced, (point, _)): (&Reduced, &(&ControlPoint, Known))| reduced.norm_px() / point.pixel_px;
        let found = || round.control.iter().zip(&self.control).filter_map(|(r, point)| Some((r.as_ref()?, point)));
        let scale = robust_scale(found().map(residual)).max(1.0);
        for (reduced, point) in found() {
            let doubt = if is_first { 0.0 } else { residual((reduced, point)) / scale };
            reduced.add_to(system, 1.0 / (1.0 + doubt * doubt) / point.0.pixel_px.powi(2));
        }
    }

    /// Returns the weights of the prior on the parameters of a view.
    ///
    /// They are Cauchy weights, of the shift and of what grows from the centre: a view that is off
    /// by several times the prior's deviation is then moved to the others, instead of the others
    /// being moved half-way to it.
    fn prior_weights(&self, x: &Parameters, size: (usize, usize)) -> Parameters {
        let mut out = Parameters::zeros();
        let drift_px = (self.prior_drift * half_side(size)).min(self.prior_px);
        for (some, deviation) in [(0..2, self.prior_px), (2..PARAMETERS, drift_px)] {
            let squares = some.clone().map(|i| x[i] * x[i]).sum::<f64>();
            some.for_each(|i| out[i] = 1.0 / (deviation * deviation + squares));
        }
        out
    }

    /// Returns the adjustment with some corrected cameras, under which a round was reduced.
    fn result(&self, order: ModelOrder, cameras: &[RpcCamera], round: &Round) -> Adjustment {
        let limit = OUTLIER * round.scale;
        let inliers: Vec<f64> =
            round.tracks.iter().flatten().map(Reduced::norm_px).filter(|norm| *norm <= limit).collect();
        let is_inlier = |track: &&Reduced| track.norm_px() <= limit;
        let ground = |track: &Option<Reduced>| track.as_ref().filter(is_inlier).map(|track| track.ground);
        let control = |(reduced, (point, _)): (&Option<Reduced>, &(&ControlPoint, Known))| {
            reduced.as_ref().map_or(f64::NAN, |reduced| reduced.norm_px() / point.pixel_px)
        };
        Adjustment {
            order,
            corrections: cameras.iter().map(|camera| camera.correction).collect(),
            residual_px: (f64::NAN, round.scale),
            rms_px: (inliers.iter().map(|r| r * r).sum::<f64>() / inliers.len().max(1) as f64).sqrt(),
            ground: round.tracks.iter().map(ground).collect(),
            view_residual_px: by_view(round.tracks.iter().flatten(), self.cameras.len()),
            control_residual: round.control.iter().zip(&self.control).map(control).collect(),
        }
    }

    /// Computes the Bayesian information criterion of a Cauchy likelihood, which is robust against
    /// the outliers that all orders share. All tracks together count as the `independent` ones.
    fn information(&self, round: &Round, order: ModelOrder, independent: usize) -> f64 {
        let norms: Vec<f64> = round.tracks.iter().flatten().map(Reduced::norm_px).collect();
        let n = norms.len() as f64;
        let loss: f64 = norms.iter().map(|r| (1.0 + (r / round.scale).powi(2)).ln()).sum();
        let share = independent as f64 / n.max(1.0);
        let control: f64 = self.control.iter().zip(&round.control).map(control_loss).sum();
        let parameters = (order.parameters() * self.cameras.len()) as f64;
        2.0 * share * (n * round.scale.ln() + loss) + 2.0 * control + parameters * (independent.max(1) as f64).ln()
    }

    /// Returns the number of tracks that share no pixels: that of fields of a patch's size in the
    /// view with the lowest number, into which ground points fall under the raw cameras.
    fn independent(&self, raw: &Round) -> usize {
        let field = |(track, reduced): (&Track, &Option<Reduced>)| {
            let ground = reduced.as_ref()?.ground;
            let view = self.first_view(track, ground)?;
            let place = self.cameras[view].project(ground).ok()?;
            let along = |at: f64| (at / PATCH_PX).floor() as i64;
            Some((view, along(place.sample), along(place.line)))
        };
        self.tracks.iter().zip(&raw.tracks).filter_map(field).collect::<BTreeSet<_>>().len()
    }

    /// Returns the first view whose image shows a ground point.
    fn first_view(&self, track: &Track, ground: LonLatHeight) -> Option<usize> {
        let last = track.iter().map(|(view, _)| *view).min()?;
        let shows = |view: &usize| {
            let (width, height) = self.sizes[*view];
            let is_inside = |place: camera::ImagePoint| {
                (0.0..width as f64).contains(&place.sample) && (0.0..height as f64).contains(&place.line)
            };
            self.cameras[*view].project(ground).is_ok_and(is_inside)
        };
        (0..last).find(shows).or(Some(last))
    }
}

/// Returns the loss of a control point, whose noise is known.
fn control_loss(((point, _), reduced): (&(&ControlPoint, Known), &Option<Reduced>)) -> f64 {
    reduced.as_ref().map_or(0.0, |reduced| (1.0 + (reduced.norm_px() / point.pixel_px).powi(2)).ln())
}

/// Returns the robust standard deviation of the residuals in each view; NaN where there are none.
fn by_view<'a>(reduced: impl Iterator<Item = &'a Reduced>, views: usize) -> Vec<f64> {
    let mut all = vec![Vec::new(); views];
    reduced.flat_map(Reduced::by_view).for_each(|(view, px)| all[view].push(px));
    all.iter_mut().map(|px| upper_median(px).map_or(f64::NAN, |median| median / NORMAL_MEDIAN)).collect()
}

/// Estimates the standard deviation of residuals from their median; 0 without residuals.
fn robust_scale(residuals: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = residuals.collect();
    upper_median(&mut all).map_or(0.0, |median| median / NORMAL_MEDIAN)
}
