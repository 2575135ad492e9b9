//! The bare ground under the buildings and trees of a surface model.
//!
//! The method has seven parts, all in metres and slopes:
//!
//! 1. **Pits**, **islands** and **forests** are set aside: places below the ground around them, a
//!    few observed cells between unobserved ones, and wide areas of rough cells between which no
//!    ground shows. None of them is evidence of the ground.
//! 2. **Objects** are found by morphological openings with growing windows. What vanishes at once
//!    from a window up to 36 m wide is an object, as in the filter of Pingel et al. (2013,
//!    <https://doi.org/10.1016/j.isprsjprs.2012.12.002>). What a wider opening removes is only a
//!    candidate, as in that of Zhang et al. (2003, <https://doi.org/10.1109/TGRS.2003.810682>).
//!    A candidate is an object if the surface drops along most of its border by about as much as
//!    the candidate stands above the opened surface. A hilltop or a terrace that an opening cuts
//!    off has no such border, and stays. The search is done three times, on the surface relative to
//!    its trend, so that slopes do not hide low halls. The first trend follows the lower part of
//!    the surface, the others the ground that the searches before have left, the last one closely.
//!    In surfaces with unobserved cells, planes that turn away from what lies off wider ones judge
//!    what openings mistake on slopes: roofs that are flush with the ground uphill, and roofs that
//!    the matching carried on into it. They bring ground back that an opening cut off, too.
//! 3. What is left of objects is taken away: small parts off the plate through the large ones, and
//!    parts a storey above the largest. Ground that was taken away **joins again** where it lies at
//!    the ground expected from that around it, within a tolerance that grows with the slope.
//! 4. The ground under objects and voids is a **thin plate** under tension through the ground
//!    around them.
//! 5. Under forests the plate is guided by the **tree tops**, whose height above the ground is
//!    known beside clearings, or by gaps that reach down to the ground.
//! 6. Where the surface says how uncertain its heights are, the ground is **smoothed** as far as
//!    they are: [`without_noise`].
//! 7. Among dense houses the ground is the one that most heights **support**, with few beneath it:
//!    [`supported_ground`], [`with_supported_ground`].
//!
//! Heights are in metres above any datum, NaN is a void. The work is done on cells of about a metre
//! and takes memory in proportion to the cells.

mod canopy;
mod coarse;
mod config;
mod error;
mod forest;
mod ground;
mod heights;
mod membrane;
mod narrow;
mod objects;
mod outliers;
mod pits;
mod plate;
mod regions;
mod rejoin;
mod roofs;
mod runs;
mod smooth;
mod stray;
mod support;
mod trend;

pub use config::GroundConfig;
pub use error::TerrainError;
pub use ground::{
    BareGround, GROUND, UNDER_OBJECT, UNKNOWN, VOID_FILLED, bare_ground, bare_ground_by_openings,
    bare_ground_of_observed,
};
pub use roofs::{goes_through_roofs, shows_hardly_but_roofs};
pub use smooth::without_noise;
pub use support::{supported_ground, with_supported_ground};
