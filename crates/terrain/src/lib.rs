//! The bare ground under the buildings and trees of a surface model.
//!
//! The method has four parts, all in metres and slopes:
//!
//! 1. **Forests** are set aside: wide areas of rough cells, which are no evidence of the ground.
//! 2. **Objects** are found by morphological openings with growing windows, as in the progressive
//!    filter of Zhang et al. (2003, <https://doi.org/10.1109/TGRS.2003.810682>). What an opening
//!    removes is only a candidate. A candidate is an object if the surface drops along most of its
//!    border by about as much as the candidate stands above the opened surface. A hilltop or a
//!    terrace that an opening cuts off has no such border, and stays. The search is done twice, on
//!    the surface relative to its trend, so that slopes do not hide low halls. The first trend
//!    follows the lower part of the surface, the second the ground that the first search left.
//! 3. The ground under objects and voids is a **thin plate** under tension through the ground
//!    around them.
//! 4. Under forests the plate is guided by the **tree tops**, whose height above the ground is
//!    known beside clearings, or by gaps that reach down to the ground.
//!
//! Heights are in metres above any datum, NaN is a void. The work is done on cells of about a metre
//! and takes memory in proportion to the cells.

mod canopy;
mod coarse;
mod config;
mod error;
mod forest;
mod ground;
mod membrane;
mod narrow;
mod objects;
mod opening;
mod pits;
mod plate;
mod regions;
mod rejoin;
mod trend;

pub use config::GroundConfig;
pub use error::TerrainError;
pub use ground::{BareGround, GROUND, UNDER_OBJECT, UNKNOWN, VOID_FILLED, bare_ground, bare_ground_of_observed};
