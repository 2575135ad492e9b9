//! Point clouds (LAS 1.0 to 1.4, LAZ), also as surface models with the highest point of every cell.
//!
//! Noise (classes 7 and 18) and withheld points do not count. A cell without a point is void.
//! Heights are metres above the datum that the file names (WKT, or GeoTIFF keys, whose vertical
//! unit is applied). The datum is reported, heights are not converted. Points are read in batches,
//! so that a grid needs no memory for the points.
//!
//! Each number that decides how much memory is allocated (records, chunks of compressed points,
//! their layers) is checked against the length of the file first. A number that does not fit is an
//! error. So is a panic of the decoder on damaged compressed points.

mod cloud;
mod cloud_file;
mod crs;
mod export;
mod las_header;
mod preflight;
mod surface_cloud;
#[cfg(test)]
mod surface_cloud_tests;

pub use cloud::{CellLattice, GriddedPoints, PointCloud, PointCounts, SurfacePoint, is_point_cloud};
pub use cloud_file::{CloudFormat, write_cloud};
pub use export::write_las;
pub use surface_cloud::{CloudExtent, SurfaceCloud};
