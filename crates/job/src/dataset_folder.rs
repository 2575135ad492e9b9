//! The folder of a dataset: where its COLMAP model lies, and what its positions are counted from.

use std::path::{Path, PathBuf};

use formats::splat_ply::LocalOrigin;
use numeric::failures;
use serde_json::Value;

use crate::error::{JobError, from_failures};
use crate::files;

/// Reference system of a dataset that does not name one.
pub const UNKNOWN_FRAME: &str = "frame of the dataset";
/// Vertical datum of a dataset, which its origin does not name.
pub const UNKNOWN_DATUM: &str = "unknown";

/// The origin of a dataset that is not JSON.
#[derive(Debug, thiserror::Error)]
#[error("the file is not an origin as skysweep writes it ({source}): {}", path.display())]
pub(crate) struct DatasetOriginError {
    path: PathBuf,
    source: serde_json::Error,
}

failures!(DatasetOriginError: File);

from_failures!(DatasetOriginError);

/// Folders below a dataset in which its model and its images are looked for, in depth.
const DEPTH: usize = 4;
/// Folders that are looked into at most, so that a home folder given by mistake ends soon.
const FOLDERS: usize = 2000;

/// Returns the folder of the model of a dataset: `sparse/0`, `sparse`, the folder itself, or the
/// first one below with cameras and images, the nearest and first by name.
pub fn sparse_folder(folder: &Path) -> PathBuf {
    let folders = [folder.join("sparse/0"), folder.join("sparse"), folder.to_owned()];
    let has = |f: &Path, name: &str| ["bin", "txt"].iter().any(|kind| f.join(format!("{name}.{kind}")).is_file());
    let known = folders.iter().find(|f| has(f, "cameras")).cloned();
    let below = || folders_below(folder).into_iter().find(|f| has(f, "cameras") && has(f, "images"));
    known.or_else(below).unwrap_or_else(|| folders[0].clone())
}

/// Returns the folder of the images of a model: of `images` in or beside the dataset and its model,
/// the model's own folder and all folders below the dataset the first that has all the names, or
/// else the one that has most of them; `images` of the dataset where none has any.
pub fn pictures_folder(dataset: &Path, sparse: &Path, names: &[&str]) -> PathBuf {
    let usual = dataset.join("images");
    let around = [dataset, sparse].into_iter().chain(sparse.ancestors().skip(1).take(DEPTH));
    let beside: Vec<PathBuf> = around.flat_map(|folder| [folder.join("images"), folder.to_owned()]).collect();
    let count = |folder: &Path| names.iter().filter(|name| folder.join(name).is_file()).count();
    let mut best = (count(&usual), usual);
    // The folders are only listed where the usual ones do not have all images.
    for folders in [&(|| beside.clone()) as &dyn Fn() -> Vec<PathBuf>, &|| folders_below(dataset)] {
        if best.0 == names.len() {
            break;
        }
        for folder in folders() {
            let found = count(&folder);
            if found > best.0 {
                best = (found, folder);
            }
        }
    }
    best.1
}

/// Returns the folders below a folder, the nearest first and by name.
fn folders_below(folder: &Path) -> Vec<PathBuf> {
    let (mut found, mut level) = (Vec::new(), vec![folder.to_owned()]);
    for _ in 0..DEPTH {
        let mut next: Vec<PathBuf> = Vec::new();
        for entries in level.iter().filter_map(|folder| folder.read_dir().ok()) {
            let is_hidden = |name: &std::ffi::OsStr| name.to_string_lossy().starts_with('.');
            let folders = entries.flatten().filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
            next.extend(folders.filter(|entry| !is_hidden(&entry.file_name())).map(|entry| entry.path()));
            if found.len() + next.len() > FOLDERS {
                break;
            }
        }
        next.sort();
        found.extend(next.iter().cloned());
        level = next;
    }
    found
}

/// Returns the folder of the dataset around a model: that with `sparse` in it.
pub fn dataset_folder(sparse: &Path) -> PathBuf {
    let up = sparse.ancestors().find(|folder| folder.file_name().is_some_and(|name| name == "sparse"));
    up.and_then(Path::parent).unwrap_or(sparse).to_owned()
}

/// Returns where the positions of a dataset are counted from, as far as its origin says so.
///
/// # Errors
/// [`JobError`] if the file of the origin cannot be read, or is not JSON.
pub fn dataset_origin(dataset: &Path) -> Result<LocalOrigin, JobError> {
    let path = dataset.join("origin.json");
    let unknown = LocalOrigin::new(UNKNOWN_FRAME, UNKNOWN_DATUM, [0.0; 3]);
    if !path.is_file() {
        return Ok(unknown);
    }
    let value: Value = serde_json::from_str(&files::read_text(&path)?)
        .map_err(|source| DatasetOriginError { path: path.clone(), source })?;
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
        std::fs::write(root.join("sparse/0/images.txt"), "").unwrap();
        assert_eq!(sparse_folder(&root.join("sparse/0")), root.join("sparse/0"));
        assert_eq!((dataset_folder(&root.join("sparse/0")), dataset_folder(root)), (root.to_owned(), root.to_owned()));
        assert_eq!(dataset_origin(root).unwrap().crs, UNKNOWN_FRAME);
        std::fs::write(root.join("origin.json"), "{").unwrap();
        assert!(dataset_origin(root).unwrap_err().to_string().contains("origin.json"));
    }

    #[test]
    fn models_and_images_are_found_in_any_layout() {
        let folder = tempfile::tempdir().unwrap();
        let put = |path: &str| {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        };
        let names = ["left/1.png", "right/1.png"];
        let layouts = [
            ("plain", "sparse/0", "images"),
            ("flat", "sparse", "images"),
            ("other", "sparse/1", "images"),
            ("beside", "model", "."),
            ("one", ".", "."),
            ("dense", "dense/0/sparse", "dense/0/images"),
            ("rgb", "colmap/sparse/0", "rgb"),
        ];
        for (name, model, images) in layouts {
            ["cameras.bin", "images.bin"].iter().for_each(|file| put(&format!("{name}/{model}/{file}")));
            names.iter().for_each(|file| put(&format!("{name}/{images}/{file}")));
            let root = folder.path().join(name);
            let sparse = sparse_folder(&root);
            assert_eq!(sparse, root.join(model).components().collect::<PathBuf>(), "{name}");
            let expected = root.join(images).components().collect::<PathBuf>();
            assert_eq!(pictures_folder(&root, &sparse, &names), expected, "{name}");
        }
        let root = folder.path().join("one");
        assert_eq!(pictures_folder(&root, &root, &["2.png"]), root.join("images"));
        // A model that is given itself has its images beside it, or one up.
        let model = folder.path().join("dense/dense/0/sparse");
        assert_eq!(pictures_folder(&model, &model, &names), folder.path().join("dense/dense/0/images"));
    }
}
