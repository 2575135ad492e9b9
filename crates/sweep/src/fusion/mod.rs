//! Fusion of the views' heights to one surface on a map grid.
//!
//! The kept pixels of each view are joined to a surface that is sampled at the centres of the
//! cells, so that a height stays where it was measured. A cell then has one height per view. These
//! heights vote, and the votes are regularised over the grid (`regularise`): an average across a
//! roof's edge would be wrong on both sides. Heights at the upper side of a jump have little
//! weight: matching widens roofs, and a view that sees the ground beside them is more reliable
//! there.

mod border;
mod cells;
mod directions;
mod envelope;
mod fill;
mod mesh;
mod plane;
mod regularise;
mod source;
mod speckle;
mod trend;
mod trust;

pub use cells::{BLOCK, FusedSurface, FusionConfig, fuse_views};
pub use envelope::{GridSight, occlusion_bounds};
pub use fill::{FillConfig, FillRule, FilledVoids, KnownVoids, fill_voids};
pub use mesh::{GridFrame, PlacedView, mark_cells, place_view};
pub use source::{CellSource, FILLED, OBSERVED, VOID};
pub use speckle::remove_speckle;
pub use trend::{TrendConfig, ground_trend};
pub use trust::{Trust, TrustConfig, TrustModel, surroundings};
