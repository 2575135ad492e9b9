//! SHA-256 of files and of values, in hexadecimal digits.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use serde::Serialize;
use sha2::{Digest, Sha256};

/// Bytes that are read at a time.
const BUFFER: usize = 1 << 20;

/// Returns the hash of a regular file's content.
///
/// # Errors
/// Those of the system; [`ErrorKind::InvalidInput`] for what is not a regular file.
pub(crate) fn of_file(path: &Path) -> std::io::Result<String> {
    // The type is checked first because opening a pipe would block.
    if !path.metadata()?.is_file() {
        return Err(ErrorKind::InvalidInput.into());
    }
    let (mut file, mut hasher, mut buffer) = (File::open(path)?, Sha256::new(), vec![0; BUFFER]);
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(digits(hasher)),
            read => hasher.update(&buffer[..read]),
        }
    }
}

/// Returns the hash of a value as JSON.
///
/// # Errors
/// When the value cannot be written as JSON.
pub fn of_value(value: &impl Serialize) -> Result<String, serde_json::Error> {
    let mut hasher = Sha256::new();
    hasher.update(serde_json::to_vec(value)?);
    Ok(digits(hasher))
}

fn digits(hasher: Sha256) -> String {
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_sha256() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(of_file(&path).unwrap(), expected);
        assert!(of_file(folder.path()).is_err());
        assert_ne!(of_value(&[1, 2]).unwrap(), of_value(&[2, 1]).unwrap());
    }
}
