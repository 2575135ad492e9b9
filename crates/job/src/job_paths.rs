//! Paths in files that describe a job. They are relative to the folder of the file, so that a
//! folder with inputs and results can be moved as a whole.
//!
//! Addresses (`https://…`, `/vsicurl/…`) stay as they are.

use std::path::{Component, Path, PathBuf};

/// Returns the path that a file in `folder` names as `path`.
pub fn resolved(path: &Path, folder: &Path) -> PathBuf {
    if path.as_os_str().is_empty() || path.is_absolute() || is_address(path) {
        return path.to_owned();
    }
    let mut out = canonical(folder);
    // Only leading dots are taken away: behind a name, which may be a link, they mean something
    // else.
    let mut parts = path.components().peekable();
    while let Some(part) = parts.next_if(|part| matches!(part, Component::CurDir | Component::ParentDir)) {
        if part == Component::ParentDir {
            out.pop();
        }
    }
    out.extend(parts);
    out
}

/// Returns the name under which a file in `folder` should name `path`: relative, or absolute where
/// the two share nothing but the root.
pub fn relative(path: &Path, folder: &Path) -> PathBuf {
    if path.as_os_str().is_empty() || is_address(path) {
        return path.to_owned();
    }
    let (path, folder) = (located(path), canonical(folder));
    let shared = path.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if shared <= 1 {
        return path;
    }
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    let out: PathBuf = up.chain(path.components().skip(shared)).collect();
    if out.as_os_str().is_empty() { PathBuf::from(".") } else { out }
}

/// Whether a name is an address or a place inside an archive, and no file of this machine.
pub fn is_address(path: &Path) -> bool {
    let name = path.to_string_lossy();
    name.starts_with("/vsi") || name.contains("://")
}

/// Returns the absolute path of a folder without links, as far as it exists.
fn canonical(folder: &Path) -> PathBuf {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    folder.canonicalize().unwrap_or_else(|_| std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()))
}

/// Returns the absolute path of a file in its canonical folder. The file itself may be a link with
/// files beside it, and keeps its name.
fn located(path: &Path) -> PathBuf {
    match (path.parent(), path.file_name()) {
        (Some(parent), Some(name)) if !path.is_dir() => canonical(parent).join(name),
        _ => canonical(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_lead_to_the_same_place_from_the_file() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        let (images, run) = (root.join("images"), root.join("runs/a"));
        std::fs::create_dir_all(&images).unwrap();
        std::fs::create_dir_all(&run).unwrap();
        let image = images.join("left.tif");
        let named = relative(&image, &run);
        assert_eq!(named, Path::new("../../images/left.tif"));
        assert_eq!(resolved(&named, &run), image);
        assert_eq!(relative(&run, &run), Path::new("."));
        assert_eq!(resolved(Path::new("."), &run), run);
        for same in ["https://example.org/a.tif", "/vsicurl/https://example.org/a.tif", ""] {
            assert_eq!(relative(Path::new(same), &run), Path::new(same));
            assert_eq!(resolved(Path::new(same), &run), Path::new(same));
        }
        assert_eq!(relative(Path::new("/far/away.tif"), &run), Path::new("/far/away.tif"));
    }
}
