//! From views in memory to a surface model on a grid: the stages of a DSM run that touch no file.
//!
//! A view is an image with its RPC camera ([`sweep::SweepView`]). The stages are functions from
//! plain values to plain values:
//!
//! - [`ViewGeometry`] says which views share ground, at which angles and with how much parallax.
//! - [`SourceCandidates`] chooses the views that each view is compared with, and [`choose_levels`]
//!   the pyramid levels of the sweep.
//! - [`sweep_scene`] finds the heights of all views, from the coarsest level to the finest, with
//!   or without a city model as a prior ([`ViewPrior`]).
//! - [`probe`] extends the heights to search by towers and pits.
//! - [`make_surface`] keeps the heights that other views confirm, fuses them on a [`DsmGrid`],
//!   removes speckle, fills voids, and says of each cell where its height comes from, its standard
//!   deviation and the probability that it is right ([`SurfaceRasters`]).
//!
//! [`surface_of_views`] is the chain of them for images that are in memory, and [`sweep_views`]
//! stops at the heights of each view. Reading images, correcting their pointing, dividing large
//! scenes into chunks and writing files is the work of the crate `dsm`.
//!
//! Heights are metres above the WGS 84 ellipsoid. Pixels are (sample, line) with the centre of the
//! upper-left one at (0, 0).

mod error;
mod grid;
mod in_memory;
mod planning;
mod prior;
pub mod probe;
mod scene_sweep;
mod surface;
mod tuning;
mod values;

pub use error::ReconstructError;
pub use grid::{DsmGrid, cell_size, snapped};
pub use in_memory::{ViewHeights, ViewImage, surface_of_views, sweep_views};
pub use planning::footprints::{footprint, local_polygon, overlap_share, shared_ground, shared_part};
pub use planning::levels::{PYRAMID_LEVELS_MAX, SweepLevels, choose_levels, height_step_m, smallest_sides};
pub use planning::places::Places;
pub use planning::sources::{Parts, SourceCandidates, widest_parallax};
pub use planning::view_geometry::{
    ANGLE_MAX_DEG, ANGLE_MIN_DEG, ImageGeometry, OVERLAP_MIN, PairGeometry, ViewGeometry, angle_merit, pair_geometry,
};
pub use prior::findings::{BuildingFinding, PriorFindings, ViewVotes};
pub use prior::view_prior::ViewPrior;
pub use scene_sweep::{LatticeHeights, SceneHeights, SceneSweep, sweep_scene};
pub use surface::clean_up::SURROUNDINGS_M;
pub use surface::clean_up::right_within_m;
pub use surface::fill::Fill;
pub use surface::ground_mask::GroundMask;
pub use surface::make::{CellCounts, KeptPixels, SurfaceCounts, SurfaceInput, SurfaceOptions, make_surface};
pub use surface::rasters::SurfaceRasters;
pub use surface::shadow_side::{ShadowCounts, ShadowSide, shadow_side};
pub use tuning::{Preset, SweepTuning};
pub use values::{CELLS_MAX, HeightRange, ImagePair, MapBounds, index_of_position};
