//! Raster files: images and surface models are read through GDAL, Cloud-Optimised GeoTIFFs and PNGs
//! are written.
//!
//! Windows and images follow the toolkit's convention: the centre of the upper-left pixel is (0,
//! 0). GDAL's convention (its corner) occurs only here and in `raster::GeoTransform`. Local files
//! are read, and addresses only after [`allow_remote`]; nothing that a file names on a network is
//! fetched. A file appears under its final name when it is complete.

mod access;
mod error;
mod read;
mod write;

pub use access::gdal_setup::{allow_remote, raster_formats};
pub use error::RasterError;
pub use read::dem::{Dem, read_dem, read_dem_window};
pub use read::luma::LumaTile;
pub use read::luma_rule::{BandChoice, LumaRule};
pub use read::reduced::BandLabel;
pub use read::source::{ImageInfo, ImageSource, SampleType};
pub use read::spectral::{BandSpectrum, IndexBands, write_multispectral_with_rpc};
pub use read::undeclared::undeclared_no_data;
pub use write::band::{Band, BandData};
pub use write::contours::{ContourLines, ContourSurface, write_contours};
pub use write::depth_png::{DepthScale, write_depth_png};
pub use write::geotiff::{
    CogCrs, CogPlace, CogRaster, Sampling, write_cog, write_image_with_rpc, write_map, write_map_with_rpc,
};
pub use write::image_copy::copy_image_with_rpc;
pub use write::labels::{Provenance, iso_time};
pub use write::png::{write_png_gray, write_png_rgb, write_png_rgba};
pub use write::spool::{RasterSpool, SPOOL_TILE, SpoolBand};
pub use write::tile::{BandScale, MapTile, write_map_tile};
pub use write::world_file::write_world_file;

pub(crate) use access::gdal_access::{VectorFormat, register_vector};
pub(crate) use access::gdal_setup::{open_address, prepare_gdal, with_gdal};
pub(crate) use access::web_file::WebFile;
