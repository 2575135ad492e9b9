//! From the views' heights to one surface on a map grid.
//!
//! Each view's surviving pixels are joined to a surface and sampled at the cells' centres, so that a height stays where
//! it was measured. A cell then holds one height per view: the mode with the most support wins, the upper one in a tie,
//! since averages across a roof's edge are wrong on both sides. Heights at the upper side of a jump support little:
//! matching makes roofs reach out, and a view that sees the ground beside them knows better.

mod cells;
mod fill;
mod mesh;
mod reliability;
mod speckle;

pub use cells::{FusedSurface, FusionConfig, fuse_views};
pub use fill::{FillConfig, fill_voids};
pub use mesh::{GridFrame, PlacedView, mark_cells, place_view};
pub use reliability::reliability;
pub use speckle::remove_speckle;
