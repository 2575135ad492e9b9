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

/// Returns the least-squares similarity of pairs among those that turn a rotation about the
/// vertical only: what `upright` turns up stays up. With x' = R₀ (x − x̄) and M = Σ (y − ȳ) x'ᵀ,
/// the angle is atan2(M₁₀ − M₀₁, M₀₀ + M₁₁), and s = tr(Rᵀ M) / Σ |x'|².
///
/// # Errors
/// [`AlignError::TooFew`] below two pairs, [`AlignError::NotFinite`], [`AlignError::Degenerate`]
/// for pairs above one another, which determine no heading.
///
/// ```
/// use colmap::align::{PointPair, fit_level};
/// let pair = |x: f64, y: f64, z: f64| PointPair { source: [x, y, z], target: [-2.0 * y, 2.0 * x, 2.0 * z + 5.0] };
/// let found = fit_level(&[pair(0.0, 0.0, 1.0), pair(10.0, 0.0, 1.5)], [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]])?;
/// assert!((found.scale() - 2.0).abs() < 1e-9 && (found.rotation()[1][0] - 1.0).abs() < 1e-9);
/// # Ok::<(), colmap::align::AlignError>(())
/// ```
pub fn fit_level(pairs: &[PointPair], upright: [[f64; 3]; 3]) -> Result<Similarity, AlignError> {
    if pairs.len() < 2 {
        return Err(AlignError::TooFew { found: pairs.len(), needed: 2 });
    }
    let is_finite = |p: &PointPair| p.source.iter().chain(&p.target).all(|c| c.is_finite());
    if let Some(index) = pairs.iter().position(|pair| !is_finite(pair)) {
        return Err(AlignError::NotFinite { index });
    }
    let base = Matrix3::from_fn(|i, j| upright[i][j]);
    let count = pairs.len() as f64;
    let source_mean = pairs.iter().map(|p| base * Vector3::from(p.source)).sum::<Vector3<f64>>() / count;
    let target_mean = pairs.iter().map(|p| Vector3::from(p.target)).sum::<Vector3<f64>>() / count;
    let (mut moment, mut source, mut flat, mut target) = (Matrix3::zeros(), 0.0, 0.0, 0.0);
    for pair in pairs {
        let x = base * Vector3::from(pair.source) - source_mean;
        let y = Vector3::from(pair.target) - target_mean;
        moment += y * x.transpose();
        source += x.norm_squared();
        flat += x.xy().norm_squared();
        target += y.xy().norm_squared();
    }
    let degenerate = || AlignError::Degenerate { ratio: 0.0 };
    let (across, along): (f64, f64) = (moment[(1, 0)] - moment[(0, 1)], moment[(0, 0)] + moment[(1, 1)]);
    // The heading is that of horizontal distances; rounding must not be taken for one.
    if !(across.hypot(along) > RATIO_MIN * (flat * target).sqrt() && flat > RATIO_MIN * source) {
        return Err(degenerate());
    }
    let (sine, cosine) = across.atan2(along).sin_cos();
    let turn = Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
    let scale = (turn.transpose() * moment).trace() / source;
    let rotation = turn * base;
    let translation = target_mean - scale * (turn * source_mean);
    let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|j| rotation[(i, j)]));
    Similarity::new(scale, rows, translation.into()).map_err(|_| degenerate())
}

/// Returns the normal of the plane through points near `middle`, on the side of `above`: the
/// direction in which they spread least.
pub fn plane_normal(points: impl Iterator<Item = [f64; 3]>, middle: [f64; 3], above: [f64; 3]) -> [f64; 3] {
    // Far points count by their direction only, so that a few wild ones do not turn the plane.
    let offset = points.map(|p| Vector3::from(p) - Vector3::from(middle)).filter(|d| d.norm() > 0.0);
    let spread: Matrix3<f64> = offset.map(|d| d.normalize()).map(|d| d * d.transpose()).sum();
    let found = SymmetricEigen::new(spread);
    let normal = found.eigenvectors.column(found.eigenvalues.imin()).into_owned();
    if normal.dot(&Vector3::from(above)) < 0.0 { (-normal).into() } else { normal.into() }
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

#[cfg(test)]
mod tests {
    use super::*;
    use camera::Pose;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_heading_comes_back_and_up_stays_up(
            q in prop::array::uniform4(-1.0..1.0f64), heading in -3.1..3.1f64, scale in 0.01..100.0f64,
            t in prop::array::uniform3(-1e3..1e3f64),
            points in prop::collection::vec(prop::array::uniform3(-10.0..10.0f64), 2..6),
        ) {
            prop_assume!(q.iter().map(|c| c * c).sum::<f64>() > 0.1);
            let upright = Pose::from_quaternion(q, [0.0; 3]).unwrap().rotation;
            let (s, c) = heading.sin_cos();
            let turn = Similarity::new(1.0, [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], [0.0; 3]).unwrap();
            let planted = Similarity::new(scale, turn.after(&Similarity::new(1.0, upright, [0.0; 3]).unwrap()).rotation(), t).unwrap();
            let pairs: Vec<PointPair> = points.iter().map(|&source| PointPair { source, target: planted.apply(source) }).collect();
            let (a, b) = (pairs[0].target, pairs[1].target);
            prop_assume!((a[0] - b[0]).hypot(a[1] - b[1]) > 0.1 * scale);
            let found = fit_level(&pairs, upright).unwrap();
            prop_assert!((found.scale() / scale - 1.0).abs() < 1e-9);
            prop_assert!(pairs.iter().all(|p| (0..3).all(|i| (found.apply(p.source)[i] - p.target[i]).abs() < 1e-6)));
        }
    }

    #[test]
    fn pairs_above_one_another_have_no_heading() {
        let pair = |z: f64| PointPair { source: [1.0, 2.0, z], target: [5.0, 6.0, z] };
        let level = Similarity::IDENTITY.rotation();
        assert!(matches!(fit_level(&[pair(0.0), pair(3.0)], level), Err(AlignError::Degenerate { .. })));
        assert!(matches!(fit_level(&[pair(0.0)], level), Err(AlignError::TooFew { found: 1, needed: 2 })));
        let broken = PointPair { source: [f64::NAN; 3], target: [0.0; 3] };
        assert!(matches!(fit_level(&[pair(0.0), broken], level), Err(AlignError::NotFinite { index: 1 })));
    }

    #[test]
    fn the_normal_of_a_plane_is_on_the_side_of_the_cameras() {
        let grid =
            || (0..100).map(|i| [f64::from(i % 10) - 4.5, 0.3 * (f64::from(i / 10) - 4.5), f64::from(i / 10) - 4.5]);
        let wild = std::iter::once([0.0, 1e6, -1e6]);
        let expected = Vector3::new(0.0, 1.0, -0.3).normalize();
        for above in [1.0, -1.0] {
            let found = plane_normal(grid().chain(wild.clone()), [0.0; 3], [0.0, above, 0.0]);
            assert!((Vector3::from(found) - above * expected).norm() < 0.05, "{found:?}");
        }
    }
}
