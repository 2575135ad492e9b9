//! Finds what a surface model hides from a satellite.
//!
//! [`Surface`] answers whether anything stands between a point and the sensor, with upright
//! [walls](wall) between cells. [`Eyeline`] gives the direction towards the sensor at each cell,
//! [`GridGround`] the position of each cell.

mod eyeline;
mod ground;
mod surface;
mod wall;

pub use eyeline::{Eyeline, EyelineError};
pub use ground::GridGround;
pub use surface::{STEP_SLOPE, Surface};
