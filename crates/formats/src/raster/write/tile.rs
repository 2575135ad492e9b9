//! Writing GeoTIFF for small maps: rotated geotransforms, any map projection, band scale and
//! offset, metadata.
//!
//! The file has tiles of 256 cells, deflate with the predictor of the sample type, and overviews
//! where it is larger than a tile. A rotated geotransform is written as the file's
//! transformation matrix, and a coordinate system without an EPSG code by its parameters. With a
//! scale and an offset, the height above the ellipsoid is `value · scale + offset` of the first
//! band, which [`crate::raster::read_dem`] and GDAL's tools apply.

use std::path::Path;

use gdal::Metadata;
use gdal::spatial_ref::SpatialRef;
use raster::{GeoTransform, NO_DATA};

use super::band::{Band, in_memory};
use super::geotiff::{Sampling, VERTICAL_DATUM, copy, overview_factors, resampling};
use super::labels::label;
use crate::atomic::write_path;
use crate::raster::access::gdal_setup::with_gdal;
use crate::raster::error::RasterError;

/// Side of a tile, cells.
const TILE: usize = 256;

/// A linear conversion of stored values: `value · scale + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandScale {
    /// Factor.
    pub scale: f64,
    /// Summand.
    pub offset: f64,
}

/// A small map to write.
#[derive(Debug, Clone, Copy)]
pub struct MapTile<'a> {
    /// The bands, at least one, of the same type and size.
    pub bands: &'a [Band<'a>],
    /// Position of the grid, which may be rotated.
    pub geotransform: GeoTransform,
    /// Horizontal CRS as `EPSG:n` or WKT. Heights are above the ellipsoid.
    pub crs: &'a str,
    /// Conversion from values of the first band to heights above the ellipsoid, metres.
    pub height_from_value: Option<BandScale>,
    /// Items of the default metadata domain, as key and value.
    pub metadata: &'a [(&'static str, String)],
}

/// Writes a map as a GeoTIFF. NaN becomes −32768 in float bands; integer bands have no no-data
/// value.
///
/// # Errors
/// - [`RasterError::NotWritten`] for a file that exists without `overwrite`, for a CRS that GDAL
///   cannot read, and when GDAL or the system refuses.
/// - [`RasterError::InconsistentBands`] when there is no band, or the bands differ in size or type.
pub fn write_map_tile(path: impl AsRef<Path>, tile: &MapTile<'_>, overwrite: bool) -> Result<(), RasterError> {
    let path = path.as_ref();
    let float = Band::first_is_float(tile.bands);
    write_path(path, overwrite, |made| {
        let mut memory = in_memory(path, tile.bands, float.then_some(f64::from(NO_DATA)))?;
        let side = TILE.to_string();
        let options = [
            ("COMPRESS", "DEFLATE"),
            // Half the time of the default level for about 5 % more bytes.
            ("ZLEVEL", "1"),
            ("PREDICTOR", if float { "3" } else { "2" }),
            ("TILED", "YES"),
            ("BLOCKXSIZE", side.as_str()),
            ("BLOCKYSIZE", side.as_str()),
            ("COPY_SRC_OVERVIEWS", "YES"),
            ("BIGTIFF", "IF_SAFER"),
        ];
        with_gdal(|| {
            memory.set_spatial_ref(&SpatialRef::from_definition(tile.crs)?)?;
            memory.set_geo_transform(&tile.geotransform.0)?;
            memory.set_metadata_item(VERTICAL_DATUM, "ellipsoid", "")?;
            for (key, value) in tile.metadata {
                memory.set_metadata_item(key, value, "")?;
            }
            if let Some(BandScale { scale, offset }) = tile.height_from_value {
                let mut first = memory.rasterband(1)?;
                first.set_scale(scale)?;
                first.set_offset(offset)?;
            }
            let sampling = if float { Sampling::Average } else { Sampling::Nearest };
            memory.build_overviews(resampling(sampling), &overview_factors(memory.raster_size(), TILE), &[])
        })
        .and_then(|()| label(&mut memory))
        .and_then(|()| copy(&memory, "GTiff", made, &options))
        .map_err(|reason| RasterError::unwritable(path, reason))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::BandData;
    use raster::Grid;

    /// Viewers and cutters read a part of a large map, and its reductions, without the whole.
    #[test]
    fn large_maps_have_tiles_and_overviews() {
        let folder = tempfile::tempdir().unwrap();
        for (side, expected) in [(518, 2), (200, 0)] {
            let path = folder.path().join(format!("{side}.tif"));
            let heights = Grid::from_vec(side, side, (0..side * side).map(|i| i as f32).collect()).unwrap();
            let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
            let tile = MapTile {
                bands: &bands,
                geotransform: GeoTransform([500_000.0, 0.4, 0.3, 4_800_000.0, 0.3, -0.4]),
                crs: "EPSG:32631",
                height_from_value: Some(BandScale { scale: 1.0, offset: 100.0 }),
                metadata: &[],
            };
            write_map_tile(&path, &tile, false).unwrap();
            let dataset = crate::raster::access::gdal_setup::open_dataset(&path).unwrap();
            let band = dataset.rasterband(1).unwrap();
            assert_eq!((band.block_size(), band.overview_count().unwrap()), ((TILE, TILE), expected), "{side}");
        }
    }
}
