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

mod alignment;
mod error;
mod evaluate;
mod maps;
mod measures;
mod surface;
mod vertical;

pub use alignment::align::{AlignmentMethod, MetresFromCells, Shift};
pub use alignment::blocks::LocalShifts;
pub use alignment::cell_map::CellMap;
pub use alignment::nuth_kaab::NuthKaabSummary;
pub use alignment::registration::{Registration, register_surfaces};
pub use alignment::resample::{bilinear, nearest};
pub use alignment::search::SearchSummary;
pub use error::EvalError;
pub use evaluate::{EvalConfig, EvalInput, Evaluation, evaluate};
pub use maps::{
    AngleErrors, DepthComparison, DepthErrors, MapSizeError, MaskComparison, NormalComparison, PixelCounts,
    compare_depths, compare_masks, compare_normals,
};
pub use measures::breakdown::{COVERAGES, ClassMetrics, CoverageMetrics, EdgeMetrics, SLOPE_BOUNDS_DEG, SlopeMetrics};
pub use measures::calibration::{Reliability, ReliabilityRow, SigmaCalibration, SigmaReport};
pub use measures::distribution::{Cumulative, Histogram, cumulative, histogram, round_up};
pub use measures::edges::{EdgeRule, JUMP_M, JUMP_STEEPNESS, ZONE_CELLS, ZONE_M, edge_zone};
pub use measures::gradient::slope_deg;
pub use measures::metrics::Metrics;
pub use measures::objects::{DamagedBuilding, ObjectsFound};
pub use measures::origin::{CellOrigin, OriginMetrics, OriginSplit};
pub use measures::sharpness::{REACH_M, Sharpness};
pub use measures::standing::{Overlap, Standing};
pub use measures::statistics::{ErrorStatistics, OUTLIER_NMADS, RobustStatistics};
pub use measures::terrain::{TerrainSource, WINDOW_M, estimated_terrain, terrain_from_ground};
pub use surface::{
    DistanceStatistics, LocalSurface, M3c2, NormalAngle, SurfaceComparison, SurfaceComparisonConfig, SurfaceError,
    ThresholdScore, VoxelOverlap, compare_surfaces,
};
pub use vertical::convert_heights;
