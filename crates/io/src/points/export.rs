//! Writes points as LAS or LAZ.
//!
//! The file is LAS 1.4 with point format 6. Coordinates are whole millimetres from an offset on
//! whole metres. The reference system is written as WKT. No date is written, so that the same
//! points give the same bytes.

use std::path::Path;

use crs::Crs;
use las::point::{Classification, Format};
use las::{Builder, Point, Transform, Vector, Version, Writer};

use crate::atomic::write_path;
use crate::raster::RasterError;

/// Resolution of the coordinates, metres.
const UNIT_M: f64 = 0.001;
/// Class of all points: never classified.
const CLASS: u8 = 0;

/// Writes points (x, y, height in metres) as LAS, or as LAZ when the extension of the path is
/// `laz`.
///
/// # Errors
/// - [`RasterError::NotWritten`] when the file exists and `overwrite` is false, the system refuses
///   to write, a point is not finite, or the points are farther apart than the format can hold
///   (2,147 km).
/// - [`RasterError::Crs`] when the reference system has no WKT.
pub fn write_las(path: &Path, points: &[[f64; 3]], crs: Crs, overwrite: bool) -> Result<(), RasterError> {
    let wkt = crs.wkt().map_err(|source| RasterError::Crs { path: path.to_owned(), source })?;
    let compressed = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("laz"));
    let failed = |error: las::Error| RasterError::unwritable(path, error);
    let offset = points.first().map_or([0.0; 3], |p| p.map(f64::floor));
    if points.iter().flatten().any(|c| !c.is_finite()) {
        return Err(RasterError::unwritable(path, "a point is not finite"));
    }
    write_path(path, overwrite, |made| {
        let mut builder = Builder::from(Version::new(1, 4));
        builder.date = None;
        builder.generating_software = "skysweep".to_owned();
        builder.point_format = Format::new(6).map_err(failed)?;
        builder.point_format.is_compressed = compressed;
        let axis = |i: usize| Transform { scale: UNIT_M, offset: offset[i] };
        builder.transforms = Vector { x: axis(0), y: axis(1), z: axis(2) };
        let mut header = builder.into_header().map_err(failed)?;
        header.set_wkt_crs(wkt.clone().into_bytes()).map_err(failed)?;
        let mut writer = Writer::from_path(made, header).map_err(failed)?;
        for &[x, y, z] in points {
            let classification = Classification::new(CLASS).map_err(failed)?;
            let point = Point { x, y, z, classification, gps_time: Some(0.0), ..Point::default() };
            writer.write_point(point).map_err(failed)?;
        }
        writer.close().map_err(failed)
    })
}
