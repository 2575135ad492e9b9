//! Depth maps become a mesh: fusion in a truncated signed distance (Curless and Levoy, "A
//! Volumetric Method for Building Complex Models from Range Images", SIGGRAPH 1996) and marching
//! cubes (Lorensen and Cline, SIGGRAPH 1987).
//!
//! The volume is sparse: only blocks of voxels near a depth of some map exist. Every map then
//! counts in every block, so that free space seen by one map removes what another has there by
//! mistake, and the result does not depend on which block was made by which map.
//!
//! # Examples
//! ```
//! use camera::{Lens, LensModel, Pose};
//! use raster::Grid;
//! use tsdf::{DepthView, TsdfConfig, fuse};
//!
//! // A wall at a depth of 2 m.
//! let lens = Lens::new(64, 48, LensModel::Pinhole, &[50.0, 50.0, 31.5, 23.5])?;
//! let pose = Pose { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], centre: [0.0; 3] };
//! let depth_m = Grid::filled(64, 48, 2.0f32);
//! let views = [DepthView { lens: &lens, pose: &pose, depth_m: &depth_m, colour: None }];
//! let mesh = fuse(&views, &TsdfConfig::default())?;
//! assert!(mesh.positions.iter().all(|p| (f64::from(p[2]) + mesh.origin[2] - 2.0).abs() < 1e-3));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cubes;
mod fusion;
mod mesh;
mod volume;

pub use fusion::{DepthView, FusionError, TsdfConfig, fuse};
pub use mesh::FusedMesh;
