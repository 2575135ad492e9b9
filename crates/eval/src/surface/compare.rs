//! Comparison of two surfaces.

use rayon::prelude::*;
use serde::Serialize;

use super::config::SurfaceComparisonConfig;
use super::distances::{DistanceStatistics, NormalAngle, ThresholdScore};
use super::error::SurfaceError;
use super::index::{Nearest, PointIndex, SurfaceIndex};
use super::m3c2::{M3c2, m3c2};
use super::model::LocalSurface;
use super::normals::normals;
use super::sample::Samples;
use super::voxels::{VoxelOverlap, overlap};
use numeric::vector::dot;

/// Distances, angles and overlap of a test surface and a reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SurfaceComparison {
    /// Distances from samples of the test to the reference.
    pub accuracy: DistanceStatistics,
    /// Distances from samples of the reference to the test.
    pub completeness: DistanceStatistics,
    /// Precision, recall and F at each threshold.
    pub scores: Vec<ThresholdScore>,
    /// Mean of the two mean distances, metres.
    pub chamfer_m: f64,
    /// Largest of all distances, metres.
    pub hausdorff_m: f64,
    /// Angle of the normals. `None` if no sample has two.
    pub normal_angle: Option<NormalAngle>,
    /// Distances along normals. `None` if no core point has both surfaces in its cylinder.
    pub m3c2: Option<M3c2>,
    /// Volumetric overlap.
    pub voc: VoxelOverlap,
    /// Samples per square metre of the test, if it is a mesh.
    pub test_samples_per_m2: Option<f64>,
    /// Samples per square metre of the reference, if it is a mesh.
    pub reference_samples_per_m2: Option<f64>,
}

/// Compares two surfaces about one local origin.
///
/// ```
/// use eval::{LocalSurface, SurfaceComparisonConfig, compare_surfaces};
///
/// let cloud = |z: f64| LocalSurface::Points((0..9).map(|i| [f64::from(i), 0.0, z]).collect());
/// let found = compare_surfaces(&cloud(0.5), &cloud(0.0), &SurfaceComparisonConfig::default())?;
/// assert_eq!((found.chamfer_m, found.hausdorff_m), (0.5, 0.5));
/// # Ok::<(), eval::SurfaceError>(())
/// ```
///
/// # Errors
/// [`SurfaceError`] if a surface is empty, if a point is not finite, if a triangle refers to a
/// missing corner, or if a setting is not positive.
pub fn compare_surfaces(
    test: &LocalSurface,
    reference: &LocalSurface,
    config: &SurfaceComparisonConfig,
) -> Result<SurfaceComparison, SurfaceError> {
    config.check()?;
    test.check("test")?;
    reference.check("reference")?;
    let (t, r) = (Samples::of(test, config, "test")?, Samples::of(reference, config, "reference")?);
    let to_reference = nearest_of_all(&SurfaceIndex::new(reference), &t.points);
    let to_test = nearest_of_all(&SurfaceIndex::new(test), &r.points);
    let (in_test, in_reference) = (PointIndex::new(&t.points), PointIndex::new(&r.points));
    let normal_angle = normal_angle(&t, &r, &in_test, &in_reference, &to_reference, config);
    let metres = |found: &[Nearest]| found.iter().map(|n| n.distance_m).collect::<Vec<f64>>();
    let (mut accuracy, mut completeness) = (metres(&to_reference), metres(&to_test));
    let scores = config.thresholds_m.iter().map(|&at| ThresholdScore::of(at, &accuracy, &completeness)).collect();
    let (accuracy, completeness) = (DistanceStatistics::of(&mut accuracy), DistanceStatistics::of(&mut completeness));
    Ok(SurfaceComparison {
        scores,
        chamfer_m: 0.5 * (accuracy.mean_m + completeness.mean_m),
        hausdorff_m: accuracy.max_m.max(completeness.max_m),
        accuracy,
        completeness,
        normal_angle,
        m3c2: Some(m3c2(&r, &in_reference, &in_test, config)).filter(|found| found.n > 0),
        voc: overlap(&t.points, &r.points, config.voxel_m),
        test_samples_per_m2: t.per_m2,
        reference_samples_per_m2: r.per_m2,
    })
}

/// Finds the nearest place of the surface for every point, in the order of the points.
fn nearest_of_all(index: &SurfaceIndex, points: &[[f64; 3]]) -> Vec<Nearest> {
    points.par_iter().map(|&point| index.nearest(point)).collect::<Vec<_>>().into_iter().flatten().collect()
}

fn normal_angle(
    test: &Samples,
    reference: &Samples,
    in_test: &PointIndex,
    in_reference: &PointIndex,
    nearest: &[Nearest],
    config: &SurfaceComparisonConfig,
) -> Option<NormalAngle> {
    let radius_m = 0.5 * config.normal_scale_m;
    let estimated = |samples: &Samples, index: &PointIndex| match &samples.normals {
        Some(normals) => normals.iter().copied().map(Some).collect(),
        None => normals(index, &samples.points, radius_m),
    };
    let of_test = estimated(test, in_test);
    // For a mesh, the nearest triangle already has a normal.
    let of_reference = if reference.normals.is_some() { Vec::new() } else { estimated(reference, in_reference) };
    let angle = |(normal, nearest): (&Option<[f64; 3]>, &Nearest)| {
        let beside = || of_reference.get(nearest.point? as usize).copied().flatten();
        let cosine = dot((*normal)?, nearest.normal.or_else(beside)?).abs();
        Some(cosine.min(1.0).acos().to_degrees())
    };
    let mut angles: Vec<f64> = of_test.iter().zip(nearest).filter_map(angle).collect();
    NormalAngle::of(&mut angles)
}

#[cfg(test)]
mod tests {
    use super::super::error::Reason;
    use super::*;

    /// Returns a square of 10 m at a height, seen from above.
    fn square(z: f64) -> LocalSurface {
        LocalSurface::Mesh {
            positions: vec![[0.0, 0.0, z], [10.0, 0.0, z], [10.0, 10.0, z], [0.0, 10.0, z]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    fn points_of(surface: &LocalSurface) -> LocalSurface {
        // The seed differs from that of the comparison, and so do the positions.
        let config = SurfaceComparisonConfig { seed: 7, ..SurfaceComparisonConfig::default() };
        LocalSurface::Points(Samples::of(surface, &config, "test").unwrap().points)
    }

    #[test]
    fn parallel_squares_are_their_distance_apart() {
        let config = SurfaceComparisonConfig { thresholds_m: vec![0.25, 0.35], ..SurfaceComparisonConfig::default() };
        let (test, reference) = (square(5.3), square(5.0));
        for (test, m3c2_sign) in [(test, 1.0), (square(4.7), -1.0)] {
            let found = compare_surfaces(&test, &reference, &config).unwrap();
            for side in [found.accuracy, found.completeness] {
                assert!((side.mean_m - 0.3).abs() < 1e-12 && (side.max_m - 0.3).abs() < 1e-12, "{side:?}");
            }
            assert!((found.chamfer_m - 0.3).abs() < 1e-12);
            let scores: Vec<_> = found.scores.iter().map(|s| (s.precision, s.recall, s.f_score)).collect();
            assert_eq!(scores, [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)]);
            assert!(found.normal_angle.unwrap().mean_deg < 1e-5);
            let m3c2 = found.m3c2.unwrap();
            assert!((m3c2.mean_m - m3c2_sign * 0.3).abs() < 1e-9 && m3c2.significant == Some(1.0), "{m3c2:?}");
        }
    }

    #[test]
    fn clouds_and_meshes_mix() {
        let config = SurfaceComparisonConfig::default();
        let (a, b) = (square(5.3), square(5.0));
        let found = compare_surfaces(&points_of(&a), &b, &config).unwrap();
        assert!((found.accuracy.mean_m - 0.3).abs() < 1e-12);
        // The nearest points lie beside the reference's samples: farther than the surface, never
        // nearer.
        assert!(found.completeness.mean_m > 0.3 && found.completeness.mean_m < 0.35, "{:?}", found.completeness);
        assert_eq!((found.test_samples_per_m2, found.reference_samples_per_m2), (None, Some(25.0)));
        let found = compare_surfaces(&a, &points_of(&b), &config).unwrap();
        assert!((found.completeness.mean_m - 0.3).abs() < 1e-12);
        assert!(found.normal_angle.unwrap().mean_deg < 1e-5);
    }

    #[test]
    fn a_surface_against_itself_is_perfect() {
        let found = compare_surfaces(&square(5.0), &square(5.0), &SurfaceComparisonConfig::default()).unwrap();
        assert!(found.hausdorff_m < 1e-12);
        assert_eq!((found.voc.voc, found.voc.completeness, found.voc.correctness), (1.0, 1.0, 1.0));
        assert_eq!(found.m3c2.unwrap().significant, Some(0.0));
    }

    #[test]
    fn half_of_the_reference_is_missing() {
        let half = LocalSurface::Mesh {
            positions: vec![[0.0, 0.0, 5.0], [5.0, 0.0, 5.0], [5.0, 10.0, 5.0], [0.0, 10.0, 5.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let found = compare_surfaces(&half, &square(5.0), &SurfaceComparisonConfig::default()).unwrap();
        let score = found.scores[1];
        // Samples within 0.2 m of the edge count, too.
        assert!(score.precision == 1.0 && (score.recall - 0.52).abs() < 0.03, "{score:?}");
        assert!((found.completeness.mean_m - 1.25).abs() < 0.1 && found.voc.correctness > 0.98);
        assert!((found.voc.voc - 0.5).abs() < 0.02, "{:?}", found.voc);
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let config = SurfaceComparisonConfig::default();
        let compare = |test: &LocalSurface, config: &SurfaceComparisonConfig| {
            compare_surfaces(test, &square(0.0), config).unwrap_err().0
        };
        let empty = LocalSurface::Points(Vec::new());
        assert!(matches!(compare(&empty, &config), Reason::Empty { which: "test", .. }));
        let nan = LocalSurface::Points(vec![[0.0; 3], [0.0, f64::NAN, 0.0]]);
        assert_eq!(compare(&nan, &config), Reason::Position { which: "test", index: 1 });
        let corner = LocalSurface::Mesh { positions: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 3]] };
        assert_eq!(compare(&corner, &config), Reason::Corner { which: "test", index: 0 });
        let flat = LocalSurface::Mesh { positions: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 2]] };
        assert!(matches!(compare(&flat, &config), Reason::Empty { found: "no triangle with an area", .. }));
        let zero = SurfaceComparisonConfig { voxel_m: 0.0, ..config.clone() };
        assert!(matches!(compare(&square(0.0), &zero), Reason::Setting { .. }));
        let negative = SurfaceComparisonConfig { thresholds_m: vec![-1.0], ..config };
        assert!(matches!(compare(&square(0.0), &negative), Reason::Setting { .. }));
    }
}
