//! The buildings job: a geometric index of buildings in one image, as a raster.
//!
//! `OUT.tif` holds the index, 0 to 1, no-data where the image has no value: in the pixels of the
//! image, with its RPC or its map, or on the grid of a surface model. On a surface model it lies as
//! an ortho does, and cells that the image does not see are no-data. `OUT_report.json` and
//! `OUT_report.html` are the report and its page.

mod config;
mod error;
mod input;
mod output;
mod report;
mod run;

pub use config::BuildingMapConfig;
pub use report::BuildingMapReport;
pub use run::run;
