//! The diff job: what changed between two surface models, and by how much.
//!
//! The second surface is brought to the vertical datum of the first, moved onto it, and sampled at
//! its cells. Cells that were filled on either date are no observations: they decide nothing, but
//! may belong to a region that they lie in. The same holds for cells that are rather wrong than
//! right by the probabilities beside both surfaces, and for those near a border. Written into one
//! folder, on the grid of the first surface:
//!
//! - `change.tif`: second minus first, metres, and its standard deviation as a second band.
//! - `significance.tif`: the difference in standard deviations; no-data where the cell decides
//!   nothing.
//! - `regions.tif`: the number of the region of each cell, 0 for none.
//! - `changes.geojson`: the regions as polygons with area, change, volume, their deviations, and
//!   what they rest on.
//! - `areas.geojson`: the volumes of each polygon of a given layer.
//! - `diff.json` and `diff.html`: the report, and its page with maps.

mod aligned;
mod config;
mod error;
mod layers;
mod page;
mod report;
mod run;

pub use config::DiffConfig;
pub use report::{AreaVolume, DiffBlocks, DiffRegion, DiffReport};
pub use run::run;
