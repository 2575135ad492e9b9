//! The least-squares similarity of point pairs (Umeyama, IEEE PAMI 13, 1991).
//!
//! With Σ = 1/n Σ (y − ȳ)(x − x̄)ᵀ = U D Vᵀ and S = diag(1, 1, det U det V): R = U S Vᵀ, s = tr(D
//! S) / σ²ₓ, t = ȳ − s R x̄. The fit fails for fewer than three pairs and for points on a line.

use camera::Similarity;
use nalgebra::{Matrix3, Vector3};

use super::error::AlignError;

/// Ratio of spread across a line to spread along it below which positions do not determine the
/// rotation about the line.
const SPREAD_MIN: f64 = 1e-6;

/// One position in both frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointPair {
    /// Position in the model.
    pub source: [f64; 3],
    /// Position in the world.
    pub target: [f64; 3],
}

/// Returns the similarity with the least Σ |target − s R source − t|².
///
/// # Errors
/// [`AlignError::TooFew`], [`AlignError::NotFinite`], [`AlignError::Degenerate`].
///
/// ```
/// use colmap::align::{PointPair, fit_similarity};
/// let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let pairs = corners.map(|source| PointPair { source, target: source.map(|c| 2.0 * c + 5.0) });
/// let world_from_model = fit_similarity(&pairs)?;
/// assert!((world_from_model.scale() - 2.0).abs() < 1e-12);
/// # Ok::<(), colmap::align::AlignError>(())
/// ```
pub fn fit_similarity(pairs: &[PointPair]) -> Result<Similarity, AlignError> {
    if pairs.len() < 3 {
        return Err(AlignError::TooFew { found: pairs.len(), needed: 3 });
    }
    let finite = |p: &PointPair| p.source.iter().chain(&p.target).all(|c| c.is_finite());
    if let Some(index) = pairs.iter().position(|p| !finite(p)) {
        return Err(AlignError::NotFinite { index });
    }
    let count = pairs.len() as f64;
    let mean =
        |side: fn(&PointPair) -> [f64; 3]| pairs.iter().map(|p| Vector3::from(side(p))).sum::<Vector3<f64>>() / count;
    let (source_mean, target_mean) = (mean(|p| p.source), mean(|p| p.target));
    let (mut covariance, mut variance) = (Matrix3::zeros(), 0.0);
    for pair in pairs {
        let (x, y) = (Vector3::from(pair.source) - source_mean, Vector3::from(pair.target) - target_mean);
        covariance += y * x.transpose() / count;
        variance += x.norm_squared() / count;
    }
    let degenerate = |ratio: f64| AlignError::Degenerate { ratio };
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Err(degenerate(0.0)) };
    let d = svd.singular_values;
    // Singular values are products of the spreads in both frames.
    let ratio = if d[0] > 0.0 { (d[1] / d[0]).max(0.0).sqrt() } else { 0.0 };
    if !(ratio > SPREAD_MIN && variance > 0.0) {
        return Err(degenerate(ratio));
    }
    let sign = if u.determinant() * v_t.determinant() < 0.0 { -1.0 } else { 1.0 };
    let s = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign));
    let rotation = u * s * v_t;
    let scale = (d[0] + d[1] + sign * d[2]) / variance;
    let translation = target_mean - scale * (rotation * source_mean);
    let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|j| rotation[(i, j)]));
    Similarity::new(scale, rows, translation.into()).map_err(|_| degenerate(ratio))
}

/// Returns the spread of points across their main line over the spread along it. Near 0, the
/// rotation about the line is badly determined.
pub fn spread_ratio(points: impl Iterator<Item = [f64; 3]> + Clone) -> f64 {
    let count = points.clone().count().max(1) as f64;
    let mean = points.clone().map(Vector3::from).sum::<Vector3<f64>>() / count;
    let covariance: Matrix3<f64> = points.map(|p| Vector3::from(p) - mean).map(|d| d * d.transpose() / count).sum();
    let mut values: [f64; 3] = covariance.symmetric_eigenvalues().into();
    values.sort_by(|a, b| b.total_cmp(a));
    if values[0] > 0.0 { (values[1].max(0.0) / values[0]).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use camera::Pose;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_planted_similarity_comes_back(
            q in prop::array::uniform4(-1.0..1.0f64), scale in 0.01..100.0f64, t in prop::array::uniform3(-1e3..1e3f64),
            points in prop::collection::vec(prop::array::uniform3(-10.0..10.0f64), 4..20),
        ) {
            prop_assume!(q.iter().map(|c| c * c).sum::<f64>() > 0.1);
            prop_assume!(spread_ratio(points.iter().copied()) > 0.05);
            let rotation = Pose::from_quaternion(q, [0.0; 3]).unwrap().rotation;
            let planted = Similarity::new(scale, rotation, t).unwrap();
            let pairs: Vec<PointPair> = points.iter().map(|&source| PointPair { source, target: planted.apply(source) }).collect();
            let found = fit_similarity(&pairs).unwrap();
            prop_assert!((found.scale() / scale - 1.0).abs() < 1e-9);
            for p in &pairs {
                let back = found.apply(p.source);
                prop_assert!((0..3).all(|i| (back[i] - p.target[i]).abs() < 1e-6));
            }
        }
    }

    #[test]
    fn mirrored_points_are_turned_as_well_as_they_can_be() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
        let pairs = corners.map(|source| PointPair { source, target: [-source[0], source[1], source[2]] });
        let r = fit_similarity(&pairs).unwrap().rotation();
        let det = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1]) - r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0])
            + r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
        assert!((det - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_determines_nothing_is_refused() {
        let pair = |x: f64| PointPair { source: [x, 2.0 * x, 0.0], target: [x, 0.0, x] };
        assert!(matches!(fit_similarity(&[pair(0.0), pair(1.0)]), Err(AlignError::TooFew { found: 2, needed: 3 })));
        assert!(matches!(fit_similarity(&[0.0, 1.0, 2.0, 5.0].map(pair)), Err(AlignError::Degenerate { .. })));
        assert!(matches!(fit_similarity(&[1.0; 4].map(pair)), Err(AlignError::Degenerate { .. })));
        let broken = PointPair { source: [f64::NAN, 0.0, 0.0], target: [0.0; 3] };
        assert!(matches!(fit_similarity(&[pair(0.0), broken, pair(1.0)]), Err(AlignError::NotFinite { index: 1 })));
    }
}
