//! The ground point of a track: where its lines of sight come closest to each other in the images.
//!
//! Newton's method on metres east, north and up. The derivatives come from differences over a
//! metre, over which cameras are linear. A point whose position is known to some metres adds its
//! distance from there, as three more residuals.

use camera::{CameraError, ImagePoint, RpcCamera};
use geodesy::LonLatHeight;
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

/// One ground point seen in two or more views: index of the view, position in full-resolution
/// pixels.
pub type Track = Vec<(usize, ImagePoint)>;

/// A ground position that is known, with weights that turn metres east, north and up into pixels of
/// the images' noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    pub(super) ground: LonLatHeight,
    pub(super) px_per_m: Vector3<f64>,
}

/// A ground point and what the views say of it.
pub(super) struct Intersection {
    pub(super) ground: LonLatHeight,
    /// Residuals, observed − projected, and their derivatives, one of each per view of the track.
    pub(super) seen: Vec<(Vector2<f64>, Matrix2x3<f64>)>,
    /// Residual of a known position, pixels; zero for other points.
    pub(super) known_px: Vector3<f64>,
}

/// Largest number of rounds. Cameras are nearly linear, so that two or three are enough.
const ROUNDS: usize = 6;
/// Step that ends the rounds, metres. The point then does not depend on where the search began,
/// but for rounding.
const SETTLED_M: f64 = 1e-6;
/// Metres per degree of latitude. The value only scales the unknowns, so that its error does not
/// matter.
const METRES_PER_DEGREE: f64 = 111_320.0;

/// Returns the ground point at which the lines of sight of a track come closest to each other;
/// `None` where they do not meet, where a camera fails, or with fewer than two views.
///
/// ```
/// use camera::{ImagePoint, RpcCamera};
///
/// let nobody: [RpcCamera; 0] = [];
/// assert!(sweep::pointing::ground_of(&nobody, &Vec::new()).is_none());
/// ```
pub fn ground_of(cameras: &[RpcCamera], track: &Track) -> Option<LonLatHeight> {
    let found = intersect(cameras, track, None, None).filter(|_| track.len() >= 2)?;
    found.ground.height_m.is_finite().then_some(found.ground)
}

/// Finds the ground point with the least squared residuals. The search begins at `start`, or else
/// at the known position, or else on the line of sight of the first view. Returns `None` if the
/// rays do not meet.
pub(super) fn intersect(
    cameras: &[RpcCamera],
    track: &Track,
    known: Option<&Known>,
    start: Option<LonLatHeight>,
) -> Option<Intersection> {
    let &(first, at) = track.first()?;
    let on_sight = || cameras[first].localize(at, cameras[first].rpc.height_off).ok();
    let mut ground = start.or(known.map(|k| k.ground)).or_else(on_sight)?;
    let mut found = None;
    for _ in 0..ROUNDS {
        let seen = linearised(cameras, track, ground).ok()?;
        let known_px = known.map_or(Vector3::zeros(), |k| apart_m(k.ground, ground).component_mul(&k.px_per_m));
        let mut normal: Matrix3<f64> = seen.iter().map(|(_, j)| j.transpose() * j).sum();
        let mut right: Vector3<f64> = seen.iter().map(|(r, j)| j.transpose() * r).sum();
        if let Some(k) = known {
            normal += Matrix3::from_diagonal(&k.px_per_m.component_mul(&k.px_per_m));
            right += known_px.component_mul(&k.px_per_m);
        }
        let step = normal.try_inverse()? * right;
        ground = moved(ground, step);
        found = Some((seen, known_px));
        if step.norm() < SETTLED_M {
            break;
        }
    }
    let (seen, known_px) = found?;
    ground.height_m.is_finite().then_some(Intersection { ground, seen, known_px })
}

/// Returns a ground point moved by metres east, north and up.
fn moved(g: LonLatHeight, east_north_up: Vector3<f64>) -> LonLatHeight {
    let [lon_scale, lat_scale] = metres_per_degree(g);
    LonLatHeight::new(
        g.lon_deg + east_north_up[0] / lon_scale,
        g.lat_deg + east_north_up[1] / lat_scale,
        g.height_m + east_north_up[2],
    )
}

/// Returns the metres east, north and up from one point to a near one.
fn apart_m(to: LonLatHeight, from: LonLatHeight) -> Vector3<f64> {
    let [lon_scale, lat_scale] = metres_per_degree(from);
    Vector3::new(
        (to.lon_deg - from.lon_deg) * lon_scale,
        (to.lat_deg - from.lat_deg) * lat_scale,
        to.height_m - from.height_m,
    )
}

fn metres_per_degree(g: LonLatHeight) -> [f64; 2] {
    [METRES_PER_DEGREE * g.lat_deg.to_radians().cos().max(1e-3), METRES_PER_DEGREE]
}

/// Residuals of a track at a ground point with their derivatives.
type Linearised = Vec<(Vector2<f64>, Matrix2x3<f64>)>;

/// Returns the residuals of a track at a ground point and their derivatives.
fn linearised(cameras: &[RpcCamera], track: &Track, ground: LonLatHeight) -> Result<Linearised, CameraError> {
    let mut out = Vec::with_capacity(track.len());
    for (view, observed) in track {
        let camera = &cameras[*view];
        let p = camera.project(ground)?;
        let residual = Vector2::new(observed.sample - p.sample, observed.line - p.line);
        let mut jacobian = Matrix2x3::zeros();
        for axis in 0..3 {
            let mut d = Vector3::zeros();
            // Cameras are linear at the scale of a metre.
            d[axis] = 1.0;
            let q = camera.project(moved(ground, d))?;
            jacobian[(0, axis)] = q.sample - p.sample;
            jacobian[(1, axis)] = q.line - p.line;
        }
        out.push((residual, jacobian));
    }
    Ok(out)
}
