//! Samples of a surface: the points of a cloud, or seeded points on a mesh.
//!
//! Of n samples on a mesh, the i-th lies in the i-th of n equal shares of the area, so that the
//! density is even. Inside its triangle it is uniform. Its random numbers depend on the seed and on
//! i alone.

use numeric::SplitMix64;
use numeric::random::{GOLDEN_GAMMA, mix64};
use rayon::prelude::*;

use super::config::SurfaceComparisonConfig;
use super::error::Reason;
use super::index::{Triangle, triangles};
use super::model::LocalSurface;

/// Points on a surface, with the normals of a mesh.
pub(super) struct Samples {
    pub(super) points: Vec<[f64; 3]>,
    pub(super) normals: Option<Vec<[f64; 3]>>,
    /// Samples per square metre of a mesh.
    pub(super) per_m2: Option<f64>,
}

impl Samples {
    pub(super) fn of(
        surface: &LocalSurface,
        config: &SurfaceComparisonConfig,
        which: &'static str,
    ) -> Result<Self, Reason> {
        match surface {
            LocalSurface::Points(points) => Ok(Self { points: points.clone(), normals: None, per_m2: None }),
            LocalSurface::Mesh { .. } => {
                on_mesh(&triangles(surface), config).ok_or(Reason::Empty { which, found: "no triangle with an area" })
            }
        }
    }
}

fn on_mesh(triangles: &[Triangle], config: &SurfaceComparisonConfig) -> Option<Samples> {
    let ends: Vec<f64> = triangles
        .iter()
        .scan(0.0, |sum, triangle| {
            *sum += triangle.area_m2();
            Some(*sum)
        })
        .collect();
    let area = ends.last().copied().filter(|area| *area > 0.0)?;
    let count = ((area * config.samples_per_m2).ceil() as usize).clamp(1, config.max_samples.max(1));
    let sample = |i: usize| {
        let [place, u, v] = random(config.seed, i as u64);
        let at = (i as f64 + place) / count as f64 * area;
        let triangle = &triangles[ends.partition_point(|&end| end <= at).min(triangles.len() - 1)];
        // The square root makes the samples uniform over the triangle.
        let root = u.sqrt();
        (triangle.point(root * (1.0 - v), root * v), triangle.normal)
    };
    let (points, normals) = (0..count).into_par_iter().map(sample).unzip();
    Some(Samples { points, normals: Some(normals), per_m2: Some(count as f64 / area) })
}

/// Returns three numbers in [0, 1) that depend on the seed and the index alone.
fn random(seed: u64, index: u64) -> [f64; 3] {
    let mut random = SplitMix64::new(mix64(seed ^ GOLDEN_GAMMA) ^ mix64(index.wrapping_add(1)));
    [0; 3].map(|_: i32| random.uniform())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> LocalSurface {
        LocalSurface::Mesh {
            positions: vec![[0.0, 0.0, 2.0], [10.0, 0.0, 2.0], [10.0, 10.0, 2.0], [0.0, 10.0, 2.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 0, 1]],
        }
    }

    #[test]
    fn samples_are_even_on_the_mesh_and_follow_the_seed() {
        let config = SurfaceComparisonConfig { samples_per_m2: 100.0, ..SurfaceComparisonConfig::default() };
        let found = Samples::of(&square(), &config, "test").unwrap();
        assert_eq!((found.points.len(), found.per_m2), (10_000, Some(100.0)));
        assert!(
            found.points.iter().all(|p| p[2] == 2.0 && (0.0..=10.0).contains(&p[0]) && (0.0..=10.0).contains(&p[1]))
        );
        assert!(found.normals.unwrap().iter().all(|n| *n == [0.0, 0.0, 1.0]));
        for quarter in 0..4 {
            let inside = |p: &&[f64; 3]| (p[0] >= 5.0) as usize + 2 * (p[1] >= 5.0) as usize == quarter;
            let count = found.points.iter().filter(inside).count();
            // The limits are six standard deviations of a binomial count.
            assert!((2240..2760).contains(&count), "{quarter}: {count}");
        }
        let again = Samples::of(&square(), &config, "test").unwrap();
        let other = Samples::of(&square(), &SurfaceComparisonConfig { seed: 1, ..config.clone() }, "test").unwrap();
        assert_eq!(again.points, found.points);
        assert_ne!(other.points, found.points);
        let few = SurfaceComparisonConfig { max_samples: 50, ..config };
        assert_eq!(Samples::of(&square(), &few, "test").unwrap().per_m2, Some(0.5));
    }
}
