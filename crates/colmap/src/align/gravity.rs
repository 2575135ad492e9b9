//! Gravity as a prior of an alignment: the up direction of the cameras is up in the world.
//!
//! Positions along a straight street determine the rotation about the street by their noise only.
//! People hold cameras level, so their right axes are horizontal. The up direction u of a model
//! minimises Σ (xᵢ · u)² + λ n |u − ȳ|², where xᵢ are the right axes and ȳ is the mean of the
//! cameras' own up directions. Cameras of several headings determine it by the first term; the
//! second decides where all look the same way.
//!
//! The rotation then maximises tr(Rᵀ K) with K = s/σ² Σ (y − ȳ)(x − x̄)ᵀ + e u ᵀ/σ_u², where e is
//! up in the world, σ the standard deviation of the positions and σ_u of the up direction. This is
//! the least-squares fit (Wahba's problem) of positions and direction together.

use camera::Similarity;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::error::AlignError;
use super::umeyama::PointPair;

/// Weight λ of the cameras' own up directions against their right axes.
const OWN_UP: f64 = 0.05;
/// Least ratio of the second singular value of K to the first one.
const RATIO_MIN: f64 = 1e-9;

/// The up direction of a camera model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraUp {
    /// Unit vector in the frame of the model.
    pub direction: [f64; 3],
    /// Root mean square angle between it and the up directions of the cameras, degrees.
    pub spread_deg: f64,
    /// Standard deviation of the direction, degrees.
    pub sigma_deg: f64,
}

/// Standard deviation of the up direction of cameras that people hold, degrees. Cameras that look
/// all the same way share an error of their pitch, which more of them do not reduce.
const HELD_DEG: f64 = 1.0;

/// Returns the up direction of cameras, given by their rotations from the model (rows: right, down,
/// forward); `None` without cameras, or where their up directions cancel out.
///
/// ```
/// let level = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
/// let up = colmap::align::camera_up(&[level]).unwrap();
/// assert!((up.direction[2] - 1.0).abs() < 1e-9);
/// ```
pub fn camera_up(rotations: &[[[f64; 3]; 3]]) -> Option<CameraUp> {
    let count = rotations.len() as f64;
    let own = |rotation: &[[f64; 3]; 3]| -Vector3::from(rotation[1]);
    let mean = rotations.iter().map(own).sum::<Vector3<f64>>() / count;
    if rotations.is_empty() || mean.norm() <= 0.5 {
        return None;
    }
    let mean = mean.normalize();
    let right = |rotation: &[[f64; 3]; 3]| Vector3::from(rotation[0]);
    let level: Matrix3<f64> = rotations.iter().map(right).map(|x| x * x.transpose() / count).sum();
    let held = (Matrix3::identity() - mean * mean.transpose()) * OWN_UP;
    let found = SymmetricEigen::new(level + held);
    let least = found.eigenvalues.imin();
    let up = found.eigenvectors.column(least).into_owned();
    let up = if up.dot(&mean) < 0.0 { -up } else { up };
    let angle = |rotation: &[[f64; 3]; 3]| up.dot(&own(rotation)).clamp(-1.0, 1.0).acos().powi(2);
    let spread_deg = (rotations.iter().map(angle).sum::<f64>() / count).sqrt().to_degrees();
    Some(CameraUp { direction: up.into(), spread_deg, sigma_deg: HELD_DEG })
}

/// Fits a similarity to pairs whose positions have a standard deviation of `sigma_m` along each
/// axis, and to the up direction of the model.
pub(super) fn fit_with_up(pairs: &[PointPair], up: &CameraUp, sigma_m: f64) -> Result<Similarity, AlignError> {
    let count = pairs.len() as f64;
    let mean =
        |side: fn(&PointPair) -> [f64; 3]| pairs.iter().map(|p| Vector3::from(side(p))).sum::<Vector3<f64>>() / count;
    let (source_mean, target_mean) = (mean(|p| p.source), mean(|p| p.target));
    let (mut moment, mut source, mut target) = (Matrix3::zeros(), 0.0, 0.0);
    for pair in pairs {
        let (x, y) = (Vector3::from(pair.source) - source_mean, Vector3::from(pair.target) - target_mean);
        moment += y * x.transpose();
        source += x.norm_squared();
        target += y.norm_squared();
    }
    let degenerate = || AlignError::Degenerate { ratio: 0.0 };
    let guess = (target / source).sqrt();
    if !(guess > 0.0 && guess.is_finite()) {
        return Err(degenerate());
    }
    let weight = up.sigma_deg.to_radians().powi(-2);
    let pull = Vector3::z() * Vector3::from(up.direction).transpose() * weight;
    let svd = (moment * (guess / sigma_m.powi(2)) + pull).svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Err(degenerate()) };
    if svd.singular_values[1] <= RATIO_MIN * svd.singular_values[0] {
        return Err(degenerate());
    }
    let sign = if u.determinant() * v_t.determinant() < 0.0 { -1.0 } else { 1.0 };
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    let scale = (rotation.transpose() * moment).trace() / source;
    let translation = target_mean - scale * (rotation * source_mean);
    let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|j| rotation[(i, j)]));
    Similarity::new(scale, rows, translation.into()).map_err(|_| degenerate())
}
