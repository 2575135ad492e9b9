//! What the points that were found are evidence of: the shift that most share, and the order of the
//! correction that predicts points it was not made from.

use camera::{ImageCorrection, RpcCamera};
use sweep::pointing::{AdjustConfig, ChipConfig, ControlPoint, ModelOrder, Observations, adjust_to_control};

/// Residual up to which a point agrees with a correction, pixels.
pub(super) const AGREES_PX: f64 = 1.5;
/// Distance from the shift that most share of points that a drift or an affine term may move,
/// pixels: twice what agrees with a correction.
const SHARES_PX: f64 = 2.0 * AGREES_PX;
/// Weak prior on the parameters, pixels: any error of the pointing is as likely as another.
const PRIOR_PX: f64 = 100.0;
/// Most steps from one half of the points to the next. Each makes the residuals smaller, so that
/// few are needed.
const TRIMMED_STEPS_MAX: usize = 20;
/// Parts of the points, each of which is held out once.
const PARTS: usize = 5;
/// Lead that another order needs, standard errors of the mean difference of held-out residuals.
const LEAD_SIGMAS: f64 = 2.0;
/// Least number of points for each parameter of an order.
const POINTS_PER_PARAMETER: usize = 4;
/// Points with which every order is tried.
pub(super) const POINTS_FOR_ORDERS: usize = ModelOrder::Affine.parameters() * POINTS_PER_PARAMETER;

/// Iterates over observed minus projected places, pixels; NaN where the camera fails.
pub(super) fn residuals<'a>(camera: &'a RpcCamera, points: &'a [ControlPoint]) -> impl Iterator<Item = [f64; 2]> + 'a {
    points.iter().map(|point| match (point.seen.first(), camera.project(point.ground)) {
        (Some((_, seen)), Ok(at)) => [seen.sample - at.sample, seen.line - at.line],
        _ => [f64::NAN; 2],
    })
}

/// Returns the points whose residuals lie within [`SHARES_PX`] of the one that has most others so
/// near.
pub(super) fn sharing(camera: &RpcCamera, points: &[ControlPoint]) -> Vec<ControlPoint> {
    let all: Vec<[f64; 2]> = residuals(camera, points).collect();
    let near = |a: &[f64; 2], b: &[f64; 2], px: f64| (a[0] - b[0]).hypot(a[1] - b[1]) <= px;
    let count = |a: &[f64; 2], px: f64| all.iter().filter(|b| near(a, b, px)).count();
    let most = all.iter().max_by_key(|a| (count(a, SHARES_PX), count(a, AGREES_PX)));
    let Some(most) = most else { return Vec::new() };
    let chosen = points.iter().zip(&all).filter(|(_, residual)| near(residual, most, SHARES_PX));
    chosen.map(|(point, _)| point.clone()).collect()
}

/// Returns the correction of the least-squares adjustment to points, which follows that of the
/// camera.
pub(super) fn adjusted(
    camera: &RpcCamera,
    size: (usize, usize),
    points: &[ControlPoint],
    order: ModelOrder,
) -> ImageCorrection {
    let adjust = AdjustConfig { max_order: order, prior_px: PRIOR_PX, prior_drift: f64::INFINITY };
    let observed = Observations { tracks: &[], control: points };
    let found = adjust_to_control(std::slice::from_ref(camera), &[size], observed, &adjust);
    found.corrections.first().copied().unwrap_or(camera.correction)
}

/// Returns the correction of the half of the points that it fits best (least trimmed squares,
/// Rousseeuw 1984), of all points where they are few: vehicles, crowns and whatever else the
/// surface does not hold stand off it, and all of them to one side.
pub(super) fn adjusted_to_most(
    camera: &RpcCamera,
    size: (usize, usize),
    points: &[ControlPoint],
    order: ModelOrder,
) -> ImageCorrection {
    let mut found = adjusted(camera, size, points, order);
    if points.len() < 2 * order.parameters() * POINTS_PER_PARAMETER {
        return found;
    }
    for _ in 0..TRIMMED_STEPS_MAX {
        let with = RpcCamera { rpc: camera.rpc.clone(), correction: found };
        let mut by_residual: Vec<(f64, usize)> =
            residuals(&with, points).enumerate().map(|(i, [along, across])| (along.hypot(across), i)).collect();
        by_residual.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let half: Vec<ControlPoint> =
            by_residual[..points.len().div_ceil(2)].iter().map(|(_, i)| points[*i].clone()).collect();
        let next = adjusted(camera, size, &half, order);
        if next == found {
            break;
        }
        found = next;
    }
    found
}

/// Returns the least order that predicts held-out points as well as any: a higher one is taken
/// where it makes their squared residuals smaller by more than [`LEAD_SIGMAS`] standard errors.
pub(super) fn order_of(camera: &RpcCamera, size: (usize, usize), points: &[ControlPoint]) -> ModelOrder {
    let mut best = (ModelOrder::Translation, held_out(camera, size, points, ModelOrder::Translation));
    for order in [ModelOrder::Drift, ModelOrder::Affine] {
        if points.len() < order.parameters() * POINTS_PER_PARAMETER {
            break;
        }
        let own = held_out(camera, size, points, order);
        let gains: Vec<f64> = best.1.iter().zip(&own).map(|(a, b)| a - b).collect();
        let count = gains.len() as f64;
        let mean = gains.iter().sum::<f64>() / count;
        let variance = gains.iter().map(|gain| (gain - mean) * (gain - mean)).sum::<f64>() / (count - 1.0);
        if mean > LEAD_SIGMAS * (variance / independent(count, size)).sqrt() {
            best = (order, own);
        }
    }
    best.0
}

/// Returns how many of so many points count as independent: no more than chips fit side by side
/// into the image, because those that show the same pixels have the same errors.
fn independent(count: f64, (width, height): (usize, usize)) -> f64 {
    let side = (2 * ChipConfig::default().radius_max + 1) as f64;
    count.min((width as f64 / side) * (height as f64 / side)).max(1.0)
}

/// Returns the squared residual of each point under the correction of the points of other parts,
/// at most that of a point that does not agree, pixels squared.
fn held_out(camera: &RpcCamera, size: (usize, usize), points: &[ControlPoint], order: ModelOrder) -> Vec<f64> {
    let mut out = vec![AGREES_PX * AGREES_PX; points.len()];
    for part in 0..PARTS {
        let is_held = |i: &usize| i % PARTS == part;
        let others = (0..points.len()).filter(|i| !is_held(i)).map(|i| points[i].clone()).collect::<Vec<_>>();
        let correction = adjusted(camera, size, &others, order);
        let with = RpcCamera { rpc: camera.rpc.clone(), correction };
        for (i, [a, b]) in residuals(&with, points).enumerate().filter(|(i, _)| is_held(i)) {
            out[i] = (a * a + b * b).min(AGREES_PX * AGREES_PX);
        }
    }
    out
}
