//! The images of a scene, by name or by pattern.

use std::path::{Path, PathBuf};

use glob::glob;

use crate::job_paths::resolved;

/// Returns the images that names and patterns stand for, each once, in the order of the patterns
/// and then of the names.
///
/// # Errors
/// A text for a pattern that matches no file, or that is none.
pub(super) fn images_of(patterns: &[String], folder: &Path) -> Result<Vec<PathBuf>, String> {
    let mut images: Vec<PathBuf> = Vec::new();
    for pattern in patterns {
        let path = resolved(Path::new(pattern), folder);
        // A file may have a name that looks like a pattern.
        let is_pattern = pattern.contains(['*', '?', '[']) && !path.exists();
        let found = if is_pattern {
            let failed = |reason: &str| format!("cannot use the pattern {pattern:?} for images: {reason}");
            let paths = glob(path.to_str().ok_or_else(|| failed("it is not UTF-8"))?);
            paths.map_err(|e| failed(e.msg))?.filter_map(Result::ok).filter(|path| path.is_file()).collect()
        } else {
            vec![path]
        };
        if found.is_empty() {
            return Err(format!("no file matches the pattern {pattern:?} for images"));
        }
        for image in found {
            if !images.contains(&image) {
                images.push(image);
            }
        }
    }
    Ok(images)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_stand_for_files() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.tif", "a.tif", "c.txt", "odd[1].tif"] {
            std::fs::write(folder.path().join(name), b"").unwrap();
        }
        let names = |patterns: &[&str]| -> Result<Vec<String>, String> {
            let patterns: Vec<String> = patterns.iter().map(|&pattern| pattern.to_owned()).collect();
            let found = images_of(&patterns, folder.path())?;
            Ok(found.iter().map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect())
        };
        assert_eq!(names(&["?.tif", "a.tif"]).unwrap(), ["a.tif", "b.tif"]);
        assert_eq!(names(&["odd[1].tif"]).unwrap(), ["odd[1].tif"]);
        assert_eq!(names(&["missing.tif"]).unwrap(), ["missing.tif"]);
        assert!(names(&["*.jp2"]).unwrap_err().contains("no file matches"));
    }
}
