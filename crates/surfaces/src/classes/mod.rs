//! The classes job: ground, buildings and vegetation of a surface model.
//!
//! The ground is found first, as in the DTM job. Written into one folder, on the grid of the
//! surface:
//!
//! - `classes.tif`: ASPRS LAS classes: 0 unknown, 2 ground, 3 low vegetation, 5 vegetation,
//!   6 building, 9 water.
//! - `roughness.tif`: residual of the best plane around each cell that stands, metres; no-data
//!   elsewhere.
//! - `ndvi.tif`: the vegetation index, where it was made of multispectral images; no-data where
//!   none sees a cell.
//! - `classes.json` and `classes.html`: the report, and its page with maps.

mod config;
mod cue;
mod error;
mod layers;
mod multispectral;
mod report;
mod run;

pub use config::ClassesConfig;
pub use layers::ClassLayers;
pub use multispectral::IndexImage;
pub use report::ClassesReport;
pub use run::FILES;
pub use run::legend;
pub use run::run;
