//! The ground view jobs: what cameras and 360° panoramas on the ground see of a surface.
//!
//! [`run`] writes a folder with these files:
//!
//! | file | content |
//! |---|---|
//! | `depth/NAME.npy` | metres: z-depth of perspective cameras, ray length of panoramas, NaN for none |
//! | `normal/NAME.npy` | east, north, up of the map |
//! | `mask/NAME.png` | 255 where the view shows the surface |
//! | `sky/NAME.png` | 255 where the view shows the sky |
//! | `previews/NAME.png` | normals and depths to look at |
//! | `visibility.tif` | number of cameras that see each cell (rasters only) |
//! | `sparse/0` | COLMAP model of the perspective cameras, with points of the surface and `origin.json` |
//! | `images` | crops of the pictures, if there are any |
//! | `origin.json` | origin of the local positions |
//! | `report.json` | the report |
//!
//! A row of a list without a view does not stop the others: the report names it. [`compose`] lays a
//! rendered ground layer over a satellite layer.

mod compose;
mod config;
mod error;
mod output;
mod report;
mod run;
mod shots;
mod view_files;
mod view_surface;

pub use compose::{ComposeConfig, ComposeReport, compose};
pub use config::{GroundCameras, GroundViewConfig};
pub use report::{GroundViewFailure, GroundViewReport, GroundViewRow};
pub use run::run;
