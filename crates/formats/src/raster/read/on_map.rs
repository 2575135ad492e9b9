//! A raster laid into another reference system, for display: each cell of the new grid has the
//! value of the nearest cell of the file.

use std::path::Path;

use super::source::ImageSource;
use crate::raster::access::gdal_access::warped;
use crate::raster::access::gdal_setup::with_gdal;
use crate::raster::error::RasterError;

impl ImageSource {
    /// Opens a raster in the reference system of a WKT, on a grid whose cells are as large as those
    /// of the file. Nothing is computed before cells are read.
    ///
    /// # Errors
    /// Those of [`Self::open`]; [`RasterError::Damaged`] for a system to which GDAL knows no way.
    pub fn open_on_map(path: impl AsRef<Path>, wkt: &str) -> Result<Self, RasterError> {
        let source = Self::open(&path)?;
        let laid = with_gdal(|| warped(source.dataset(), wkt))
            .map_err(|reason| RasterError::damaged(path.as_ref(), format!("it cannot be laid into {wkt}: {reason}")))?;
        source.in_place_of(laid)
    }
}

#[cfg(test)]
mod tests {
    use crs::Crs;
    use raster::{GeoTransform, Grid};

    use super::*;
    use crate::raster::{Band, BandData, CogRaster, write_cog};

    #[test]
    fn a_raster_is_laid_into_another_system() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        let cells = Grid::from_vec(64, 64, (0..64 * 64).map(|i| i as f32).collect()).unwrap();
        let bands = [Band { description: "height_m", data: BandData::F32(&cells) }];
        let transform = GeoTransform([693_000.0, 1.0, 0.0, 4_822_064.0, 0.0, -1.0]);
        write_cog(&path, &CogRaster::new(&bands, transform, Crs::ellipsoidal(32631)), false).unwrap();
        let target = gdal::spatial_ref::SpatialRef::from_epsg(32630).unwrap().to_wkt().unwrap();
        let laid = ImageSource::open_on_map(&path, &target).unwrap();
        assert!(laid.info().crs_wkt.as_deref().is_some_and(|wkt| wkt.contains("zone 30N")));
        // A cell of the file, by its place in the other zone.
        let [own, other] = [32631, 32630].map(|epsg| crs::MapProjection::from_epsg(epsg).unwrap());
        let (lon, lat) = own.lonlat_from_map(693_020.5, 4_822_064.0 - 30.5).unwrap();
        let place = other.map_from_lonlat(lon, lat).unwrap();
        let (column, row) = laid.info().geotransform.unwrap().cell_from_map(place.x, place.y).unwrap();
        let window = raster::Window { x: column.round() as i64, y: row.round() as i64, width: 1, height: 1 };
        let found = laid.read_samples(1, window).unwrap()[(0, 0)];
        let near = |a: f32| (a % 64.0 - 20.0).abs() <= 1.0 && ((a / 64.0).floor() - 30.0).abs() <= 1.0;
        assert!(near(found), "{found}");
        // The corners of the turned raster lie outside of it.
        let all = laid.read_samples(1, laid.window()).unwrap();
        assert!(all.data().iter().any(|value| value.is_nan()));
        assert!(ImageSource::open_on_map(&path, "no system").is_err());
    }
}
