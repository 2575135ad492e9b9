//! Keeps the paths of texture images valid when a model is written to another folder.
//!
//! Images are neither opened nor copied. A relative path gets a prefix that leads from the folder
//! of the new file to the folder of the old one. Absolute paths and addresses stay as they are.

use std::path::{Component, Path, PathBuf};

use city::CityModel;
use serde_json::Value;

/// Rewrites the relative image paths of a model that was read from `source` and will be written to
/// `output`. They stay as they are when both are in one folder.
pub fn move_images(model: &mut CityModel, source: &Path, output: &Path) {
    let (Some(from), Some(to)) = (folder_of(source), folder_of(output)) else { return };
    let Some(prefix) = way(&to, &from).filter(|prefix| !prefix.is_empty()) else { return };
    for texture in &mut model.appearance.textures {
        if let Some(Value::String(image)) = texture.get_mut("image")
            && is_relative(image)
        {
            *image = format!("{prefix}{image}");
        }
    }
}

/// Returns the folder of a file with links resolved where it exists.
fn folder_of(file: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(file).ok()?;
    let folder = absolute.parent()?;
    Some(std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned()))
}

/// Returns the way from one absolute folder to another with a slash at its end: relative where both
/// have the same root, and empty where they are the same.
fn way(from: &Path, to: &Path) -> Option<String> {
    let (from, to): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let (up, down) = if shared == 0 { (0, &to[..]) } else { (from.len() - shared, &to[shared..]) };
    let mut way = "../".repeat(up);
    for component in down {
        match component {
            Component::RootDir => way.push('/'),
            other => {
                way.push_str(other.as_os_str().to_str()?);
                way.push('/');
            }
        }
    }
    Some(way)
}

/// Whether an image is named by a relative path: neither an address, nor a path from a root or a
/// drive.
fn is_relative(image: &str) -> bool {
    let scheme = image.split_once(':').map(|(scheme, _)| scheme);
    let has_scheme = scheme.is_some_and(|scheme| {
        !scheme.is_empty() && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    });
    !has_scheme && !image.starts_with(['/', '\\']) && !image.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_between_folders() {
        let way = |from: &str, to: &str| way(Path::new(from), Path::new(to)).unwrap();
        assert_eq!(way("/a/b", "/a/b"), "");
        assert_eq!(way("/a/b", "/a/c/d"), "../c/d/");
        assert_eq!(way("/a", "/a/c"), "c/");
    }

    #[test]
    fn addresses_and_absolute_paths_stay() {
        for image in ["https://example.org/a.png", "data:image/png;base64,AA", "/a.png", "C:\\a.png", "\\\\host\\a.png"]
        {
            assert!(!is_relative(image), "{image}");
        }
        assert!(is_relative("appearances/a.png") && is_relative("../a.png") && is_relative("appearances\\a.png"));
    }
}
