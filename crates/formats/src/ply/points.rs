//! Writes points for Gaussian splatting trainers: binary little-endian PLY with `x y z nx ny nz` as
//! float and `red green blue` as uchar.
//!
//! The readers of 3DGS and 2DGS require these properties in this order, and fail without normals.
//! Positions are f32 relative to an origin in the comments, so that they stay precise on a map.

use std::path::Path;

use super::header::write_header;
use crate::atomic::{SaveError, write_stream};

/// Point with a normal and a colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlyPoint {
    /// Position relative to the origin of the file.
    pub position: [f32; 3],
    /// Unit normal; zeros when it is unknown.
    pub normal: [f32; 3],
    /// Colour: red, green, blue.
    pub color: [u8; 3],
}

const PROPERTIES: [&str; 9] =
    ["float x", "float y", "float z", "float nx", "float ny", "float nz", "uchar red", "uchar green", "uchar blue"];

/// Writes points, and one comment line per entry of `comments` (`origin x y z`, `crs …`).
///
/// # Errors
/// - [`SaveError::Exists`] when the file exists and `overwrite` is false.
/// - [`SaveError::Unwritable`] when the system refuses to write, or the iterator yields another
///   number of points than its length.
///
/// # Examples
/// ```
/// use formats::ply::{PlyPoint, write_points};
///
/// let folder = tempfile::tempdir()?;
/// let point = PlyPoint { position: [1.0, 2.0, 3.0], normal: [0.0, 0.0, 1.0], color: [200, 80, 60] };
/// let comments = ["origin 690000 4820000 0".to_owned(), "crs EPSG:32631".to_owned()];
/// write_points(folder.path().join("points3D.ply"), [point].into_iter(), &comments, false)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_points(
    path: impl AsRef<Path>,
    points: impl ExactSizeIterator<Item = PlyPoint>,
    comments: &[String],
    overwrite: bool,
) -> Result<(), SaveError> {
    write_stream(path.as_ref(), overwrite, |out| {
        let count = points.len();
        // Readers of trainers take the header for ASCII.
        let comments: Vec<String> = comments.iter().map(|c| c.chars().filter(char::is_ascii).collect()).collect();
        write_header(out, &comments, &[("vertex", count, &PROPERTIES)])?;
        let mut written = 0;
        for point in points {
            let mut record = [0u8; 27];
            let floats = point.position.into_iter().chain(point.normal);
            record
                .chunks_exact_mut(4)
                .zip(floats)
                .for_each(|(bytes, value)| bytes.copy_from_slice(&value.to_le_bytes()));
            record[24..].copy_from_slice(&point.color);
            out.write_all(&record)?;
            written += 1;
        }
        if written == count { Ok(()) } else { Err(std::io::ErrorKind::InvalidInput.into()) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_are_those_of_the_format() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points3D.ply");
        let point = PlyPoint { position: [1.5, -2.0, 3.0], normal: [0.0, 0.0, 1.0], color: [1, 128, 255] };
        write_points(&path, [point, point].into_iter(), &["origin 1 2 3\nend_header".to_owned()], false).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let end = bytes.windows(12).position(|window| window == b"\nend_header\n").unwrap() + 12;
        let header = std::str::from_utf8(&bytes[..end]).unwrap();
        assert!(header.starts_with("ply\nformat binary_little_endian 1.0\ncomment origin 1 2 3end_header\nelement"));
        assert!(header.contains("element vertex 2\nproperty float x\n"));
        assert_eq!(bytes.len(), end + 2 * 27);
        let floats: Vec<f32> =
            bytes[end..end + 24].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(floats, [1.5, -2.0, 3.0, 0.0, 0.0, 1.0]);
        assert_eq!(&bytes[end + 24..end + 27], [1, 128, 255]);
        let again = write_points(&path, [].into_iter(), &[], false);
        assert!(matches!(again, Err(SaveError::Exists { .. })));
    }
}
