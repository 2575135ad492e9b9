//! Raster files: images and surface models are read through GDAL, Cloud-Optimised GeoTIFFs and PNGs
//! are written.
//!
//! Windows and images follow the toolkit's convention: the centre of the upper-left pixel is (0,
//! 0). GDAL's convention (its corner) occurs only here and in `raster::GeoTransform`. Local files
//! are read, and addresses only after [`allow_remote`]; nothing that a file names on a network is
//! fetched. A file appears under its final name when it is complete.

mod acquired;
mod band;
mod band_colour;
mod colour;
mod contours;
mod dem;
mod depth_png;
mod error;
mod gdal_access;
mod gdal_setup;
mod geotiff;
mod image_copy;
mod labels;
mod luma;
mod luma_rule;
mod named_files;
mod png;
mod reduced;
mod source;
mod spectral;
mod spool;
mod tile;
mod undeclared;
mod verify;
mod vertical_unit;
mod web_file;
mod web_files;
mod world_file;

pub use band::{Band, BandData};
pub use contours::{ContourSurface, write_contours};
pub use dem::{Dem, read_dem, read_dem_window};
pub use depth_png::{DepthScale, write_depth_png};
pub use error::RasterError;
pub use gdal_setup::allow_remote;
pub use geotiff::{
    CogCrs, CogPlace, CogRaster, Sampling, write_cog, write_image_with_rpc, write_map, write_map_with_rpc,
};
pub use image_copy::copy_image_with_rpc;
pub use labels::{Provenance, iso_time};
pub use luma::LumaTile;
pub use luma_rule::{BandChoice, LumaRule};
pub use png::{write_png_gray, write_png_rgb, write_png_rgba};
pub use reduced::BandLabel;
pub use source::{ImageInfo, ImageSource, SampleType};
pub use spectral::{BandSpectrum, IndexBands, write_multispectral_with_rpc};
pub use spool::{RasterSpool, SPOOL_TILE, SpoolBand};
pub use tile::{BandScale, MapTile, write_map_tile};
pub use undeclared::undeclared_no_data;
pub use world_file::write_world_file;

pub(crate) use gdal_access::{VectorFormat, register_vector};
pub(crate) use gdal_setup::{open_address, prepare_gdal, with_gdal};
