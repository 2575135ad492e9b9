//! How far one surface model is from another: co-registration and error metrics.
//!
//! Two height grids go in, the evaluated one (*test*) and the one that is believed (*reference*), with the map that leads from
//! the cells of the second to the cells of the first ([`CellMap`]); out comes an [`Evaluation`]: the shift that was removed,
//! the errors over all cells and per class, the completeness, and the error of every cell.
//!
//! Conventions: heights in metres above one and the same vertical datum; a cell that is not finite is void; cell centres are
//! integers; an error is test − reference; a shift is what is *added to test* (x along the map's x axis, y along its y axis,
//! z upwards). Nothing here reads a file or prints.

mod align;
mod cell_map;
mod error;
mod evaluate;
mod metrics;
mod resample;
mod search;
mod smooth;
mod statistics;
mod vertical;

pub use align::{Alignment, MetresFromCells, Shift};
pub use cell_map::CellMap;
pub use error::EvalError;
pub use evaluate::{ClassMetrics, EvalConfig, EvalInput, Evaluation, evaluate};
pub use metrics::Metrics;
pub use resample::{bilinear, nearest};
pub use search::SearchSummary;
pub use statistics::{ErrorStatistics, NMAD_FACTOR, percentile};
pub use vertical::convert_heights;
