//! The folder of a DSM run in the place of its surface model.

use std::path::{Path, PathBuf};

/// Place of the surface model in the folder of a run.
const SURFACE: &str = "dsm/dsm.tif";

/// Returns the file of a surface model, which may be given as the folder of the run that made it.
pub fn surface_file(surface: &Path) -> PathBuf {
    let inside = surface.join(SURFACE);
    if inside.is_file() { inside } else { surface.to_owned() }
}
