//! Joint adjustment of the pointing of all views from tie points.
//!
//! Each track gives the residuals r of its best ground point. They are made independent of the
//! ground point: with J the Jacobian of the track's projections, N a basis of the null space of Jᵀ,
//! and B the design matrix of the corrections x, `Nᵀ (r − B x) = 0`. The system is solved by
//! iteratively reweighted least squares, with Cauchy weights on a robust scale. A weak prior holds
//! what ties cannot determine, such as a common shift of all views, so that corrections stay as
//! small as possible. The order of the corrections is the one with the least Bayesian information
//! criterion.

use camera::{CameraError, ImageCorrection, ImagePoint, RpcCamera};
use geodesy::LonLatHeight;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use numeric::upper_median;
use rayon::prelude::*;

/// One ground point seen in two or more views: index of the view, position in full-resolution
/// pixels.
pub type Track = Vec<(usize, ImagePoint)>;

/// Order of the image-space corrections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ModelOrder {
    /// No correction.
    None,
    /// One shift per view.
    Translation,
    /// One affine map per view.
    Affine,
}

impl ModelOrder {
    /// Returns the number of parameters per view.
    const fn parameters(self) -> usize {
        match self {
            Self::None => 0,
            Self::Translation => 2,
            Self::Affine => 6,
        }
    }
}

/// Parameters of the adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdjustConfig {
    /// Largest order to consider.
    pub max_order: ModelOrder,
    /// Standard deviation of the raw pointing, pixels: the weak prior on what ties cannot
    /// determine.
    pub prior_px: f64,
}

impl Default for AdjustConfig {
    /// Returns a prior of ten pixels. These are several metres, which providers state for
    /// unadjusted products.
    fn default() -> Self {
        Self { max_order: ModelOrder::Affine, prior_px: 10.0 }
    }
}

/// Result of an adjustment.
#[derive(Debug, Clone)]
pub struct Adjustment {
    /// Order chosen.
    pub order: ModelOrder,
    /// Correction of each view.
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
}

/// Largest number of rounds of triangulation and reweighting. The problem is nearly linear, so that
/// the weights settle earlier.
const ROUNDS: usize = 8;
/// Step that ends the rounds, pixels: less than hundreds of ties can resolve.
const SETTLED_PX: f64 = 1e-4;
/// Residuals above this many robust deviations are outliers.
const OUTLIER: f64 = 4.0;
/// Largest total weight of the ties, in independent ties.
///
/// Neighbouring ties share the errors of relief and light. With full weights hundreds of them would
/// overrule the prior and derive a common shift of all views from a hundredth of a pixel.
const INDEPENDENT: f64 = 25.0;
/// Smallest robust scale, pixels: matching is not more precise.
const SCALE_MIN_PX: f64 = 0.05;
/// Median of the size of a normal deviate, standard deviations.
const NORMAL_MEDIAN: f64 = 0.6745;

/// Residuals of one track without those that its ground point explains.
struct Reduced {
    /// Residuals, pixels.
    residual: DVector<f64>,
    /// Derivatives with respect to all parameters.
    design: DMatrix<f64>,
    /// Root mean square residual in each view of the track per degree of freedom, pixels.
    by_view: Vec<(usize, f64)>,
}

/// Adjusts the pointing of `cameras` so that the rays of each track meet. `sizes` are the images'
/// columns and rows.
///
/// Without tracks the corrections are identities.
///
/// ```
/// use sweep::pointing::{AdjustConfig, ModelOrder, adjust};
///
/// let found = adjust(&[], &[], &[], &AdjustConfig::default());
/// assert_eq!(found.order, ModelOrder::None);
/// ```
pub fn adjust(cameras: &[RpcCamera], sizes: &[(usize, usize)], tracks: &[Track], config: &AdjustConfig) -> Adjustment {
    let orders = [ModelOrder::None, ModelOrder::Translation, ModelOrder::Affine];
    let fits = orders.iter().filter(|o| **o <= config.max_order).map(|&o| fit(cameras, sizes, tracks, o, config));
    let mut best: Option<(f64, Adjustment)> = None;
    let mut before = f64::NAN;
    for (bic, mut fit) in fits {
        if fit.order == ModelOrder::None {
            before = fit.residual_px.1;
        }
        fit.residual_px.0 = before;
        if best.as_ref().is_none_or(|(b, _)| bic < *b) {
            best = Some((bic, fit));
        }
    }
    best.map(|(_, fit)| fit).unwrap_or_else(|| unadjusted(cameras.len(), tracks.len()))
}

/// Returns the result without corrections.
fn unadjusted(views: usize, tracks: usize) -> Adjustment {
    Adjustment {
        order: ModelOrder::None,
        corrections: vec![ImageCorrection::IDENTITY; views],
        residual_px: (f64::NAN, f64::NAN),
        rms_px: f64::NAN,
        ground: vec![None; tracks],
        view_residual_px: vec![f64::NAN; views],
    }
}

/// Fits the corrections of one order. Returns the information criterion and the fit.
fn fit(
    cameras: &[RpcCamera],
    sizes: &[(usize, usize)],
    tracks: &[Track],
    order: ModelOrder,
    config: &AdjustConfig,
) -> (f64, Adjustment) {
    let n = order.parameters() * cameras.len();
    let mut x = DVector::zeros(n);
    let mut scale = f64::INFINITY;
    let rounds = if order == ModelOrder::None { 1 } else { ROUNDS };
    for _ in 0..rounds {
        let current = corrected(cameras, sizes, &x, order);
        let reduced: Vec<Reduced> =
            tracks.par_iter().filter_map(|t| reduce(&current, sizes, t, order).map(|(r, _)| r)).collect();
        scale = robust_scale(reduced.iter().map(|r| norm_px(&r.residual)));
        if n > 0 {
            let step = solve(&reduced, &x, scale, &prior_weights(&x, order, config));
            x += &step;
            if step.amax() < SETTLED_PX {
                break;
            }
        }
    }
    let current = corrected(cameras, sizes, &x, order);
    let found: Vec<Option<(Reduced, LonLatHeight)>> =
        tracks.par_iter().map(|t| reduce(&current, sizes, t, order)).collect();
    let norms: Vec<f64> = found.iter().flatten().map(|(r, _)| norm_px(&r.residual)).collect();
    scale = if norms.is_empty() { scale } else { robust_scale(norms.iter().copied()) };
    let limit = OUTLIER * scale;
    let inliers: Vec<f64> = norms.iter().copied().filter(|r| *r <= limit).collect();
    let rms_px = (inliers.iter().map(|r| r * r).sum::<f64>() / inliers.len().max(1) as f64).sqrt();
    let view_residual_px = by_view(found.iter().flatten().map(|(r, _)| r), cameras.len());
    let ground =
        found.into_iter().map(|f| f.filter(|(r, _)| norm_px(&r.residual) <= limit).map(|(_, ground)| ground)).collect();
    let corrections = current.into_iter().map(|c| c.correction).collect();
    let fit = Adjustment { order, corrections, residual_px: (f64::NAN, scale), rms_px, ground, view_residual_px };
    (information(&norms, scale, n), fit)
}

/// Computes the Bayesian information criterion of a Cauchy likelihood, which is robust against the
/// outliers that all orders share.
fn information(residuals: &[f64], scale: f64, parameters: usize) -> f64 {
    let n = residuals.len() as f64;
    let loss: f64 = residuals.iter().map(|r| (1.0 + (r / scale).powi(2)).ln()).sum();
    2.0 * (n * scale.ln() + loss) + parameters as f64 * n.max(1.0).ln()
}

/// Returns the root mean square of a track's reduced residual per degree of freedom, pixels.
fn norm_px(r: &DVector<f64>) -> f64 {
    (r.norm_squared() / r.len().max(1) as f64).sqrt()
}

/// Returns the robust standard deviation of the residuals in each view; NaN where there are none.
fn by_view<'a>(reduced: impl Iterator<Item = &'a Reduced>, views: usize) -> Vec<f64> {
    let mut all = vec![Vec::new(); views];
    reduced.flat_map(|r| &r.by_view).for_each(|&(view, px)| all[view].push(px));
    all.iter_mut().map(|px| upper_median(px).map_or(f64::NAN, |median| median / NORMAL_MEDIAN)).collect()
}

/// Estimates the standard deviation of residuals from their median.
fn robust_scale(residuals: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = residuals.collect();
    upper_median(&mut all).map_or(SCALE_MIN_PX, |median| (median / NORMAL_MEDIAN).max(SCALE_MIN_PX))
}

/// Returns the weights of the prior on every parameter.
///
/// The shift of a view has a Cauchy weight: a view that is off by several times the prior's
/// deviation is then moved to the others, instead of the others being moved half-way to it.
fn prior_weights(x: &DVector<f64>, order: ModelOrder, config: &AdjustConfig) -> DVector<f64> {
    let weight = 1.0 / (config.prior_px * config.prior_px);
    let mut out = DVector::repeat(x.len(), weight);
    for first in (0..x.len()).step_by(order.parameters().max(1)) {
        let shift = x[first].hypot(x[first + 1]) / config.prior_px;
        (0..2).for_each(|i| out[first + i] /= 1.0 + shift * shift);
    }
    out
}

/// Returns the step that minimises the reweighted reduced residuals and the prior about zero.
fn solve(reduced: &[Reduced], x: &DVector<f64>, scale: f64, prior: &DVector<f64>) -> DVector<f64> {
    let n = x.len();
    let mut normal = DMatrix::from_diagonal(prior);
    let mut right = -x.component_mul(prior);
    let share = (INDEPENDENT / reduced.len().max(1) as f64).min(1.0);
    for r in reduced {
        let w = share / (1.0 + (norm_px(&r.residual) / scale).powi(2)) / (scale * scale);
        normal += r.design.transpose() * &r.design * w;
        right += r.design.transpose() * &r.residual * w;
    }
    normal.cholesky().map_or_else(|| DVector::zeros(n), |c| c.solve(&right))
}

/// Returns the cameras with the corrections of the parameters.
///
/// An affine map acts about the image's centre, in units of half its size, so that every parameter
/// is in pixels and one prior serves all.
fn corrected(cameras: &[RpcCamera], sizes: &[(usize, usize)], x: &DVector<f64>, order: ModelOrder) -> Vec<RpcCamera> {
    let m = order.parameters();
    let one = |(i, c): (usize, &RpcCamera)| {
        let p = &x.as_slice()[i * m..(i + 1) * m];
        let (centre, half) = frame(sizes[i]);
        let mut correction = ImageCorrection::IDENTITY;
        if m >= 2 {
            correction = ImageCorrection { translation_px: [p[0], p[1]], centre, ..correction };
        }
        if m == 6 {
            correction.linear = [[p[2] / half, p[3] / half], [p[4] / half, p[5] / half]];
        }
        RpcCamera { rpc: c.rpc.clone(), correction }
    };
    cameras.iter().enumerate().map(one).collect()
}

/// Returns the centre of an image and half its larger side, pixels.
fn frame((width, height): (usize, usize)) -> (ImagePoint, f64) {
    let centre = ImagePoint::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
    (centre, 0.5 * width.max(height) as f64)
}

/// Returns the derivatives of a view's corrected position (sample, line) with respect to each of
/// its own parameters.
fn own_design(p: ImagePoint, size: (usize, usize), order: ModelOrder) -> Vec<[f64; 2]> {
    let (centre, half) = frame(size);
    let (s, l) = ((p.sample - centre.sample) / half, (p.line - centre.line) / half);
    let all = [[1.0, 0.0], [0.0, 1.0], [s, 0.0], [l, 0.0], [0.0, s], [0.0, l]];
    all[..order.parameters()].to_vec()
}

/// Finds a track's best ground point, and its residuals without those that the ground point
/// explains. Returns `None` if the rays do not meet or the track has fewer than two views.
fn reduce(
    cameras: &[RpcCamera],
    sizes: &[(usize, usize)],
    track: &Track,
    order: ModelOrder,
) -> Option<(Reduced, LonLatHeight)> {
    let (ground, mut residual, jacobian) = triangulate(cameras, track).ok()??;
    let rows = residual.len();
    let m = order.parameters();
    let mut design = DMatrix::zeros(rows, m * cameras.len());
    for (i, (view, p)) in track.iter().enumerate() {
        for (k, [s, l]) in own_design(*p, sizes[*view], order).into_iter().enumerate() {
            design[(2 * i, view * m + k)] = s;
            design[(2 * i + 1, view * m + k)] = l;
        }
    }
    // Multiplied by Qᵀ of J = QR, all but the first three rows are independent of the ground point.
    let freedom = rows.checked_sub(3)?;
    let share = rows as f64 / freedom as f64;
    let in_view = |i: usize| (0.5 * share * residual.rows(2 * i, 2).norm_squared()).sqrt();
    let by_view = track.iter().enumerate().map(|(i, (view, _))| (*view, in_view(i))).collect();
    let qr = jacobian.qr();
    qr.q_tr_mul(&mut residual);
    qr.q_tr_mul(&mut design);
    let (residual, design) = (residual.rows(3, freedom).into(), design.rows(3, freedom).into());
    Some((Reduced { residual, design, by_view }, ground))
}

/// Ground point of a track, residuals and their Jacobian.
type Triangulated = Option<(LonLatHeight, DVector<f64>, DMatrix<f64>)>;

/// Finds the ground point with the least squared residuals in the images, observed − projected, and
/// their Jacobian with respect to metres east, north and up. Returns `None` if the rays do not
/// meet.
fn triangulate(cameras: &[RpcCamera], track: &Track) -> Result<Triangulated, CameraError> {
    let Some(&(first, at)) = track.first() else { return Ok(None) };
    let mut ground = cameras[first].localize(at, cameras[first].rpc.height_off)?;
    let (mut residual, mut jacobian) = (DVector::zeros(0), DMatrix::zeros(0, 0));
    for _ in 0..6 {
        (residual, jacobian) = linearised(cameras, track, ground)?;
        let normal: Matrix3<f64> = (jacobian.transpose() * &jacobian).fixed_view::<3, 3>(0, 0).into();
        let right: Vector3<f64> = (jacobian.transpose() * &residual).fixed_rows::<3>(0).into();
        let Some(step) = normal.try_inverse().map(|n| n * right) else { return Ok(None) };
        ground = moved(ground, step);
        // A tenth of a millimetre is far below any residual.
        if step.norm() < 1e-4 {
            break;
        }
    }
    Ok(ground.height_m.is_finite().then_some((ground, residual, jacobian)))
}

/// Metres per degree of latitude. The value only scales the unknowns, so that its error does not
/// matter.
const METRES_PER_DEGREE: f64 = 111_320.0;

/// Returns a ground point moved by metres east, north and up.
fn moved(g: LonLatHeight, east_north_up: Vector3<f64>) -> LonLatHeight {
    let lon_scale = METRES_PER_DEGREE * g.lat_deg.to_radians().cos().max(1e-3);
    LonLatHeight::new(
        g.lon_deg + east_north_up[0] / lon_scale,
        g.lat_deg + east_north_up[1] / METRES_PER_DEGREE,
        g.height_m + east_north_up[2],
    )
}

/// Returns the residuals of a track at a ground point and their Jacobian.
fn linearised(
    cameras: &[RpcCamera],
    track: &Track,
    ground: LonLatHeight,
) -> Result<(DVector<f64>, DMatrix<f64>), CameraError> {
    let rows = 2 * track.len();
    let (mut residual, mut jacobian) = (DVector::zeros(rows), DMatrix::zeros(rows, 3));
    for (i, (view, observed)) in track.iter().enumerate() {
        let camera = &cameras[*view];
        let p = camera.project(ground)?;
        residual[2 * i] = observed.sample - p.sample;
        residual[2 * i + 1] = observed.line - p.line;
        for axis in 0..3 {
            let mut d = Vector3::zeros();
            // Cameras are linear at the scale of a metre.
            d[axis] = 1.0;
            let q = camera.project(moved(ground, d))?;
            jacobian[(2 * i, axis)] = q.sample - p.sample;
            jacobian[(2 * i + 1, axis)] = q.line - p.line;
        }
    }
    Ok((residual, jacobian))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::camera::leaning_camera;

    const SIZE: usize = 400;

    /// Tracks of a lattice of ground points, seen by cameras whose pointing is off by `shifts`.
    fn tracks(cameras: &[RpcCamera], shifts: &[[f64; 2]]) -> Vec<Track> {
        let point = |i: usize| {
            let (e, n) = ((i % 12) as f64 / 12.0 - 0.45, (i / 12) as f64 / 12.0 - 0.45);
            LonLatHeight::new(e * 1.6e-3, n * 1.6e-3, ((i * 37) % 50) as f64 - 10.0)
        };
        let seen = |g: LonLatHeight| {
            let one = |(view, camera): (usize, &RpcCamera)| {
                let p = camera.project(g).unwrap();
                (view, ImagePoint::new(p.sample + shifts[view][0], p.line + shifts[view][1]))
            };
            cameras.iter().enumerate().map(one).collect()
        };
        (0..144).map(|i| seen(point(i))).collect()
    }

    fn three_cameras() -> [RpcCamera; 3] {
        [[0.0, 0.02], [0.5, 0.1], [-0.3, 0.4]].map(|p| leaning_camera(SIZE, p))
    }

    #[test]
    fn planted_shifts_are_taken_out_among_outliers() {
        let cameras = three_cameras();
        let mut tracks = tracks(&cameras, &[[3.0, -4.0], [-1.0, 2.0], [0.5, 5.0]]);
        for (i, track) in tracks.iter_mut().enumerate().filter(|(i, _)| i % 7 == 0) {
            track[1].1.line += 9.0 + (i % 5) as f64;
        }
        let found = adjust(&cameras, &[(SIZE, SIZE); 3], &tracks, &AdjustConfig::default());
        assert_eq!(found.order, ModelOrder::Translation);
        assert!(found.rms_px < 0.02, "{}", found.rms_px);
        let outliers = found.ground.iter().filter(|g| g.is_none()).count();
        assert_eq!(outliers, tracks.len().div_ceil(7));
    }

    #[test]
    fn a_view_that_is_grossly_off_is_moved_and_the_others_stay() {
        // The views lie along a pass: a common height change moves views 0 and 2 apart, and nothing
        // moves view 1 alone.
        let cameras = [[0.0, 0.5], [0.05, 0.0], [0.0, -0.5]].map(|p| leaning_camera(SIZE, p));
        let tracks = tracks(&cameras, &[[0.0; 2], [31.0, -27.0], [0.0; 2]]);
        let found = adjust(&cameras, &[(SIZE, SIZE); 3], &tracks, &AdjustConfig::default());
        let [a, b, c] = [0, 1, 2].map(|i| found.corrections[i].translation_px);
        assert!(a[0].hypot(a[1]) < 3.0 && c[0].hypot(c[1]) < 3.0, "{a:?} {b:?} {c:?}");
        assert!(found.rms_px < 0.02, "{}", found.rms_px);
    }

    #[test]
    fn good_pointing_is_left_alone_and_no_ties_change_nothing() {
        let cameras = three_cameras();
        let found = adjust(&cameras, &[(SIZE, SIZE); 3], &tracks(&cameras, &[[0.0; 2]; 3]), &AdjustConfig::default());
        assert_eq!(found.order, ModelOrder::None);
        let found = adjust(&cameras, &[(SIZE, SIZE); 3], &[], &AdjustConfig::default());
        assert!(found.corrections.iter().all(|c| *c == ImageCorrection::IDENTITY));
    }
}
