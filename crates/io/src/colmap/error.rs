//! Why a COLMAP model was not read or written.

use std::path::PathBuf;

use numeric::failures;

use crate::atomic::SaveError;
use crate::camera_file::CameraFileError;

/// Why a COLMAP model was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ColmapError {
    /// One of the files of the model is missing.
    #[error(
        "the folder holds neither {name}.bin nor {name}.txt, choose the folder that holds the COLMAP model: {}",
        .folder.display()
    )]
    Missing {
        /// Folder that was searched.
        folder: PathBuf,
        /// Name of the missing file, without its extension.
        name: &'static str,
    },
    /// A file of the model cannot be read, or breaks the rules of its format.
    #[error(transparent)]
    File(#[from] CameraFileError),
    /// The model cannot be expressed in COLMAP's files.
    #[error("the model cannot be written ({what}): {}", .folder.display())]
    Inconsistent {
        /// Folder that was to be written.
        folder: PathBuf,
        /// What does not fit.
        what: String,
    },
    /// A file exists or cannot be written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}

failures!(ColmapError: File { Self::NotWritten(error) => error.kind() });
