//! The images of a scene, by name, by pattern or by folder.

use std::path::{Component, Path, PathBuf};

use glob::{Pattern, glob};
use numeric::failures;

use crate::job_paths::{is_address, resolved};

/// Endings of the names of images that are looked for in folders, in lower case.
const ENDINGS: [&str; 8] = ["tif", "tiff", "ntf", "nitf", "jp2", "j2k", "img", "vrt"];

/// Images that a pattern or a folder does not give.
#[derive(Debug, thiserror::Error)]
#[error("{what}")]
#[non_exhaustive]
pub struct ImageFilesError {
    /// Text found and text expected.
    pub what: String,
}

failures!(ImageFilesError: Input);

/// Returns the images that paths stand for: a file is itself, a pattern (`*`, `?`, `[…]`) the files
/// that match it, and a folder the images with an RPC that lie in it. Patterns and folders give
/// each image once, by name; an image that is named twice stays so.
///
/// # Errors
/// [`ImageFilesError`] for a pattern that matches no file, or that is none, and for a folder that
/// cannot be read or holds no image with an RPC.
pub fn image_files(given: &[PathBuf]) -> Result<Vec<PathBuf>, ImageFilesError> {
    let mut images: Vec<PathBuf> = Vec::new();
    for path in given {
        let is_plain = is_address(path) || path.is_file();
        let found = if path.is_dir() && !is_address(path) {
            images_in(path)
        } else if let Some(pattern) = path.to_str().filter(|text| !is_plain && is_pattern(text)) {
            matches(pattern, Path::new(".")).and_then(|found| match found.as_slice() {
                [] => Err(format!("no file matches the pattern {pattern:?} for images")),
                _ => Ok(found),
            })
        } else {
            images.push(path.clone());
            continue;
        };
        for image in found.map_err(|what| ImageFilesError { what })? {
            if !images.contains(&image) {
                images.push(image);
            }
        }
    }
    Ok(images)
}

/// Returns the images of a folder that have an RPC, by name.
fn images_in(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = folder.read_dir().map_err(|e| format!("cannot read the folder ({e}): {}", folder.display()))?;
    let is_named_so = |path: &Path| {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        path.is_file() && ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
    };
    let mut named: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path()).filter(|path| is_named_so(path)).collect();
    named.sort();
    let images: Vec<PathBuf> =
        named.iter().filter(|path| formats::rpc::read_for_image(path).is_ok()).cloned().collect();
    if images.is_empty() {
        return Err(format!(
            "the folder holds no image with an RPC ({} rasters without); give the images, or a folder of them: {}",
            named.len(),
            folder.display()
        ));
    }
    Ok(images)
}

fn is_pattern(text: &str) -> bool {
    text.contains(['*', '?', '['])
}

/// Returns the images that names and patterns stand for, each once, in the order of the patterns
/// and then of the names.
///
/// # Errors
/// A text for a pattern that matches no file, or that is none.
pub fn images_of(patterns: &[String], folder: &Path) -> Result<Vec<PathBuf>, String> {
    let mut images: Vec<PathBuf> = Vec::new();
    for pattern in patterns {
        let path = resolved(Path::new(pattern), folder);
        // A file may have a name that looks like a pattern, and an address may have one, too.
        let is_pattern = is_pattern(pattern) && !is_address(&path) && !path.exists();
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
