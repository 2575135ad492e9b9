//! Writes points as LAS or LAZ.
//!
//! The file is LAS 1.4 with point format 6. Coordinates are whole millimetres from an offset on
//! whole metres. The reference system is written as WKT. No date is written, so that the same
//! points give the same bytes.

use std::io::Cursor;
use std::path::Path;

use crs::Crs;
use las::point::{Classification, Format};
use las::{Builder, Point, Transform, Vector, Version, Writer};

use crate::atomic::write_bytes;
use crate::raster::RasterError;

/// Resolution of the coordinates, metres.
const UNIT_M: f64 = 0.001;
/// Largest distance from the offset that the integers of the format hold, units.
const UNITS_MAX: f64 = i32::MAX as f64 - 1.0;
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
    // The header holds the bounds in the same integers, so nothing but the points can be too far.
    let fits = |point: &[f64; 3]| (0..3).all(|i| ((point[i] - offset[i]) / UNIT_M).abs() <= UNITS_MAX);
    if let Some([x, y, z]) = points.iter().find(|point| !fits(point)) {
        let [x0, y0, z0] = offset;
        let reason = format!(
            "the point ({x:.1}, {y:.1}, {z:.1}) is more than 2,147 km from the first one near ({x0}, {y0}, {z0}), \
             which is what whole millimetres can hold"
        );
        return Err(RasterError::unwritable(path, reason));
    }
    // In memory, because the library panics where a file refuses its last bytes.
    let mut builder = Builder::from(Version::new(1, 4));
    builder.date = None;
    builder.generating_software = "skysweep".to_owned();
    builder.point_format = Format::new(6).map_err(failed)?;
    builder.point_format.is_compressed = compressed;
    let axis = |i: usize| Transform { scale: UNIT_M, offset: offset[i] };
    builder.transforms = Vector { x: axis(0), y: axis(1), z: axis(2) };
    let mut header = builder.into_header().map_err(failed)?;
    header.set_wkt_crs(wkt.into_bytes()).map_err(failed)?;
    let mut writer = Writer::new(Cursor::new(Vec::new()), header).map_err(failed)?;
    for &[x, y, z] in points {
        let classification = Classification::new(CLASS).map_err(failed)?;
        let point = Point { x, y, z, classification, gps_time: Some(0.0), ..Point::default() };
        writer.write_point(point).map_err(failed)?;
    }
    writer.close().map_err(failed)?;
    let file = writer.into_inner().map_err(failed)?.into_inner();
    Ok(write_bytes(path, &file, overwrite)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_beyond_the_integers_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["far.las", "far.laz"] {
            let path = folder.path().join(name);
            let far = write_las(&path, &[[0.0; 3], [2.2e6, 0.0, 0.0]], Crs::ellipsoidal(32631), false);
            assert!(far.unwrap_err().to_string().contains("2,147 km"));
            assert!(!path.exists());
            write_las(&path, &[[0.0; 3], [2.1e6, 0.0, -2.1e6]], Crs::ellipsoidal(32631), false).unwrap();
        }
    }
}
