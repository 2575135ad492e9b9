//! Point clouds (LAS 1.0 to 1.4, LAZ) as surface models: the highest point of every cell.
//!
//! Points of the noise classes (7, 18) and withheld ones do not count. A cell without a point is void. Heights are metres
//! above what the file states (WKT, or GeoTIFF keys, whose vertical unit is applied); the datum is reported and not converted. Points are
//! read in batches, so that memory depends on the grid only. No number that decides how much is allocated (records, chunks of compressed
//! points, their layers) is believed before it is checked against the file's length: those that do not fit are an error, and so is a panic
//! of the decoder on compressed points that are damaged.

mod cloud;
mod crs;
mod error;
mod export;
mod preflight;

pub use cloud::{GriddedPoints, PointCloud, SurfacePoint, is_point_cloud};
pub use error::PointsError;
pub use export::write_las;
