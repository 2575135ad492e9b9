//! One surface against another: meshes and point clouds in any combination.
//!
//! Positions are f64 metres from a local origin that both share. Definitions, with d(p, S) the distance of a point to the
//! surface S (exact to the triangles of a mesh, to the nearest point of a cloud):
//!
//! - *accuracy*: d(t, R) over the samples t of the test; *completeness*: d(r, T) over those of the reference. The samples of a cloud
//!   are its points, those of a mesh lie on it, seeded, stratified by area.
//! - precision(τ) and recall(τ): the shares of these distances below τ; F(τ) = 2 p r / (p + r).
//! - Chamfer distance: the mean of the two mean distances (metres, not squared). Hausdorff distance: the largest of all.
//! - normal angle: between a sample's normal and that of the nearest triangle or point, 0 to 90° (the sign of a normal that
//!   comes from points is not known).
//! - M3C2 (Lague et al. 2013): see [`M3c2`]. VOC, the volumetric overlap: see [`VoxelOverlap`].
//!
//! Nothing is aligned. The result is the same for any number of threads.

mod compare;
mod distances;
mod index;
mod m3c2;
mod normals;
mod sample;
mod voxels;

pub use compare::{SurfaceComparison, compare_surfaces};
pub use distances::{DistanceStatistics, NormalAngle, ThresholdScore};
pub use m3c2::M3c2;
pub use voxels::VoxelOverlap;

/// A surface, metres from a local origin.
#[derive(Debug, Clone, PartialEq)]
pub enum Surface {
    /// A point cloud.
    Points(Vec<[f64; 3]>),
    /// Triangles, counter-clockwise seen from outside.
    Mesh {
        /// Corners.
        positions: Vec<[f64; 3]>,
        /// Indices of corners.
        triangles: Vec<[u32; 3]>,
    },
}

/// What is measured, and how finely.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SurfaceConfig {
    /// Thresholds of precision, recall and F, metres.
    pub thresholds_m: Vec<f64>,
    /// Samples per square metre of a mesh.
    pub samples_per_m2: f64,
    /// Most samples of a mesh; a larger one is sampled thinner.
    pub max_samples: usize,
    /// Where the samples lie.
    pub seed: u64,
    /// D of M3C2: diameter of the ball in which normals are estimated, metres.
    pub normal_scale_m: f64,
    /// d of M3C2: diameter of the cylinder, metres.
    pub cylinder_m: f64,
    /// How far the cylinder reaches on either side, metres.
    pub cylinder_reach_m: f64,
    /// Most core points of M3C2; of more samples, every n-th is one.
    pub max_core_points: usize,
    /// What the registration of the two adds to the level of detection, metres.
    pub registration_m: f64,
    /// Edge of the voxels of VOC, metres.
    pub voxel_m: f64,
}

impl Default for SurfaceConfig {
    fn default() -> Self {
        Self {
            thresholds_m: vec![0.1, 0.2, 0.5, 1.0],
            samples_per_m2: 25.0,
            max_samples: 1_000_000,
            seed: 0,
            normal_scale_m: 1.0,
            cylinder_m: 1.0,
            cylinder_reach_m: 3.0,
            max_core_points: 100_000,
            registration_m: 0.0,
            voxel_m: 0.5,
        }
    }
}

/// Surfaces or numbers that cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// A surface without points, or without a triangle that has an area.
    #[error("the {which} has {found}: there is nothing to compare")]
    Empty {
        /// `test` or `reference`.
        which: &'static str,
        /// What it has.
        found: &'static str,
    },
    /// A coordinate that is not finite or too far from the origin.
    #[error("point {index} of the {which} is not within 1e9 m of the local origin")]
    Position {
        /// `test` or `reference`.
        which: &'static str,
        /// Index of the point.
        index: usize,
    },
    /// A triangle that names a corner that is not there.
    #[error("triangle {index} of the {which} names a corner that is not there")]
    Corner {
        /// `test` or `reference`.
        which: &'static str,
        /// Index of the triangle.
        index: usize,
    },
    /// A setting that means nothing.
    #[error("{name} is {value}, expected a positive number")]
    Setting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Positions must be this close to the origin, metres.
const EXTENT_LIMIT: f64 = 1e9;

impl Surface {
    /// Checks what the comparison relies on.
    fn check(&self, which: &'static str) -> Result<(), SurfaceError> {
        let (positions, triangles): (_, &[[u32; 3]]) = match self {
            Self::Points(points) => (points, &[]),
            Self::Mesh { positions, triangles } => (positions, triangles),
        };
        let outside = |p: &[f64; 3]| !p.iter().all(|c| c.abs() <= EXTENT_LIMIT);
        if let Some(index) = positions.iter().position(outside) {
            return Err(SurfaceError::Position { which, index });
        }
        let missing = |t: &[u32; 3]| t.iter().any(|&corner| corner as usize >= positions.len());
        if let Some(index) = triangles.iter().position(missing) {
            return Err(SurfaceError::Corner { which, index });
        }
        match self {
            Self::Points(points) if points.is_empty() => Err(SurfaceError::Empty { which, found: "no points" }),
            Self::Mesh { triangles, .. } if triangles.is_empty() => {
                Err(SurfaceError::Empty { which, found: "no triangles" })
            }
            _ => Ok(()),
        }
    }
}

impl SurfaceConfig {
    fn check(&self) -> Result<(), SurfaceError> {
        let settings = [
            ("the density of samples", self.samples_per_m2),
            ("the scale of the normals", self.normal_scale_m),
            ("the diameter of the cylinder", self.cylinder_m),
            ("the reach of the cylinder", self.cylinder_reach_m),
            ("the edge of the voxels", self.voxel_m),
        ];
        let thresholds = self.thresholds_m.iter().map(|&t| ("a threshold", t));
        let bad = |(_, value): &(&str, f64)| !(*value > 0.0 && value.is_finite());
        if let Some((name, value)) = settings.into_iter().chain(thresholds).find(bad) {
            return Err(SurfaceError::Setting { name, value });
        }
        if !(self.registration_m >= 0.0 && self.registration_m.is_finite()) {
            return Err(SurfaceError::Setting { name: "the error of the registration", value: self.registration_m });
        }
        Ok(())
    }
}
