//! Writes the triangles of a city model as OBJ, PLY or glTF, and its footprints as GeoJSON.
//!
//! Formats with f32 (PLY, glTF) hold positions relative to the origin of the mesh, which is written
//! into the file. OBJ holds full coordinates. A file appears under its name when it is complete.

mod footprints;
mod glb;
mod obj;
mod ply;
mod source;

use std::path::Path;

use city::{CityModel, TriangleMesh};

use super::error::CityError;
use formats::atomic::{SaveError, write_stream};
use source::Export;

pub use footprints::{Footprints, write_footprints};

/// Format for triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MeshFormat {
    /// Wavefront OBJ: one object per city object, one material name per class.
    Obj,
    /// Binary little-endian PLY: faces with `class` (number of the [`city::SurfaceClass`]) and
    /// `object` (index).
    Ply,
    /// Binary glTF 2.0: one node per city object, one primitive per class; y is up.
    Glb,
}

/// Writes the triangles `mesh` of `model`.
///
/// # Errors
/// [`CityError::NotWritten`] when the file exists and `overwrite` is false, the system refuses to
/// write, or the mesh is too large for the format.
pub fn write_mesh(
    path: &Path,
    model: &CityModel,
    mesh: &TriangleMesh,
    format: MeshFormat,
    overwrite: bool,
) -> Result<(), CityError> {
    let export = Export { model, mesh };
    let too_large = |reason: String| SaveError::unwritable(path, reason);
    let written = match format {
        MeshFormat::Obj => write_stream(path, overwrite, |out| obj::write(out, &export)),
        MeshFormat::Ply => write_stream(path, overwrite, |out| ply::write(out, &export)),
        MeshFormat::Glb => {
            let glb = glb::encode(&export).map_err(too_large)?;
            write_stream(path, overwrite, |out| glb.write(out))
        }
    };
    Ok(written?)
}
