//! A file under its final name is complete: written as a stream beside its destination under another name, then renamed.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file that was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SaveError {
    /// The output exists.
    #[error("the output exists already: choose another name or pass --overwrite: {}", .path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The output cannot be written.
    #[error("cannot write the file ({reason}): {}", .path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What stands in the way.
        reason: String,
    },
}

impl SaveError {
    pub(crate) fn unwritable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unwritable { path: path.to_owned(), reason: reason.into() }
    }
}

/// Makes a file by `make` and puts it to `path`.
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`, [`SaveError::Unwritable`].
pub(crate) fn save(
    path: &Path,
    overwrite: bool,
    make: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), SaveError> {
    let unwritable = |e: std::io::Error| SaveError::unwritable(path, e.kind().to_string());
    let exists = || SaveError::Exists { path: path.to_owned() };
    if !overwrite && path.symlink_metadata().is_ok() {
        return Err(exists());
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    crate::rpc::set_usual_permissions(&mut builder);
    let mut file = builder.prefix(".skysweep-").tempfile_in(folder).map_err(unwritable)?;
    let mut buffered = BufWriter::with_capacity(1 << 16, file.as_file_mut());
    make(&mut buffered).and_then(|()| buffered.flush()).map_err(unwritable)?;
    drop(buffered);
    if overwrite {
        return file.persist(path).map(drop).map_err(|e| unwritable(e.error));
    }
    file.persist_noclobber(path).map(drop).map_err(|e| match e.error.kind() {
        std::io::ErrorKind::AlreadyExists => exists(),
        _ => unwritable(e.error),
    })
}
