//! The RPC jobs: describe the RPC of a file, project and localize points with it, and write it in
//! another format.
//!
//! Image coordinates are sample (column) and line (row); the centre of the upper-left pixel is (0,
//! 0). Ground coordinates are WGS 84 longitude and latitude in degrees, and metres above the
//! ellipsoid.

mod convert;
mod error;
mod export;
mod export_scene;
mod info;
mod input;
mod lines;
mod of_run;
mod pixels;
mod points;
mod text;

pub use convert::{RpcConvertConfig, RpcConvertReport, convert};
pub use export::{RpcExportConfig, RpcExportReport, RpcExportedImage, export};
pub use info::{RpcCentre, RpcInfoConfig, RpcInfoReport, RpcValidity, info};
pub use lines::{RpcLineAnswer, RpcLinesConfig, RpcLinesReport, answer_lines, open_lines};
pub use of_run::camera_of_run;
pub use pixels::RpcPixels;
pub use points::{RpcDirection, RpcPoint, RpcPointsConfig, RpcPointsReport, RpcQuery, points};
