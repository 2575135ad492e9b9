//! The diff job: what changed between two surface models, and by how much.
//!
//! The second surface is brought to the vertical datum of the first, moved onto it, and sampled at
//! its cells. Cells that were filled on either date are no observations: they decide nothing, but
//! may belong to a region that they lie in. Written into one folder, on the grid of the first
//! surface:
//!
//! - `change.tif`: second minus first, metres, and its standard deviation as a second band.
//! - `significance.tif`: the difference in standard deviations; no-data where the cell was not
//!   observed on both dates.
//! - `regions.tif`: the number of the region of each cell, 0 for none.
//! - `changes.geojson`: the regions as polygons with area, change, volume and their deviations.
//! - `areas.geojson`: the volumes of each polygon of a given layer.
//! - `diff.json` and `diff.html`: the report, and its page with maps.

mod aligned;
mod config;
mod error;
mod layers;
mod report;
mod run;

pub use config::DiffConfig;
pub use error::DiffError;
pub use report::{AreaVolume, DiffRegion, DiffReport};
pub use run::run;
