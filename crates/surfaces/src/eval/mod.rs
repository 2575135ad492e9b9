//! The evaluation jobs: they measure how far a surface is from a reference.
//!
//! Three kinds of input are compared, each by a job of its own:
//!
//! - [`compare_grids`]: two height grids (the reference may be a LAS or LAZ cloud, which is gridded
//!   first),
//! - [`evaluate_surfaces`]: meshes, city models and point clouds in any combination,
//! - [`compare_maps`]: depths, normals or masks in the pixels of one camera.
//!
//! [`detect_kind`] looks at the files and names the job for them.

mod error;
mod grid_config;
pub(crate) mod grid_inputs;
pub(crate) mod grid_layers;
mod grid_output;
mod grids;
mod maps;
pub(crate) mod on_reference;
mod report_folder;
mod requirements;
mod surface_config;
mod surface_doubts;
mod surface_inputs;
mod surface_text;
mod surfaces;
mod vertical;

use std::path::Path;

pub use report_folder::remove_evaluation;

pub(crate) use error::EvalJobError;
pub use grid_config::{EvalTarget, GridEvalConfig};
pub use grids::{GridEvalReport, compare_grids};
pub use maps::{MapEvalConfig, MapEvalReport, MapKind, compare_maps};
pub use requirements::{EvalRequirements, MinCompleteness};
pub use surface_config::SurfaceEvalConfig;
pub use surfaces::{SurfaceEvalReport, SurfaceProtocol, evaluate_surface, evaluate_surfaces};

/// What two files hold, and so which job compares them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EvalKind {
    /// Height grids: [`compare_grids`].
    Grids,
    /// Meshes, city models or point clouds: [`evaluate_surfaces`].
    Surfaces,
    /// Maps in the pixels of a camera: [`compare_maps`].
    Maps,
}

/// Finds out what two files hold, by their first bytes.
pub fn detect_kind(test: &Path, reference: &Path) -> EvalKind {
    if formats::maps::is_npy(test) && formats::maps::is_npy(reference) {
        EvalKind::Maps
    } else if cityfiles::surfaces::is_surface(test) && cityfiles::surfaces::is_surface(reference) {
        EvalKind::Surfaces
    } else {
        EvalKind::Grids
    }
}
