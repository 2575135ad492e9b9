//! Calibrated uncertainty of a fused surface: a standard deviation that holds, and the probability
//! that a height is right.
//!
//! The deviation that the sharpness of the costs gives is far too small: it knows nothing of wrong
//! matches, and views that share an image are not independent. What foretells the error of a cell
//! are its surroundings: how much the views agree around it, and how rough the surface is.
//!
//! The model was fitted by quantile regression of log |error| at 68 % and by logistic regression of
//! |error| < tolerance, to fifteen simulated places with exact truth (by two simulators, of one and
//! of several dates, two to twelve views) and to Buenos Aires, whose two to fourteen real dates
//! count as much as all of these. In real images several dates have errors in common, so that
//! deviations shrink less with their number than in simulated ones. Heights enter in units of the
//! height step, which is half a pixel of parallax, so that the model holds for any resolution and
//! base-to-height ratio. `benches/results/scenes.md` shows how it holds on other real images, which
//! took no part.

use raster::Grid;

use super::cells::FusedSurface;
use crate::window_sums::{window_means, window_sums};

/// Share that is added to the agreement, so that it also ranks cells in unobserved surroundings.
const UNOBSERVED: f64 = 0.1;
/// Natural logarithm of the deviation, in height steps, of a cell of one view with deviation and
/// roughness of one step and without agreement.
const SIGMA_BASE: f64 = 3.0;
/// Exponent of the deviation from the sharpness of the costs.
const SIGMA_SHARPNESS: f64 = 0.35;
/// Exponent of the roughness.
const SIGMA_ROUGHNESS: f64 = 0.2;
/// Change of the logarithm of the deviation from no agreement to full agreement.
const SIGMA_AGREEMENT: f64 = -5.25;
/// Exponent of the number of views. With their number costs become sharper, surfaces smoother and
/// agreements larger, and the three terms above make the deviation smaller than errors that the
/// views have in common allow.
const SIGMA_VIEWS: f64 = 0.6;
/// Smallest ratio that enters a logarithm: differences of a fiftieth of a step are rounding.
const RATIO_MIN: f64 = 0.02;
/// Log odds of a right height where the deviation is as large as the tolerance.
const ODDS_BASE: f64 = 1.03;
/// Increase of the log odds with the logarithm of tolerance over deviation.
const ODDS_TOLERANCE: f64 = 1.35;
/// Odds of a filled height where enough around was observed and is right. Where less is, they fall
/// in proportion. Fitted to the errors of filled heights on simulated places and Buenos Aires, each
/// with the weight of the root of its filled cells. The deviation tells nothing more.
const FILLED_ODDS: f64 = 1.5;
/// Mean probability of the observed heights around a filled cell, with voids as 0, from which on
/// more tells nothing.
const ENOUGH_AROUND: f64 = 0.5;
/// The same mean below which less tells nothing.
const NOTHING_AROUND: f64 = 0.03;

/// Parameters of the calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrustConfig {
    /// Distance of two height hypotheses, metres.
    pub step_m: f64,
    /// Largest error of a height that counts as right, metres.
    pub tolerance_m: f64,
    /// Distance around a cell over which the agreement is averaged, cells.
    pub reach_cells: usize,
    /// Distance around a filled cell over which the probability of observed heights is averaged,
    /// cells.
    pub filled_reach_cells: usize,
    /// Deviation of heights that the cameras leave, metres: their errors move whole surfaces, which
    /// neither costs nor surroundings show.
    pub camera_m: f64,
}

/// How far the heights of a surface are to be trusted; NaN in voids.
#[derive(Debug, Clone)]
pub struct Trust {
    /// Standard deviation of each height, metres.
    pub sigma_m: Grid<f32>,
    /// Probability that each height is right within the tolerance.
    pub probability: Grid<f32>,
}

/// Tells how far the heights of one surface are to be trusted, also after some of them were dropped
/// or filled.
///
/// ```
/// use raster::Grid;
/// use sweep::fusion::{FusedSurface, TrustConfig, TrustModel};
///
/// let height_m = Grid::filled(9, 9, 5.0f32);
/// let surface = FusedSurface {
///     single_m: height_m.clone(),
///     sigma_m: height_m.map(|_| 0.1),
///     views: height_m.map(|_| 3),
///     confidence: height_m.map(|_| 0.7),
///     seen: height_m.map(|_| true),
///     height_m,
/// };
/// let config =
///     TrustConfig { step_m: 0.5, tolerance_m: 1.0, reach_cells: 3, filled_reach_cells: 8, camera_m: 0.0 };
/// let trust = TrustModel::new(&surface, config).calibrate(&surface, |_| true);
/// assert!(trust.probability[(4, 4)] > 0.95 && trust.sigma_m[(4, 4)] < 0.5);
/// ```
#[derive(Debug)]
pub struct TrustModel {
    config: TrustConfig,
    /// Roughness of the heights of single views, metres.
    roughness_m: Grid<f32>,
}

impl TrustModel {
    /// Measures the roughness of a fused surface by its `single_m`.
    pub fn new(surface: &FusedSurface, config: TrustConfig) -> Self {
        Self { config, roughness_m: roughness(&surface.single_m) }
    }

    /// Returns the probability that each height is right, where all are observed.
    pub fn probability(&self, surface: &FusedSurface) -> Grid<f32> {
        self.calibrate(surface, |_| true).probability
    }

    /// Returns calibrated deviations of the heights, and the probability of each to be right.
    /// Heights that were not observed keep the deviation that the surface has for them; their
    /// agreement, the `confidence` of the surface, must be 0. The deviation of the cameras enters
    /// the deviations only: it is much smaller than the tolerance.
    pub fn calibrate(&self, surface: &FusedSurface, is_observed: impl Fn(usize) -> bool) -> Trust {
        let config = &self.config;
        let heights = surface.height_m.data();
        let agreed = window_means(heights.len(), surface.height_m.width(), config.reach_cells, |i| {
            if heights[i].is_nan() { 0.0 } else { f64::from(surface.confidence.data()[i]) }
        });
        let in_steps = |value_m: f32| (f64::from(value_m) / config.step_m).max(RATIO_MIN).ln();
        let mut sigma_m = surface.sigma_m.clone();
        let mut probability = surface.height_m.map(|_| f32::NAN);
        let known = || (0..heights.len()).filter(|i| !heights[*i].is_nan());
        for i in known().filter(|i| is_observed(*i)) {
            let sigma = &mut sigma_m.data_mut()[i];
            let log = SIGMA_BASE
                + SIGMA_SHARPNESS * in_steps(*sigma)
                + SIGMA_ROUGHNESS * in_steps(self.roughness_m.data()[i])
                + SIGMA_AGREEMENT * (UNOBSERVED + agreed[i]) / (UNOBSERVED + 1.0)
                + SIGMA_VIEWS * f64::from(surface.views.data()[i].max(1)).ln();
            *sigma = (config.step_m * log.exp()) as f32;
            let ratio = (config.tolerance_m / f64::from(*sigma).max(f64::MIN_POSITIVE)).ln();
            probability.data_mut()[i] = logistic(ODDS_BASE + ODDS_TOLERANCE * ratio);
            *sigma = f64::from(*sigma).hypot(config.camera_m) as f32;
        }
        let filled: Vec<usize> = known().filter(|i| !is_observed(*i)).collect();
        if !filled.is_empty() {
            let around = surroundings(&probability, config.filled_reach_cells);
            for i in filled {
                let share = f64::from(around.data()[i]).clamp(NOTHING_AROUND, ENOUGH_AROUND) / ENOUGH_AROUND;
                probability.data_mut()[i] = logistic((FILLED_ODDS * share).ln());
            }
        }
        Trust { sigma_m, probability }
    }
}

fn logistic(log_odds: f64) -> f32 {
    (1.0 / (1.0 + (-log_odds).exp())) as f32
}

/// Averages the probabilities of right heights over the square that reaches `reach_cells` to each
/// side. Voids count as 0: what cannot be matched speaks against the heights between.
///
/// The average is low on water and on what changed between the dates, and high around a tree, whose
/// own heights are as uncertain.
pub fn surroundings(confidence: &Grid<f32>, reach_cells: usize) -> Grid<f32> {
    let values = confidence.data();
    let known = |i: usize| if values[i].is_nan() { 0.0 } else { f64::from(values[i]) };
    let means = window_means(values.len(), confidence.width(), reach_cells, known);
    let mut out = confidence.clone();
    out.data_mut().iter_mut().zip(means).for_each(|(out, mean)| *out = mean as f32);
    out
}

/// Returns the standard deviation of the known heights in the 3 × 3 cells around each cell.
fn roughness(height_m: &Grid<f32>) -> Grid<f32> {
    let (width, heights) = (height_m.width(), height_m.data());
    // Relative to a height of the scene the squares keep their precision.
    let origin = f64::from(heights.iter().copied().find(|h| !h.is_nan()).unwrap_or(0.0));
    let value = |i: usize| if heights[i].is_nan() { 0.0 } else { f64::from(heights[i]) - origin };
    let count = window_sums(heights.len(), width, 1, |i| f64::from(u8::from(!heights[i].is_nan())));
    let sum = window_sums(heights.len(), width, 1, value);
    let squares = window_sums(heights.len(), width, 1, |i| value(i).powi(2));
    let mut out = height_m.clone();
    for (i, out) in out.data_mut().iter_mut().enumerate().filter(|(_, h)| !h.is_nan()) {
        let mean = sum[i] / count[i];
        *out = (squares[i] / count[i] - mean * mean).max(0.0).sqrt() as f32;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: TrustConfig =
        TrustConfig { step_m: 0.5, tolerance_m: 1.0, reach_cells: 3, filled_reach_cells: 8, camera_m: 0.0 };

    fn calibrated(surface: &FusedSurface, is_observed: impl Fn(usize) -> bool) -> Trust {
        TrustModel::new(surface, CONFIG).calibrate(surface, is_observed)
    }

    /// A level surface of three views that agree.
    fn level((width, height): (usize, usize)) -> FusedSurface {
        let height_m = Grid::filled(width, height, 5.0f32);
        FusedSurface {
            single_m: height_m.clone(),
            sigma_m: height_m.map(|_| 0.1),
            views: height_m.map(|_| 3),
            confidence: height_m.map(|_| 0.7),
            seen: height_m.map(|_| true),
            height_m,
        }
    }

    #[test]
    fn what_stands_alone_or_is_rough_is_believed_less_and_filled_deviations_stay() {
        let mut surface = level((40, 20));
        for y in 0..20 {
            (30..40).for_each(|x| surface.height_m[(x, y)] += 3.0 * ((x + y) % 2) as f32);
            surface.confidence.row_mut(y)[..10].fill(0.0);
        }
        surface.height_m[(20, 10)] = f32::NAN;
        surface.single_m = surface.height_m.clone();
        let filled = 12 * 40 + 4;
        surface.sigma_m.data_mut()[filled] = 2.5;
        let Trust { sigma_m, probability } = calibrated(&surface, |i| i != filled);
        assert!(probability[(20, 10)].is_nan());
        let [smooth, alone, rough] = [(16, 3), (2, 3), (36, 10)];
        assert!(sigma_m[smooth] < sigma_m[rough] && sigma_m[rough] < sigma_m[alone]);
        assert!(probability[alone] < 0.5 && probability[alone] < probability[rough]);
        assert!(probability[rough] < probability[smooth] && probability[smooth] > 0.9);
        assert_eq!(sigma_m.data()[filled], 2.5);
    }

    #[test]
    fn a_filled_height_is_believed_as_far_as_what_is_observed_around() {
        let mut surface = level((80, 20));
        // Houses of 2 × 2 cells are all that is observed on the right.
        for y in 0..20 {
            (40..80).filter(|x| x % 8 > 1 || y % 8 > 1).for_each(|x| surface.confidence[(x, y)] = 0.0);
        }
        let is_observed = |i: usize| surface.confidence.data()[i] > 0.0 && i != 10 * 80 + 20;
        let Trust { probability, .. } = calibrated(&surface, is_observed);
        let [in_street, between_houses] = [(20, 10), (60, 10)].map(|at| probability[at]);
        assert!((0.55..0.65).contains(&in_street), "{in_street}");
        assert!(between_houses < 0.3, "{between_houses}");
    }

    #[test]
    fn views_that_tell_no_more_make_no_height_more_certain() {
        let sigma_of = |views: u8| {
            let mut surface = level((9, 9));
            surface.views = surface.views.map(|_| views);
            calibrated(&surface, |_| true).sigma_m[(4, 4)]
        };
        assert!(sigma_of(2) < sigma_of(3) && sigma_of(3) < sigma_of(12));
    }

    #[test]
    fn what_the_cameras_leave_adds_to_the_deviation_of_observed_heights() {
        let surface = level((9, 9));
        let model = |camera_m: f64| TrustModel::new(&surface, TrustConfig { camera_m, ..CONFIG });
        let [exact, off] = [0.0, 0.3].map(|camera_m| model(camera_m).calibrate(&surface, |i| i != 0));
        assert!((off.sigma_m[(4, 4)] - exact.sigma_m[(4, 4)].hypot(0.3)).abs() < 1e-6);
        assert_eq!((off.sigma_m[(0, 0)], off.probability), (exact.sigma_m[(0, 0)], exact.probability));
    }

    #[test]
    fn surroundings_are_low_where_little_is_known_and_high_around_a_tree() {
        let mut confidence = Grid::filled(60, 30, 0.9f32);
        (0..30).for_each(|y| (30..60).for_each(|x| confidence[(x, y)] = if (x + y) % 2 == 0 { f32::NAN } else { 0.2 }));
        (10..14).for_each(|y| (10..14).for_each(|x| confidence[(x, y)] = 0.2));
        let around = surroundings(&confidence, 8);
        assert!(around[(12, 12)] > 0.8 && around[(45, 15)] < 0.12, "{} {}", around[(12, 12)], around[(45, 15)]);
    }

    #[test]
    fn the_model_knows_no_unit_but_the_height_step() {
        let scaled = |scale: f32| {
            let mut surface = level((12, 12));
            let heights = (0..144).map(|i| scale * ((i * 37 % 11) as f32 * 0.1));
            surface.height_m = Grid::from_vec(12, 12, heights.collect()).unwrap();
            surface.single_m = surface.height_m.clone();
            surface.sigma_m = surface.sigma_m.map(|sigma_m| sigma_m * scale);
            let config = TrustConfig { step_m: 0.5 * f64::from(scale), tolerance_m: f64::from(scale), ..CONFIG };
            let Trust { sigma_m, probability } = TrustModel::new(&surface, config).calibrate(&surface, |_| true);
            (sigma_m.map(|sigma_m| sigma_m / scale), probability)
        };
        let ((fine, p), (coarse, q)) = (scaled(1.0), scaled(4.0));
        let near =
            |a: &Grid<f32>, b: &Grid<f32>| a.data().iter().zip(b.data()).all(|(a, b)| (a / b - 1.0).abs() < 1e-3);
        assert!(near(&fine, &coarse) && near(&p, &q));
    }
}
