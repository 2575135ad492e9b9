//! The DTM job: the bare ground under a surface model, and the heights above it.
//!
//! Where the layers of a DSM run lie beside the surface, filled cells are no evidence of the
//! ground. Those that are hardly ever right count only where many of them support a lower ground.
//! The ground is smoothed as far as the standard errors of the heights ask for.
//!
//! Three rasters and a report are written into one folder, on the grid and in the vertical datum of
//! the surface:
//!
//! - `dtm.tif`: heights of the ground, metres; no-data where no ground is near.
//! - `height_above_ground.tif`: surface minus ground, metres. It is 0 where the surface shows the
//!   ground, and where the surface lies below the interpolated ground (noise, outliers). No-data
//!   where the surface or the ground is unknown.
//! - `ground.tif`: 0 unknown, 1 ground as observed, 2 interpolated under an object, 3 interpolated
//!   in a void of the surface.
//! - `dtm.json`: the report.

mod config;
mod error;
mod layers;
mod report;
mod run;

pub use config::DtmConfig;
pub(crate) use error::DtmError;
pub use layers::SurfaceLayers;
pub(crate) use layers::bare_ground;
pub use report::DtmReport;
pub use run::FILES;
pub(crate) use run::read_surface;
pub use run::run;
