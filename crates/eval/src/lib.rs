//! How far one surface model is from another: co-registration and error metrics.
//!
//! Two height grids go in, the evaluated one (*test*) and the one that is believed (*reference*), with the map that leads from
//! the cells of the second to the cells of the first ([`CellMap`]); out comes an [`Evaluation`]: the shift that was removed,
//! the errors over all cells, per class, per slope and at edges, the completeness in all its kinds, the overreach of roofs, and the
//! error of every cell.
//!
//! Surfaces that are no grids, meshes and point clouds, are compared by [`compare_surfaces`], maps in the pixels of a camera by
//! [`compare_depths`], [`compare_normals`] and [`compare_masks`].
//!
//! Conventions: heights in metres above one and the same vertical datum; a cell that is not finite is void; cell centres are
//! integers; an error is test − reference; a shift is what is *added to test* (x along the map's x axis, y along its y axis,
//! z upwards). Nothing here reads a file or prints.

mod align;
mod breakdown;
mod cell_map;
mod distance;
mod distribution;
mod edges;
mod error;
mod evaluate;
mod gradient;
mod maps;
mod metrics;
mod nuth_kaab;
mod opening;
mod resample;
mod search;
mod sharpness;
mod smooth;
mod standing;
mod statistics;
mod surface;
mod terrain;
mod vertical;

pub use align::{Alignment, MetresFromCells, Shift};
pub use breakdown::{COVERAGES, ClassMetrics, CoverageMetrics, EdgeMetrics, SLOPE_BOUNDS_DEG, SlopeMetrics};
pub use cell_map::CellMap;
pub use distribution::{Cumulative, Histogram, cumulative, histogram, round_up};
pub use edges::{EdgeRule, JUMP_M, JUMP_STEEPNESS, ZONE_CELLS, ZONE_M, edge_zone};
pub use error::EvalError;
pub use evaluate::{EvalConfig, EvalInput, Evaluation, evaluate};
pub use gradient::slope_deg;
pub use maps::{
    AngleErrors, DepthComparison, DepthErrors, MapSizeError, MaskComparison, NormalComparison, PixelCounts,
    compare_depths, compare_masks, compare_normals,
};
pub use metrics::Metrics;
pub use nuth_kaab::NuthKaabSummary;
pub use resample::{bilinear, nearest};
pub use search::SearchSummary;
pub use sharpness::{REACH_M, Sharpness};
pub use standing::{Overlap, Standing};
pub use statistics::{ErrorStatistics, OUTLIER_NMADS, RobustStatistics};
pub use surface::{
    DistanceStatistics, M3c2, NormalAngle, Surface, SurfaceComparison, SurfaceConfig, SurfaceError, ThresholdScore,
    VoxelOverlap, compare_surfaces,
};
pub use terrain::{TerrainSource, WINDOW_M, estimated_terrain, terrain_from_ground};
pub use vertical::convert_heights;
