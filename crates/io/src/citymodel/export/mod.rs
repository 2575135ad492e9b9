//! Triangles of a city model for other programs: OBJ, PLY, glTF; and footprints as GeoJSON.
//!
//! Formats whose numbers are f32 (PLY, glTF) hold positions relative to the mesh's origin, which stands in the file; OBJ has
//! whole coordinates. Files appear under their name when they are complete.

mod footprints;
mod glb;
mod obj;
mod ply;

use std::io::Write;
use std::path::Path;

use city::{CityModel, TriangleMesh};

use super::error::CityError;
use crate::atomic::SaveError;
use crate::atomic::write_stream;

pub use footprints::{Footprints, write_footprints};

/// A format that triangles are written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MeshFormat {
    /// Wavefront OBJ: an object per city object, a material name per class.
    Obj,
    /// PLY, binary, little-endian: faces with `class` (number of [`city::SurfaceClass`]) and `object` (index).
    Ply,
    /// glTF 2.0 binary: a node per city object, a primitive per class; y is up.
    Glb,
}

/// Writes the triangles of `model` that are in `mesh`.
///
/// # Errors
/// [`CityError::NotWritten`]: the file exists and `overwrite` is false, the system refuses, or the format cannot hold that many
/// triangles.
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
            let (json, binary) = glb::encode(&export).map_err(too_large)?;
            write_stream(path, overwrite, |out| glb::write(out, &json, &binary))
        }
    };
    Ok(written?)
}

/// A model and triangles of it.
struct Export<'a> {
    model: &'a CityModel,
    mesh: &'a TriangleMesh,
}

impl Export<'_> {
    /// Runs of triangles of one object, with its index; the triangles of a mesh are in the order of the objects.
    fn objects(&self) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> {
        let object = |triangle: usize| self.mesh.surface(triangle).object as usize;
        let mut start = 0;
        std::iter::from_fn(move || {
            let first = (start < self.mesh.triangles.len()).then(|| object(start))?;
            let count = (start..self.mesh.triangles.len()).take_while(|&t| object(t) == first).count();
            let range = start..start + count;
            start = range.end;
            Some((first, range))
        })
    }

    /// An identifier on one line, without spaces.
    fn name(&self, object: usize) -> String {
        let id = self.model.objects.get(object).map_or("", |object| object.id.as_str());
        id.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect()
    }

    /// Lines about where the coordinates are.
    fn remarks(&self) -> [String; 2] {
        let origin = self.mesh.origin;
        let crs: String = self.model.crs.to_string().chars().filter(|c| !c.is_control()).collect();
        [format!("crs {crs}"), format!("origin {} {} {}", origin.x, origin.y, origin.z)]
    }
}

fn line(out: &mut dyn Write, text: std::fmt::Arguments<'_>) -> std::io::Result<()> {
    out.write_fmt(text)?;
    out.write_all(b"\n")
}
