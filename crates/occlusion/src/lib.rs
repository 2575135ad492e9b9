//! Finds what a surface model hides from a satellite.
//!
//! [`OcclusionSurface`] finds whether it hides a point from a sensor, with upright
//! walls between cells, which [`OcclusionSurface::wall_lines`] follows. [`Eyeline`] gives the
//! direction towards the sensor at each cell, [`GridGround`] the position of each cell.

mod eyeline;
mod ground;
mod lines;
mod surface;
mod wall;

pub use eyeline::{Eyeline, EyelineError};
pub use ground::GridGround;
pub use lines::{WallLine, WallPoint};
pub use surface::{OcclusionSurface, STEP_SLOPE};
