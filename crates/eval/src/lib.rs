//! Accuracy of one surface model against another: co-registration and error metrics.
//!
//! [`evaluate`] compares two height grids: the evaluated one (the *test*) and the trusted one (the
//! *reference*). A [`CellMap`] leads from the cells of the reference to the cells of the test. The
//! resulting [`Evaluation`] holds the shift that was removed, the errors over all cells, per class,
//! per slope and at edges, the kinds of completeness, the overreach of roofs, and the error of
//! every cell. With layers that describe the test, it also tells observed from filled cells and
//! judges the stated uncertainty; with numbered buildings, it names those that are lost.
//!
//! [`compare_surfaces`] compares meshes and point clouds. [`compare_depths`], [`compare_normals`]
//! and [`compare_masks`] compare maps in the pixels of one camera.
//!
//! Conventions: both heights are in metres above the same vertical datum. A cell that is not finite
//! is void. Cell centres are integers. An error is test − reference. A shift is *added to the test*
//! (x along the map's x axis, y along its y axis, z upwards). This crate reads no file and prints
//! nothing.

mod align;
mod breakdown;
mod calibration;
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
mod objects;
mod opening;
mod origin;
mod registration;
mod resample;
mod search;
mod sharpness;
mod smooth;
mod standing;
mod statistics;
mod surface;
mod terrain;
mod transpose;
mod vertical;

pub use align::{AlignmentMethod, MetresFromCells, Shift};
pub use breakdown::{COVERAGES, ClassMetrics, CoverageMetrics, EdgeMetrics, SLOPE_BOUNDS_DEG, SlopeMetrics};
pub use calibration::{Reliability, ReliabilityRow, SigmaCalibration, SigmaReport};
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
pub use objects::{DamagedBuilding, ObjectsFound};
pub use origin::{CellOrigin, OriginMetrics, OriginSplit};
pub use registration::{Registration, register_surfaces};
pub use resample::{bilinear, nearest};
pub use search::SearchSummary;
pub use sharpness::{REACH_M, Sharpness};
pub use standing::{Overlap, Standing};
pub use statistics::{ErrorStatistics, OUTLIER_NMADS, RobustStatistics};
pub use surface::{
    DistanceStatistics, LocalSurface, M3c2, NormalAngle, SurfaceComparison, SurfaceComparisonConfig, SurfaceError,
    ThresholdScore, VoxelOverlap, compare_surfaces,
};
pub use terrain::{TerrainSource, WINDOW_M, estimated_terrain, terrain_from_ground};
pub use vertical::convert_heights;
