//! City models under their final name: [`crate::save`] with the errors of this module.

use std::io::Write;
use std::path::Path;

use super::CityError;
use crate::save::SaveError;

/// Makes a file by `make` and puts it to `path`.
///
/// # Errors
/// [`CityError::Exists`] without `overwrite`, [`CityError::Unwritable`].
pub(super) fn save(
    path: &Path,
    overwrite: bool,
    make: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), CityError> {
    crate::save::save(path, overwrite, make).map_err(|error| match error {
        SaveError::Exists { path } => CityError::Exists { path },
        SaveError::Unwritable { path, reason } => CityError::Unwritable { path, reason },
    })
}
