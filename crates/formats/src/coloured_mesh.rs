//! Writes a mesh with a colour at every corner: binary little-endian PLY, or binary glTF 2.0.
//!
//! PLY keeps the axes of the frame, with the origin of its positions in a comment, as
//! `cityfiles::surfaces` reads it. glTF has the axes x east, y up, z south, with the origin as the
//! translation of its only node. Its colours are linear, those of pictures and PLY are not.

use std::path::Path;

use serde_json::{Value, json};

use crate::atomic::{SaveError, write_stream};
use crate::gltf::{Glb, GlbBuffers};
use crate::ply::write_header;

/// A mesh with a colour at every corner.
#[derive(Debug, Clone)]
pub struct ColouredMesh<'a> {
    /// Corners: east, north, up, metres from the origin.
    pub positions: &'a [[f32; 3]],
    /// Colours of the corners as in pictures (sRGB), 0 to 1.
    pub colours: &'a [[f32; 3]],
    /// Corners of the triangles, counter-clockwise from outside.
    pub triangles: &'a [[u32; 3]],
    /// Position of the origin in the frame of the file, metres.
    pub origin: [f64; 3],
    /// Definition of the reference system; `None` where it is not known.
    pub crs: Option<&'a str>,
}

/// Writes a mesh as PLY.
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`].
pub fn write_mesh_ply(path: &Path, mesh: &ColouredMesh<'_>, overwrite: bool) -> Result<(), SaveError> {
    let [x, y, z] = mesh.origin;
    let crs = mesh.crs.filter(|crs| !crs.contains(|c: char| c.is_control() || !c.is_ascii()));
    let comments = [format!("origin {x} {y} {z}")].into_iter().chain(crs.map(|crs| format!("crs {crs}")));
    let comments: Vec<String> = comments.collect();
    let corner = ["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue"];
    let elements: [(&str, usize, &[&str]); 2] =
        [("vertex", mesh.positions.len(), &corner), ("face", mesh.triangles.len(), &["list uchar int vertex_indices"])];
    write_stream(path, overwrite, |out| {
        write_header(out, &comments, &elements)?;
        for (position, colour) in mesh.positions.iter().zip(mesh.colours) {
            position.iter().try_for_each(|c| out.write_all(&c.to_le_bytes()))?;
            out.write_all(&colour.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8))?;
        }
        for triangle in mesh.triangles {
            out.write_all(&[3])?;
            triangle.iter().try_for_each(|corner| out.write_all(&corner.to_le_bytes()))?;
        }
        Ok(())
    })
}

/// Writes a mesh as GLB.
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`], also for a mesh without
/// triangles and for one that is too large for the format.
pub fn write_mesh_glb(path: &Path, mesh: &ColouredMesh<'_>, overwrite: bool) -> Result<(), SaveError> {
    let unwritable = |reason: String| SaveError::unwritable(path, reason);
    if mesh.triangles.is_empty() {
        return Err(unwritable("the mesh has no triangles".to_owned()));
    }
    let upright: Vec<[f32; 3]> = mesh.positions.iter().map(|&[x, y, z]| [x, z, -y]).collect();
    let linear: Vec<[f32; 3]> = mesh.colours.iter().map(|c| c.map(linear)).collect();
    let mut buffers = GlbBuffers::default();
    let attributes = json!({ "POSITION": buffers.positions(&upright), "COLOR_0": buffers.colours(&linear) });
    let indices = buffers.indices(mesh.triangles.as_flattened());
    let [x, y, z] = mesh.origin;
    let extras = mesh.crs.map_or(Value::Null, |crs| json!({ "crs": crs, "axes": "x east, y up, z south" }));
    let document = json!({
        "asset": { "version": "2.0", "generator": "skysweep", "extras": extras },
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "translation": [x, z, -y] }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 }] }],
        "materials": [{ "doubleSided": true, "extensions": { "KHR_materials_unlit": {} } }],
    });
    let glb = Glb::new(document, buffers).map_err(unwritable)?;
    write_stream(path, overwrite, |out| glb.write(out))
}

/// Returns the linear value of a value of sRGB (IEC 61966-2-1).
fn linear(value: f32) -> f32 {
    let value = value.clamp(0.0, 1.0);
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MESH: ColouredMesh<'static> = ColouredMesh {
        positions: &[[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.0, 2.0, 0.5]],
        colours: &[[1.0, 0.0, 0.5]; 3],
        triangles: &[[0, 1, 2]],
        origin: [690_000.0, 4_820_000.0, 100.0],
        crs: Some("EPSG:32631"),
    };

    #[test]
    fn a_file_is_not_replaced_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        write_mesh_ply(&path, &MESH, false).unwrap();
        assert!(write_mesh_ply(&path, &MESH, false).unwrap_err().to_string().contains("exists"));
    }

    #[test]
    fn a_glb_stands_upright() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.glb");
        write_mesh_glb(&path, &MESH, false).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let document: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        assert_eq!(document["nodes"][0]["translation"], json!([690_000.0, 100.0, -4_820_000.0]));
        assert_eq!(document["accessors"][0]["max"], json!([1.0, 0.5, 0.0]));
        assert_eq!(u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize, bytes.len());
        let none = ColouredMesh { triangles: &[], ..MESH };
        assert!(write_mesh_glb(&path, &none, true).unwrap_err().to_string().contains("no triangles"));
    }
}
