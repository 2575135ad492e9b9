//! The folder of a dataset: where its COLMAP model lies, and what its positions are counted from.

use std::path::{Path, PathBuf};

use io::splat_ply::LocalOrigin;
use serde_json::Value;

use crate::files::{self, FileError};

/// Reference system of a dataset that does not name one.
pub(crate) const UNKNOWN_FRAME: &str = "frame of the dataset";
/// Vertical datum of a dataset, which its origin does not name.
pub(crate) const UNKNOWN_DATUM: &str = "unknown";

/// The origin of a dataset that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetOriginError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not JSON.
    #[error("the file is not an origin as skysweep writes it ({source}): {}", path.display())]
    NotJson {
        /// The file.
        path: PathBuf,
        /// What the JSON reader found.
        source: serde_json::Error,
    },
}

/// Returns the folder of the model of a dataset.
pub(crate) fn sparse_folder(folder: &Path) -> PathBuf {
    let folders = [folder.join("sparse/0"), folder.join("sparse"), folder.to_owned()];
    let has_cameras = |f: &&PathBuf| ["cameras.bin", "cameras.txt"].iter().any(|n| f.join(n).is_file());
    folders.iter().find(has_cameras).unwrap_or(&folders[0]).clone()
}

/// Returns the folder of the dataset around a model: that with `sparse` in it.
pub(crate) fn dataset_folder(sparse: &Path) -> PathBuf {
    let up = sparse.ancestors().find(|folder| folder.file_name().is_some_and(|name| name == "sparse"));
    up.and_then(Path::parent).unwrap_or(sparse).to_owned()
}

/// Returns where the positions of a dataset are counted from, as far as its origin says so.
pub(crate) fn dataset_origin(dataset: &Path) -> Result<LocalOrigin, DatasetOriginError> {
    let path = dataset.join("origin.json");
    let unknown = LocalOrigin::new(UNKNOWN_FRAME, UNKNOWN_DATUM, [0.0; 3]);
    if !path.is_file() {
        return Ok(unknown);
    }
    let value: Value = serde_json::from_str(&files::read_text(&path)?)
        .map_err(|source| DatasetOriginError::NotJson { path: path.clone(), source })?;
    let part = &value["model_from_dataset"];
    let identity = serde_json::json!([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let shift: Option<[f64; 3]> = serde_json::from_value(part["translation"].clone()).ok();
    match (value["model_crs"].as_str(), shift) {
        (Some(crs), Some(shift)) if part["scale"] == 1.0 && part["rotation"] == identity => {
            Ok(LocalOrigin::new(crs, UNKNOWN_DATUM, shift))
        }
        _ => Ok(unknown),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dataset_is_found_from_inside_and_outside() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        assert_eq!(sparse_folder(root), root.join("sparse/0"));
        std::fs::create_dir_all(root.join("sparse/0")).unwrap();
        std::fs::write(root.join("sparse/0/cameras.txt"), "").unwrap();
        assert_eq!(sparse_folder(&root.join("sparse/0")), root.join("sparse/0"));
        assert_eq!((dataset_folder(&root.join("sparse/0")), dataset_folder(root)), (root.to_owned(), root.to_owned()));
        assert_eq!(dataset_origin(root).unwrap().crs, UNKNOWN_FRAME);
        std::fs::write(root.join("origin.json"), "{").unwrap();
        assert!(dataset_origin(root).unwrap_err().to_string().contains("origin.json"));
    }
}
