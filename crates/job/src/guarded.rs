//! The one way to go below an output folder: never through a link, and nothing is removed that
//! this program cannot name as its own.
//!
//! Names are relative to a folder that the user gave, with `/` between their parts. That folder
//! itself may be a link, because the user named it; everything below it may not. A folder is
//! replaced or removed only when each of its entries is known. A user's file in it is told, and
//! everything stays as it was.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::files::FileError;

/// Beginning of the names of temporary files and folders, which no user gives.
pub const TEMPORARY: &str = ".skysweep-";
/// Entries that a message names; the others are counted.
const NAMED: usize = 4;

/// Tells whether an entry is ours by its name, relative to the folder that is looked at. Names of
/// folders end in `/`.
pub type Known<'a> = &'a dyn Fn(&str) -> bool;

/// Returns the path of a name below a folder. The folders above it are no links; they need not
/// exist.
///
/// # Errors
/// [`FileError::Link`].
pub fn place(root: &Path, name: &str) -> Result<PathBuf, FileError> {
    let mut path = root.to_owned();
    let mut parts = name.split('/').peekable();
    while let Some(part) = parts.next() {
        path.push(part);
        if parts.peek().is_some() {
            check_folder(&path)?;
        }
    }
    Ok(path)
}

/// Refuses a link or a file in the place of a folder, which need not exist.
///
/// # Errors
/// [`FileError::Link`], [`FileError::Folder`].
pub fn check_folder(path: &Path) -> Result<(), FileError> {
    match path.symlink_metadata() {
        Ok(found) if found.is_symlink() => Err(FileError::Link { path: path.to_owned() }),
        Ok(found) if !found.is_dir() => {
            Err(FileError::Folder { path: path.to_owned(), source: ErrorKind::NotADirectory.into() })
        }
        _ => Ok(()),
    }
}

/// Refuses links and files in the place of folders below a folder, and of those between.
///
/// # Errors
/// [`FileError::Link`], [`FileError::Folder`].
pub fn check_folders<'a>(root: &Path, names: impl IntoIterator<Item = &'a str>) -> Result<(), FileError> {
    names.into_iter().try_for_each(|name| check_folder(&place(root, name)?))
}

/// Makes a folder below another one, with the folders between, unless they are there.
///
/// # Errors
/// [`FileError::Link`], [`FileError::Folder`].
pub fn make_folder(root: &Path, name: &str) -> Result<PathBuf, FileError> {
    let mut path = root.to_owned();
    for part in name.split('/').filter(|part| !part.is_empty()) {
        path.push(part);
        match fs::create_dir(&path) {
            Err(_) if path.symlink_metadata().is_ok() => check_folder(&path)?,
            other => other.map_err(|source| FileError::Folder { path: path.clone(), source })?,
        }
    }
    Ok(path)
}

/// Checks that files can get their names below a folder: no folder above them is a link, and no
/// folder is in their place.
///
/// # Errors
/// [`FileError::Link`], [`FileError::Foreign`].
pub fn check_places<'a>(root: &Path, names: impl IntoIterator<Item = &'a str>) -> Result<(), FileError> {
    names.into_iter().try_for_each(|name| refuse_folder(&place(root, name)?))
}

/// Refuses a folder in the place of a file.
fn refuse_folder(path: &Path) -> Result<(), FileError> {
    if path.symlink_metadata().is_ok_and(|found| found.is_dir()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let folder = path.parent().unwrap_or(path).to_owned();
        return Err(FileError::Foreign { found: format!("the folder {name} in the place of a file"), path: folder });
    }
    Ok(())
}

/// Removes a file below a folder, if there is one. A link in its place is removed, and not what it
/// leads to.
///
/// # Errors
/// [`FileError::Link`] for a folder above it, [`FileError::Foreign`] for a folder in its place,
/// [`FileError::Remove`].
pub fn remove_file(root: &Path, name: &str) -> Result<(), FileError> {
    let path = place(root, name)?;
    refuse_folder(&path)?;
    crate::files::remove(&path)
}

/// What lies in a folder.
#[derive(Default)]
struct Entries {
    files: Vec<PathBuf>,
    /// Each after the one that it lies in.
    folders: Vec<PathBuf>,
    foreign: Vec<String>,
}

impl Entries {
    /// Looks at a folder that is no link; `below` is its name with a `/` at the end.
    fn look(&mut self, folder: &Path, below: &str, known: Known<'_>) -> std::io::Result<()> {
        let mut entries = fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
        entries.sort_by_key(fs::DirEntry::file_name);
        for entry in entries {
            let (path, kind) = (entry.path(), entry.file_type()?);
            let name = format!("{below}{}", entry.file_name().to_string_lossy());
            if kind.is_dir() && known(&format!("{name}/")) {
                self.folders.push(path.clone());
                self.look(&path, &format!("{name}/"), known)?;
            } else if kind.is_file() && known(&name) {
                self.files.push(path);
            } else {
                let what = if kind.is_symlink() { " (a link)" } else { "" };
                self.foreign.push(format!("{name}{what}"));
            }
        }
        Ok(())
    }

    fn of(folder: &Path, known: Known<'_>) -> Result<Self, FileError> {
        check_folder(folder)?;
        let mut entries = Self::default();
        match entries.look(folder, "", known) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(FileError::Folder { path: folder.to_owned(), source: error })
            }
            _ => Ok(entries),
        }
    }

    fn refuse_foreign(&self, folder: &Path) -> Result<(), FileError> {
        if self.foreign.is_empty() {
            return Ok(());
        }
        let mut found = self.foreign.iter().take(NAMED).cloned().collect::<Vec<_>>().join(", ");
        if self.foreign.len() > NAMED {
            found += &format!(" and {} more", self.foreign.len() - NAMED);
        }
        Err(FileError::Foreign { path: folder.to_owned(), found })
    }

    fn remove(self) -> Result<(), FileError> {
        for path in self.files {
            crate::files::remove(&path)?;
        }
        self.folders.into_iter().rev().try_for_each(remove_empty)
    }
}

/// Removes an empty folder, if there is one.
fn remove_empty(path: PathBuf) -> Result<(), FileError> {
    match fs::remove_dir(&path) {
        // Another process was faster.
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        other => other.map_err(|source| FileError::Remove { path, source }),
    }
}

/// Checks that a folder, where there is one, holds nothing but what is known.
///
/// # Errors
/// [`FileError::Link`], [`FileError::Foreign`], [`FileError::Folder`].
pub fn require_own(folder: &Path, known: Known<'_>) -> Result<(), FileError> {
    Entries::of(folder, known)?.refuse_foreign(folder)
}

/// Removes a folder with all that is known in it. Where anything else is in it, nothing is removed.
///
/// # Errors
/// As [`require_own`]; [`FileError::Remove`].
pub fn remove_folder(folder: &Path, known: Known<'_>) -> Result<(), FileError> {
    let entries = Entries::of(folder, known)?;
    entries.refuse_foreign(folder)?;
    entries.remove()?;
    remove_empty(folder.to_owned())
}

/// Removes what is known from a folder and leaves the rest; the folder goes where nothing is left.
/// A link in its place stays.
///
/// # Errors
/// [`FileError::Folder`], [`FileError::Remove`].
pub fn remove_known(folder: &Path, known: Known<'_>) -> Result<(), FileError> {
    if check_folder(folder).is_err() {
        return Ok(());
    }
    let entries = Entries::of(folder, known)?;
    for path in entries.files {
        crate::files::remove(&path)?;
    }
    for path in entries.folders.into_iter().rev().chain([folder.to_owned()]) {
        // Removes nothing that has content.
        let _ = fs::remove_dir(path);
    }
    Ok(())
}

/// Removes the files in a folder whose names are known, and the temporary folders among them with
/// all that is in these. Everything else stays, also links.
///
/// # Errors
/// [`FileError::Remove`].
pub fn remove_inside(folder: &Path, known: Known<'_>) -> Result<(), FileError> {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, Ok(kind)) = (entry.path(), entry.file_type()) else { continue };
        let removed = match known(&entry.file_name().to_string_lossy()) {
            true if kind.is_dir() && is_temporary(&path) => fs::remove_dir_all(&path),
            true if kind.is_file() => fs::remove_file(&path),
            _ => continue,
        };
        match removed {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(FileError::Remove { path, source: error }),
            _ => {}
        }
    }
    Ok(())
}

/// Whether the last name of a path is one that only we give.
fn is_temporary(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(TEMPORARY))
}

/// Returns the folders in a folder that are no links.
pub fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir())).map(|entry| entry.path()).collect()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    fn known(name: &str) -> bool {
        ["a.npy", "below/", "below/b.npy"].contains(&name)
    }

    #[test]
    fn a_folder_goes_only_when_all_of_it_is_known() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("result");
        remove_folder(&folder, &known).unwrap();
        let fill = || {
            fs::create_dir_all(folder.join("below")).unwrap();
            for name in ["a.npy", "below/b.npy"] {
                fs::write(folder.join(name), b"ours").unwrap();
            }
        };
        fill();
        remove_folder(&folder, &known).unwrap();
        assert!(!folder.exists());
        let outside = root.path().join("outside");
        fs::create_dir(&outside).unwrap();
        fs::write(outside.join("canary"), b"kept").unwrap();
        type Plant = fn(&Path, &Path);
        let plants: [(&str, Plant); 5] = [
            ("mine.txt", |path, _| fs::write(path, b"kept").unwrap()),
            ("below/mine.npy", |path, _| fs::write(path, b"kept").unwrap()),
            ("mine", |path, _| fs::create_dir(path).unwrap()),
            ("a.npy", |path, outside| {
                fs::remove_file(path).unwrap();
                symlink(outside.join("canary"), path).unwrap();
            }),
            ("other", |path, outside| symlink(outside, path).unwrap()),
        ];
        for (name, plant) in plants {
            let _ = fs::remove_dir_all(&folder);
            fill();
            plant(&folder.join(name), &outside);
            let told = remove_folder(&folder, &known).unwrap_err().to_string();
            assert!(told.contains(name) && told.contains("move"), "{told}");
            assert!(folder.join("below/b.npy").is_file(), "nothing was removed");
            remove_known(&folder, &known).unwrap();
            assert!(folder.join(name).symlink_metadata().is_ok() && !folder.join("below/b.npy").exists());
            assert_eq!(fs::read(outside.join("canary")).unwrap(), b"kept");
        }
    }

    #[test]
    fn links_are_told_at_every_level() {
        let root = tempfile::tempdir().unwrap();
        let (out, outside) = (root.path().join("out"), root.path().join("outside"));
        fs::create_dir_all(out.join("a")).unwrap();
        fs::create_dir_all(outside.join("c")).unwrap();
        fs::write(outside.join("d"), b"kept").unwrap();
        symlink(&outside, out.join("a/b")).unwrap();
        let is_told = |result: Result<(), FileError>| matches!(result, Err(FileError::Link { .. }));
        assert!(is_told(make_folder(&out, "a/b").map(drop)) && is_told(make_folder(&out, "a/b/c").map(drop)));
        assert!(is_told(remove_file(&out, "a/b/d")) && is_told(check_places(&out, ["a/b/d"])));
        assert!(is_told(remove_folder(&out.join("a/b"), &|_| true)));
        remove_known(&out.join("a/b"), &|_| true).unwrap();
        remove_file(&out, "a/b").unwrap();
        assert_eq!(fs::read(outside.join("d")).unwrap(), b"kept");
        assert!(matches!(remove_file(&out, "a"), Err(FileError::Foreign { .. })), "a folder is no file");
        // The folder that the user names may be a link.
        symlink(&outside, root.path().join("named")).unwrap();
        assert!(make_folder(&root.path().join("named"), "new/newer").unwrap().is_dir());
    }
}
