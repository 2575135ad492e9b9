//! The files of a result, known by size and hash, so that a result that was damaged never counts as
//! one.
//!
//! The size is compared first. Only a file of the right size is read, for its hash: 0.6 s of
//! processor time a gigabyte (SHA-256 with the processor's instructions for it), which is little
//! beside the minutes that made it.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::production::content_hash;
use job::files::FileError;

/// A file of a result as it was when the result was complete.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProductFile {
    /// The file, relative to the folder of the result.
    path: PathBuf,
    /// Size, bytes.
    bytes: u64,
    /// SHA-256 of the content.
    sha256: String,
}

impl ProductFile {
    /// Returns the files of a result: those of `places` (files and folders, relative to `folder`)
    /// that are there, with all that lies below the folders. What links lead to is no product.
    ///
    /// # Errors
    /// [`FileError::Read`].
    pub fn all_of(folder: &Path, places: &[PathBuf]) -> Result<Vec<Self>, FileError> {
        let (mut found, mut open) = (Vec::new(), places.to_vec());
        while let Some(inside) = open.pop() {
            let path = folder.join(&inside);
            let failed = |source| FileError::Read { path: path.clone(), source };
            let Ok(kind) = path.symlink_metadata() else { continue };
            if kind.is_dir() {
                for entry in fs::read_dir(&path).map_err(failed)? {
                    open.push(inside.join(entry.map_err(failed)?.file_name()));
                }
            } else if kind.is_file() {
                let sha256 = content_hash::of_file(&path).map_err(failed)?;
                found.push(Self { path: inside, bytes: kind.len(), sha256 });
            }
        }
        found.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(found)
    }

    /// Returns what is wrong with the first file of a result that is not as it was written; `None`
    /// when all are.
    pub fn damage(folder: &Path, files: &[Self]) -> Option<String> {
        files.iter().find_map(|file| file.fault(folder).map(|what| format!("{} {what}", file.path.display())))
    }

    fn fault(&self, folder: &Path) -> Option<String> {
        let path = folder.join(&self.path);
        let Ok(found) = path.symlink_metadata() else { return Some("is gone".to_owned()) };
        if !found.is_file() {
            return Some("is no regular file any more".to_owned());
        }
        if found.len() != self.bytes {
            return Some(format!("has {} bytes, expected {}", found.len(), self.bytes));
        }
        match content_hash::of_file(&path) {
            Ok(sha256) if sha256 == self.sha256 => None,
            Ok(_) => Some("has another content than was written".to_owned()),
            Err(error) => Some(format!("cannot be read: {error}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_damage_is_found_and_named() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path();
        fs::create_dir_all(folder.join("dsm/deep")).unwrap();
        for name in ["dsm/a.tif", "dsm/deep/b.tif", "alone.json", "other/c.tif"] {
            fs::create_dir_all(folder.join(name).parent().unwrap()).unwrap();
            fs::write(folder.join(name), name).unwrap();
        }
        let places = ["dsm", "alone.json", "absent"].map(PathBuf::from);
        let files = ProductFile::all_of(folder, &places).unwrap();
        let names: Vec<_> = files.iter().map(|file| file.path.display().to_string()).collect();
        assert_eq!(names, ["alone.json", "dsm/a.tif", "dsm/deep/b.tif"]);
        let damage = || ProductFile::damage(folder, &files);
        assert_eq!(damage(), None);
        let b = folder.join("dsm/deep/b.tif");
        fs::write(&b, "dsm/deep/b.ti").unwrap();
        assert_eq!(damage().unwrap(), "dsm/deep/b.tif has 13 bytes, expected 14");
        fs::write(&b, "dsm/deep/b.tiF").unwrap();
        assert_eq!(damage().unwrap(), "dsm/deep/b.tif has another content than was written");
        fs::remove_file(&b).unwrap();
        assert_eq!(damage().unwrap(), "dsm/deep/b.tif is gone");
        fs::create_dir(&b).unwrap();
        assert_eq!(damage().unwrap(), "dsm/deep/b.tif is no regular file any more");
    }
}
