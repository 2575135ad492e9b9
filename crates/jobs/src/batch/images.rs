//! The images of a scene, by name or by pattern.

use std::path::{Component, Path, PathBuf};

use glob::{Pattern, glob};

use crate::job_paths::{is_address, resolved};

/// Returns the images that names and patterns stand for, each once, in the order of the patterns
/// and then of the names.
///
/// # Errors
/// A text for a pattern that matches no file, or that is none.
pub(super) fn images_of(patterns: &[String], folder: &Path) -> Result<Vec<PathBuf>, String> {
    let mut images: Vec<PathBuf> = Vec::new();
    for pattern in patterns {
        let path = resolved(Path::new(pattern), folder);
        // A file may have a name that looks like a pattern, and an address may have one, too.
        let is_pattern = pattern.contains(['*', '?', '[']) && !is_address(&path) && !path.exists();
        let found = if is_pattern {
            matches(pattern, folder)
                .map_err(|reason| format!("cannot use the pattern {pattern:?} for images: {reason}"))?
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

/// Returns the files that a pattern matches. The folder that it is relative to is no part of it.
fn matches(pattern: &str, folder: &Path) -> Result<Vec<PathBuf>, String> {
    let is_dots = |part: &Component<'_>| matches!(part, Component::CurDir | Component::ParentDir);
    let whole = if Path::new(pattern).is_absolute() {
        pattern.to_owned()
    } else {
        let mut parts = Path::new(pattern).components().peekable();
        let dots: PathBuf = std::iter::from_fn(|| parts.next_if(is_dots)).collect();
        let base = resolved(&Path::new(".").join(dots), folder);
        let base = Pattern::escape(base.to_str().ok_or("the folder is not UTF-8")?);
        Path::new(&base).join(parts.collect::<PathBuf>()).to_string_lossy().into_owned()
    };
    let paths = glob(&whole).map_err(|e| e.msg.to_owned())?;
    let paths = paths.collect::<Result<Vec<_>, _>>().map_err(|e| e.to_string())?;
    Ok(paths.into_iter().filter(|path| path.is_file()).collect())
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
        assert_eq!(names(&["https://example.org/a.tif?b"]).unwrap(), ["a.tif?b"]);
        // The folder of the batch file is a name, whatever it looks like.
        let odd = folder.path().join("2024 [draft]/below");
        std::fs::create_dir_all(&odd).unwrap();
        std::fs::write(odd.join("d.tif"), b"").unwrap();
        std::fs::write(odd.join("../e.tif"), b"").unwrap();
        let found = images_of(&["*.tif".to_owned(), "../*.tif".to_owned()], &odd).unwrap();
        let odd = odd.canonicalize().unwrap();
        assert_eq!(found, [odd.join("d.tif"), odd.parent().unwrap().join("e.tif")]);
    }
}
