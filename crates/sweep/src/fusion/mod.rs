//! From the views' heights to one surface on a map grid.
//!
//! Each view's surviving pixels are joined to a surface and sampled at the cells' centres, so that a height stays where
//! it was measured; where the surface is torn (a wall), the points themselves fall into cells. A cell then holds one
//! height per view: the mode with the most support wins, the upper one in a tie, since averages across a roof's edge
//! are wrong on both sides.

mod cells;
mod fill;
mod mesh;
mod speckle;

pub use cells::{FusionConfig, Surface, fuse_views};
pub use fill::{FillConfig, fill_holes};
pub use mesh::{GridFrame, PlacedView, place_view};
pub use speckle::remove_speckle;
