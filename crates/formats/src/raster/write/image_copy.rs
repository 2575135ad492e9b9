//! Copies of images with another RPC.

use std::path::Path;

use camera::Rpc;
use gdal::raster::RasterCreationOptions;
use gdal::{DriverManager, Metadata};

use super::geotiff::{copy, rpc_items};
use crate::raster::access::gdal_setup::{open_dataset, with_gdal};
use crate::raster::error::RasterError;

use crate::atomic::write_path;

/// Writes an image again as a tiled GeoTIFF with deflate, with an RPC in TIFF tag 50844 in the
/// place of its own. Values, bands and other metadata stay.
///
/// # Errors
/// [`RasterError`] if the image cannot be opened, the file exists without `overwrite`, or it cannot
/// be written.
pub fn copy_image_with_rpc(image: &Path, path: &Path, rpc: &Rpc, overwrite: bool) -> Result<(), RasterError> {
    let source = open_dataset(image)?;
    write_path(path, overwrite, |made| {
        let options = [("COMPRESS", "DEFLATE"), ("TILED", "YES"), ("BIGTIFF", "IF_SAFER")];
        // The copy is a description in memory, because changed metadata of the image itself would
        // be written beside it.
        with_gdal(|| {
            let driver = DriverManager::get_driver_by_name("VRT")?;
            let mut described = source.create_copy(&driver, "", &RasterCreationOptions::default())?;
            for (key, value) in rpc_items(rpc) {
                described.set_metadata_item(key, &value, "RPC")?;
            }
            Ok(described)
        })
        .and_then(|described| copy(&described, "GTiff", made, &options))
        .map_err(|reason| RasterError::unwritable(path, reason))
    })
}
