//! Comparison of two surfaces: meshes and point clouds in any combination.
//!
//! Positions are f64 metres from a local origin that both surfaces share. In the definitions, d(p,
//! S) is the distance of a point to the surface S: exact to the triangles of a mesh, to the nearest
//! point of a cloud.
//!
//! - *Accuracy*: d(t, R) over the samples t of the test. *Completeness*: d(r, T) over the samples r
//!   of the reference. The samples of a cloud are its points. The samples of a mesh lie on it; they
//!   are seeded and stratified by area.
//! - precision(τ) and recall(τ): the shares of these distances below τ. F(τ) = 2 p r / (p + r).
//! - Chamfer distance: the mean of the two mean distances (metres, not squared). Hausdorff
//!   distance: the largest of all distances.
//! - Normal angle: the angle between a sample's normal and that of the nearest triangle or point, 0
//!   to 90°. The sign of a normal that is estimated from points is not known.
//! - M3C2 (Lague et al. 2013): see [`M3c2`]. VOC, the volumetric overlap: see [`VoxelOverlap`].
//!
//! The surfaces are not aligned. The result is the same for any number of threads.

mod compare;
mod config;
mod distances;
mod error;
mod index;
mod m3c2;
mod model;
mod normals;
mod sample;
mod voxels;

pub use compare::{SurfaceComparison, compare_surfaces};
pub use config::SurfaceComparisonConfig;
pub use distances::{DistanceStatistics, NormalAngle, ThresholdScore};
pub use error::SurfaceError;
pub use m3c2::M3c2;
pub use model::LocalSurface;
pub use voxels::VoxelOverlap;
