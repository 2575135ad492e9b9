//! What all jobs do with files in the same way: refuse to replace, make folders, read text, write
//! JSON.

use std::fs;
use std::path::{Path, PathBuf};

use formats::raster::RasterError;
use formats::{FormatError, SaveError};
use numeric::{Failure, Kind, failures};
use serde::Serialize;

/// Largest text that a job reads whole: a report, a configuration, an origin, bytes.
pub const TEXT_LIMIT: u64 = 1 << 28;

/// A file or folder that a job could not read or write.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The output exists and the configuration does not allow to replace it.
    #[error("the output exists already: {}", path.display())]
    Exists {
        /// The file that would be replaced.
        path: PathBuf,
    },
    /// A file cannot be read.
    #[error("cannot read the file: {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// A folder cannot be read or made.
    #[error("cannot make the folder: {}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// The name of an output is not text that the libraries for rasters take.
    #[error("the name of the output is not UTF-8, which raster files need; choose another: {}", path.display())]
    NotUtf8 {
        /// The file or folder.
        path: PathBuf,
    },
    /// A folder cannot be written into.
    #[error("cannot write into the folder; check its permissions and space, or choose another: {}", path.display())]
    Unwritable {
        /// The folder.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// Another run writes into the folder.
    #[error("another run is writing into the folder; wait for its end or choose another folder: {}", path.display())]
    InUse {
        /// The folder.
        path: PathBuf,
    },
    /// A link is in the place of a folder for results. It could lead outside the output folder.
    #[error("a link is in the place of an output folder; remove it or choose another folder: {}", path.display())]
    Link {
        /// The link.
        path: PathBuf,
    },
    /// A folder that would be replaced or removed holds what no run of ours made.
    #[error(
        "the folder holds what skysweep did not make ({found}), so nothing in it is replaced; move this elsewhere, or \
         choose another output folder: {}",
        path.display()
    )]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// Names of some entries, and how many more there are.
        found: String,
    },
    /// An old result cannot be removed.
    #[error("cannot remove an old result: {}", path.display())]
    Remove {
        /// The file or folder.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// A finished file cannot be moved to its name.
    #[error("cannot move a finished file to its name: {}", path.display())]
    Move {
        /// The name.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Write(Box<dyn std::error::Error + Send + Sync>),
    /// A report cannot be written as JSON.
    #[error("cannot write the report as JSON")]
    Json(#[from] serde_json::Error),
}

failures!(FileError: File {
    Self::Exists { .. } => Kind::OutputExists,
    Self::NotUtf8 { .. } => Kind::Input,
    Self::InUse { .. } => Kind::InUse,
});

impl From<RasterError> for FileError {
    fn from(error: RasterError) -> Self {
        match error {
            RasterError::NotWritten(error) => error.into(),
            other => Self::Write(other.into()),
        }
    }
}

impl From<FormatError> for FileError {
    fn from(error: FormatError) -> Self {
        match error.kind() {
            Kind::OutputExists => Self::Exists { path: error.path().to_owned() },
            _ => Self::Write(error.into()),
        }
    }
}

impl From<SaveError> for FileError {
    fn from(error: SaveError) -> Self {
        match error {
            SaveError::Exists { path } => Self::Exists { path },
            other => Self::Write(other.into()),
        }
    }
}

impl FileError {
    /// Wraps the error of a writer of `io`.
    pub fn write(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Write(error.into())
    }
}

/// Fails when `path` exists and must not be replaced, so that a job stops before it computes.
pub fn refuse_existing(path: &Path, overwrite: bool) -> Result<(), FileError> {
    Ok(formats::atomic::refuse_existing(path, overwrite)?)
}

/// Fails when a file cannot be written to `path`, so that a job stops before it computes.
pub fn check_destination(path: &Path, overwrite: bool) -> Result<(), FileError> {
    Ok(formats::atomic::check_destination(path, overwrite)?)
}

/// Fails when a raster cannot be written to `path`. GDAL takes only names that are text.
pub fn check_raster_destination(path: &Path, overwrite: bool) -> Result<(), FileError> {
    if path.to_str().is_none() {
        return Err(FileError::NotUtf8 { path: path.to_owned() });
    }
    check_destination(path, overwrite)
}

/// Makes a folder and the folders above it.
pub fn create_folder(path: &Path) -> Result<(), FileError> {
    fs::create_dir_all(path).map_err(|source| FileError::Folder { path: path.to_owned(), source })
}

/// Removes a file if there is one.
pub fn remove(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(FileError::Remove { path: path.to_owned(), source: error })
        }
        _ => Ok(()),
    }
}

/// Moves a file to another name on the same file system.
pub fn move_to(from: &Path, to: &Path) -> Result<(), FileError> {
    fs::rename(from, to).map_err(|source| FileError::Move { path: to.to_owned(), source })
}

/// Reads a text file.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    formats::read_regular_text(path, TEXT_LIMIT).map_err(|source| FileError::Read { path: path.to_owned(), source })
}

/// Writes a value as indented JSON with a newline at the end. The file appears complete or not at
/// all.
pub fn write_json(path: &Path, value: &impl Serialize, overwrite: bool) -> Result<(), FileError> {
    let text = serde_json::to_string_pretty(value)? + "\n";
    Ok(formats::write_bytes(path, text.as_bytes(), overwrite)?)
}

/// Returns the names of everything in a folder; nothing where there is none.
pub fn names_in(folder: &Path) -> impl Iterator<Item = String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(|entry| entry.file_name().into_string().ok())
}

/// Returns what files of a view are called: the name of its image without the ending, with its
/// folders joined by underscores.
pub fn flat_stem(image: impl AsRef<Path>) -> String {
    image.as_ref().with_extension("").to_string_lossy().replace(['/', '\\'], "_")
}

/// Returns the size of all files in a folder, bytes. Links are not followed.
pub fn bytes_below(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let size = |entry: fs::DirEntry| match entry.metadata() {
        Ok(found) if found.is_dir() => bytes_below(&entry.path()),
        Ok(found) => found.len(),
        Err(_) => 0,
    };
    entries.map(size).sum()
}
