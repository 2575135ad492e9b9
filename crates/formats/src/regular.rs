//! Reading whole files: regular ones of a bounded size only. A pipe would wait for ever, and a
//! device such as `/dev/zero` has no end.

use std::fs::File;
use std::io::{Error, ErrorKind, Read};
use std::path::Path;

/// Opens a regular file.
///
/// # Errors
/// The error of the system; [`ErrorKind::InvalidInput`] for a folder, a pipe or a device.
pub fn open(path: &Path) -> Result<File, Error> {
    // The type is checked first because opening a pipe would block.
    if !std::fs::metadata(path)?.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "not a regular file"));
    }
    File::open(path)
}

/// Reads a regular file of at most `limit` bytes.
///
/// # Errors
/// The errors of opening the file, and [`ErrorKind::FileTooLarge`] for a larger file.
pub fn read_regular(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    let file = open(path)?;
    let too_large =
        |size: u64| Error::new(ErrorKind::FileTooLarge, format!("the file has {size} bytes, at most {limit} are read"));
    let size = file.metadata()?.len();
    if size > limit {
        return Err(too_large(size));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(size).unwrap_or_default());
    // A file may grow while it is read, and files of `/proc` say that they are empty.
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(too_large(bytes.len() as u64)) } else { Ok(bytes) }
}

/// Reads a regular text file in UTF-8 of at most `limit` bytes.
///
/// # Errors
/// As [`read_regular`]; [`ErrorKind::InvalidData`] for other encodings.
pub fn read_regular_text(path: &Path, limit: u64) -> Result<String, Error> {
    String::from_utf8(read_regular(path, limit)?)
        .map_err(|_| Error::new(ErrorKind::InvalidData, "the text is not UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_holds() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, "hello").unwrap();
        assert_eq!(read_regular_text(&path, 5).unwrap(), "hello");
        assert_eq!(read_regular(&path, 4).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read_regular(folder.path(), 4).unwrap_err().kind(), ErrorKind::InvalidInput);
    }

    /// Every reader of whole files, on a device without end.
    #[cfg(unix)]
    #[test]
    fn devices_are_refused_by_every_reader() {
        let zero = Path::new("/dev/zero");
        assert_eq!(read_regular(zero, 1 << 20).unwrap_err().kind(), ErrorKind::InvalidInput);
        assert!(crate::positions::read_positions(zero).is_err());
        assert!(crate::control::read(zero).is_err());
        assert!(crate::similarity::read(zero).is_err());
        assert!(crate::npy::read(zero).is_err());
        assert!(crate::splat_ply::read(zero).is_err());
        assert!(crate::splat_files::read(zero).is_err());
        assert!(crate::transforms::read(zero, None).is_err());
        assert!(crate::points::PointCloud::open(zero).is_err());
        assert!(crate::rpc::read_for_image(zero).is_err());
        assert!(!crate::maps::is_npy(zero));
    }
}
