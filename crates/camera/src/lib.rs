//! Cameras: the RPC00B model of satellite images.
//!
//! Image coordinates are [`ImagePoint`]s: (sample, line) = (column, row), f64, with the centre of the upper-left pixel
//! at (0, 0). Ground coordinates are [`geodesy::LonLatHeight`]: degrees, and metres above the WGS 84 ellipsoid.

mod correction;
mod point;
mod rpc;

pub use correction::ImageCorrection;
pub use point::ImagePoint;
pub use rpc::{CameraError, Rpc, RpcCamera};
