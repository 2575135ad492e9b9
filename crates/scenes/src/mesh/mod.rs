//! The mesh job: depth maps of a dataset's cameras become one mesh. The maps are those that splats
//! show, those of the priors job, or any others.
//!
//! Beside the mesh (PLY or GLB) lies `NAME.report.json` with its page, on request with the surface
//! metrics against a reference.

mod config;
mod depths;
mod error;
mod run;

pub use config::{DepthSource, MeshJobConfig};
pub use run::{MeshJobReport, run};
