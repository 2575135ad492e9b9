//! What an earlier run made in the folder of a dataset, as its report says: only this is replaced.

use std::collections::HashSet;
use std::path::Path;

use serde_json::{Value, json};

use job::files::{FileError, read_text, write_json};
use job::output_folder::OutputFolder;

/// The report of a dataset.
const REPORT: &str = "report.json";
/// The note of what is being replaced.
pub(super) const NOTE: &str = ".replaced-by-skysweep.json";
/// What follows the name of a view in the names of its files.
const PARTS: [&str; 6] = ["", "_depth", "_normal", "_class", "_object", "_height"];
/// Files that belong to no view, each with its folder.
const FIXED: [&str; 13] = [
    "sparse/0/cameras.bin",
    "sparse/0/cameras.txt",
    "sparse/0/images.bin",
    "sparse/0/images.txt",
    "sparse/0/points3D.bin",
    "sparse/0/points3D.txt",
    "sparse/0/points3D.ply",
    "splats/splats_2dgs.ply",
    "splats/splats_2dgs.origin.json",
    "splats/splats_2dgs.objects.json",
    "splats/splats_3dgs.ply",
    "splats/splats_3dgs.origin.json",
    "splats/splats_3dgs.objects.json",
];
/// Endings of the files of views, by their folder; pictures keep the ending that they had.
const ENDINGS: [(&str, &str); 14] = [
    ("raw_depth", "npy"),
    ("raw_normal", "npy"),
    ("raw_mask", "npy"),
    ("masks", "png"),
    ("class", "npy"),
    ("object", "npy"),
    ("class", "tif"),
    ("object", "tif"),
    ("depth_png", "png"),
    ("geotiff", "tif"),
    ("height", "tif"),
    ("distance", "tif"),
    ("normal", "tif"),
    ("mask", "tif"),
];

/// Views of an earlier run.
#[derive(Debug, Default)]
pub(super) struct Made {
    /// Names of their files without endings, with and without the folders in them.
    stems: HashSet<String>,
}

impl Made {
    /// Reads the report in a folder, and the note of a run that was killed while it replaced files;
    /// nothing was made where there is neither.
    pub(super) fn of(folder: &Path) -> Self {
        let mut stems = HashSet::new();
        for name in [REPORT, NOTE] {
            let text = read_text(&folder.join(name)).unwrap_or_default();
            let report: Value = serde_json::from_str(&text).unwrap_or_default();
            let rows = ["views", "images"].into_iter().filter_map(|key| report.get(key)?.as_array()).flatten();
            for name in rows.filter_map(|row| row.get("name")?.as_str()) {
                let file = name.rsplit('/').next().unwrap_or(name);
                let without_ending = |name: &str| match file.rsplit_once('.') {
                    Some((_, ending)) => name[..name.len() - ending.len() - 1].to_owned(),
                    None => name.to_owned(),
                };
                stems.extend([without_ending(name), without_ending(file)]);
            }
        }
        Self { stems }
    }

    /// Notes in the folder what is replaced and what replaces it, so that both are known after a
    /// kill. The note goes when the new report is there.
    pub(super) fn note(&self, folder: &OutputFolder, work: &Path) -> Result<(), FileError> {
        let mut names: Vec<String> = self.stems.union(&Self::of(work).stems).map(|stem| format!("{stem}.")).collect();
        names.sort();
        let rows: Vec<Value> = names.into_iter().map(|name| json!({ "name": name })).collect();
        write_json(&folder.path().join(NOTE), &json!({ "views": rows }), true)
    }

    /// Checks that an entry of the dataset can be replaced.
    pub(super) fn check(&self, folder: &OutputFolder, entry: &str) -> Result<(), FileError> {
        if entry.contains('.') {
            return folder.check_places([entry]);
        }
        folder.require_own(entry, &|name| self.knows(entry, name))
    }

    /// Removes an entry of the dataset.
    pub(super) fn remove(&self, folder: &OutputFolder, entry: &str) -> Result<(), FileError> {
        if entry.contains('.') {
            return folder.remove(entry);
        }
        folder.remove_folder(entry, &|name| self.knows(entry, name))
    }

    /// Whether an earlier run made a file, or a folder, of an entry.
    fn knows(&self, entry: &str, name: &str) -> bool {
        if name.ends_with('/') {
            let whole = format!("{entry}/{name}");
            return FIXED.iter().any(|fixed| fixed.starts_with(&whole))
                || self.stems.iter().any(|stem| stem.starts_with(name));
        }
        if FIXED.contains(&format!("{entry}/{name}").as_str()) {
            return true;
        }
        let Some((stem, ending)) = name.rsplit_once('.') else { return false };
        let fits = match entry {
            "images" => true,
            "previews" => ending == "png",
            _ => ENDINGS.contains(&(entry, ending)),
        };
        let is_of_view = |part| stem.strip_suffix(part).is_some_and(|stem| self.stems.contains(stem));
        fits && PARTS.into_iter().any(is_of_view)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_report_names_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let report = r#"{"views": [{"name": "left/a.jpg"}], "images": [{"name": "view_1"}]}"#;
        std::fs::write(folder.path().join(REPORT), report).unwrap();
        let made = Made::of(folder.path());
        for (entry, name) in [
            ("raw_depth", "left/"),
            ("raw_depth", "left/a.npy"),
            ("raw_depth", "a.npy"),
            ("geotiff", "left/a_depth.tif"),
            ("previews", "view_1_height.png"),
            ("height", "view_1.tif"),
            ("images", "left/a.JPG"),
            ("sparse", "0/"),
            ("sparse", "0/cameras.bin"),
        ] {
            assert!(made.knows(entry, name), "{entry}/{name}");
        }
        for (entry, name) in [
            ("raw_depth", "b.npy"),
            ("raw_depth", "left/a.png"),
            ("raw_depth", "right/"),
            ("height", "view_1.txt"),
            ("sparse", "0/notes.txt"),
            ("sparse", "1/"),
            ("images", "c.jpg"),
        ] {
            assert!(!made.knows(entry, name), "{entry}/{name}");
        }
        assert!(!Made::of(&folder.path().join("none")).knows("raw_depth", "left/a.npy"));
    }
}
