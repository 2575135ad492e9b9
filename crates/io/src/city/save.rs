//! A file under its final name is complete: written beside its destination under another name, then renamed.

use std::io::{BufWriter, Write};
use std::path::Path;

use super::CityError;

/// Makes a file by `make` and puts it to `path`.
///
/// # Errors
/// [`CityError::Exists`] without `overwrite`, [`CityError::Unwritable`].
pub(super) fn save(
    path: &Path,
    overwrite: bool,
    make: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), CityError> {
    let unwritable = |e: std::io::Error| CityError::Unwritable { path: path.to_owned(), reason: e.kind().to_string() };
    let exists = || CityError::Exists { path: path.to_owned() };
    if !overwrite && path.symlink_metadata().is_ok() {
        return Err(exists());
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    crate::rpc::set_usual_permissions(&mut builder);
    let mut file = builder.prefix(".skysweep-").tempfile_in(folder).map_err(unwritable)?;
    let mut buffered = BufWriter::new(file.as_file_mut());
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
