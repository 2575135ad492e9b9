//! GeoTIFF out for small maps: turned geotransforms, a map of their own, band scale and offset, metadata.
//!
//! Strips, deflate with the predictor of the sample type, no overviews: such maps are read whole, by thousands. A turned
//! geotransform is written as the file's transformation matrix, a coordinate system without an EPSG code by its parameters.
//! Where a scale and an offset are given, `value · scale + offset` of the first band is its height above the ellipsoid, which
//! is what [`super::read_dem`] and other readers that follow GDAL's convention return.

use std::path::Path;

use gdal::Metadata;
use gdal::spatial_ref::SpatialRef;
use raster::{GeoTransform, NO_DATA};

use super::geotiff::{Band, BandData, VERTICAL_DATUM, copy, in_memory};
use super::{RasterError, with_gdal};
use crate::atomic::write_path;

/// Rows of a strip.
const STRIP_ROWS: &str = "128";

/// A small map to write.
#[derive(Debug, Clone, Copy)]
pub struct MapTile<'a> {
    /// The bands, one or more, of one type and size.
    pub bands: &'a [Band<'a>],
    /// Position of the grid, turned or not.
    pub geotransform: GeoTransform,
    /// `EPSG:n` or WKT of a map; heights are above the ellipsoid.
    pub crs: &'a str,
    /// What turns the first band's values into heights above the ellipsoid: scale and offset.
    pub height_from_value: Option<(f64, f64)>,
    /// Items of the default metadata domain.
    pub metadata: &'a [(&'static str, String)],
}

/// Writes a map as a GeoTIFF; NaN becomes −32768 in float bands, integer bands have no no-data value.
///
/// # Errors
/// [`RasterError::NotWritten`] without `overwrite`; [`RasterError::InconsistentBands`]; [`RasterError::NotWritten`], also for a CRS
/// that GDAL does not read.
pub fn write_map_tile(path: impl AsRef<Path>, tile: &MapTile<'_>, overwrite: bool) -> Result<(), RasterError> {
    let path = path.as_ref();
    let float = matches!(tile.bands.first(), Some(Band { data: BandData::F32(_), .. }));
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, tile.bands, float.then_some(f64::from(NO_DATA)))?;
        let options = [
            ("COMPRESS", "DEFLATE"),
            // Half the time of the default for a twentieth more bytes.
            ("ZLEVEL", "1"),
            ("PREDICTOR", if float { "3" } else { "2" }),
            ("BLOCKYSIZE", STRIP_ROWS),
            ("BIGTIFF", "IF_SAFER"),
        ];
        with_gdal(|| {
            memory.set_spatial_ref(&SpatialRef::from_definition(tile.crs)?)?;
            memory.set_geo_transform(&tile.geotransform.0)?;
            memory.set_metadata_item(VERTICAL_DATUM, "ellipsoid", "")?;
            for (key, value) in tile.metadata {
                memory.set_metadata_item(key, value, "")?;
            }
            if let Some((scale, offset)) = tile.height_from_value {
                let mut first = memory.rasterband(1)?;
                first.set_scale(scale)?;
                first.set_offset(offset)?;
            }
            copy(&memory, "GTiff", made, &options)
        })
        .map_err(|reason| RasterError::unwritable(path, reason))
    })
}
