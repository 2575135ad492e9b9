//! The rasters and vectors of the inputs: those of a folder in the order of their meaning, and
//! single files.

use std::path::{Path, PathBuf};

use formats::vectors::is_vector_name;

use super::error::ViewError;

/// Most rasters that are shown.
pub(super) const RASTERS_MAX: usize = 48;
/// Most entries of a folder that are looked at.
const ENTRIES_MAX: usize = 2000;
/// Folders of a run that hold rasters, the run's own first.
const FOLDERS: [&str; 11] =
    ["dsm", "", "dtm", "classes", "ortho", "products", "products/dtm", "products/classes", "eval", "diff", "truth"];
/// Stems of files that come first, in their order.
const FIRST: [&str; 11] = [
    "dsm",
    "sigma",
    "confidence",
    "views",
    "source",
    "filled",
    "dtm",
    "height_above_ground",
    "classes",
    "change",
    "ortho",
];
/// Most vectors that are shown, and the files of the folder of a run that hold some.
const VECTORS_MAX: usize = 16;
const VECTORS: [&str; 9] = [
    "contours.gpkg",
    "changes.geojson",
    "areas.geojson",
    "buildings.geojson",
    "buildings.gpkg",
    "products/contours.gpkg",
    "diff/changes.geojson",
    "diff/areas.geojson",
    "products/buildings.geojson",
];

/// A file of rasters or vectors of the inputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FoundRaster {
    /// The file.
    pub(super) path: PathBuf,
    /// Name of the file without its ending.
    pub(super) stem: String,
    /// Name of the input that it belongs to.
    pub(super) input: String,
    /// Whether the file itself was given. One that is only found in a folder may be left out.
    pub(super) is_named: bool,
}

/// Returns the rasters of the inputs, at most [`RASTERS_MAX`], and the number of further ones.
///
/// # Errors
/// [`ViewError::NoRasters`] for a folder without one.
pub(super) fn find(inputs: &[PathBuf]) -> Result<(Vec<FoundRaster>, usize), ViewError> {
    let mut found = Vec::new();
    for input in inputs.iter().filter(|input| !is_vectors(input)) {
        if !input.is_dir() {
            found.push(named(input, input, true));
            continue;
        }
        let before = found.len();
        for folder in FOLDERS {
            let mut files = rasters_in(&input.join(folder));
            files.sort_by_cached_key(|path| {
                let stem = stem(path);
                (FIRST.iter().position(|first| *first == stem).unwrap_or(FIRST.len()), stem)
            });
            found.extend(files.iter().map(|path| named(path, input, false)));
        }
        if found.len() == before {
            return Err(ViewError::NoRasters { path: input.clone() });
        }
    }
    let more = found.len().saturating_sub(RASTERS_MAX);
    found.truncate(RASTERS_MAX);
    Ok((found, more))
}

/// Returns the vectors of the inputs, at most [`VECTORS_MAX`], and the number of further ones.
pub(super) fn find_vectors(inputs: &[PathBuf]) -> (Vec<FoundRaster>, usize) {
    let mut found = Vec::new();
    for input in inputs {
        if is_vectors(input) {
            found.push(named(input, input, true));
        } else if input.is_dir() {
            let files = VECTORS.map(|name| input.join(name)).into_iter().filter(|path| path.is_file());
            found.extend(files.map(|path| named(&path, input, false)));
        }
    }
    let more = found.len().saturating_sub(VECTORS_MAX);
    found.truncate(VECTORS_MAX);
    (found, more)
}

/// Whether an input is a file of vectors by its name.
pub(super) fn is_vectors(input: &Path) -> bool {
    is_vector_name(input) && !input.is_dir()
}

fn named(path: &Path, input: &Path, is_named: bool) -> FoundRaster {
    let input = input.file_name().unwrap_or(input.as_os_str()).to_string_lossy().into_owned();
    FoundRaster { path: path.to_owned(), stem: stem(path), input, is_named }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the TIFF files of a folder; none for a folder that is not there.
fn rasters_in(folder: &Path) -> Vec<PathBuf> {
    let entries = folder.read_dir().into_iter().flatten().flatten().take(ENTRIES_MAX);
    let is_tiff = |path: &PathBuf| {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        matches!(ending.as_str(), "tif" | "tiff") && path.is_file()
    };
    entries.map(|entry| entry.path()).filter(is_tiff).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_begins_with_its_heights() {
        let run = tempfile::tempdir().unwrap();
        for name in ["ortho.tif", "dsm/views.tif", "dsm/dsm.tif", "dsm/relief.png", "dsm/a.TIFF", "dtm/dtm.tif"] {
            let path = run.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"").unwrap();
        }
        let (found, more) = find(&[run.path().to_owned(), run.path().join("ortho.tif")]).unwrap();
        let stems: Vec<&str> = found.iter().map(|f| f.stem.as_str()).collect();
        assert_eq!((stems, more), (vec!["dsm", "views", "a", "ortho", "dtm", "ortho"], 0));
        assert!(found[5].is_named && !found[0].is_named);
        let empty = tempfile::tempdir().unwrap();
        assert!(matches!(find(&[empty.path().to_owned()]), Err(ViewError::NoRasters { .. })));
    }
}
