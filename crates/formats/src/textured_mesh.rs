//! Writes a textured mesh as binary glTF 2.0, and the list of the tiles of 3D Tiles 1.1.
//!
//! Axes of glTF: x east, y up, z south. Positions are f32 metres from the translation of the only
//! node. The picture holds the light of the images, so the material is unlit.

use std::path::Path;

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use raster::Grid;
use serde_json::{Value, json};

use crate::atomic::{SaveError, write_bytes, write_stream};
use crate::gltf::{Glb, GlbBuffers};

/// Quality of the pictures, 1 to 100.
const QUALITY: u8 = 85;
/// Largest width and height of a JPEG file.
const PICTURE_SIDE: usize = 65_535;

/// A mesh with a picture on it.
#[derive(Debug, Clone)]
pub struct TexturedMesh<'a> {
    /// Corners: x east, y up, z south, metres from the translation.
    pub positions: &'a [[f32; 3]],
    /// Places of the corners in the picture, 0 to 1 from its upper left corner.
    pub texture_positions: &'a [[f32; 2]],
    /// Corners of the triangles, counter-clockwise from outside.
    pub triangles: &'a [[u32; 3]],
    /// The picture.
    pub picture: &'a Grid<[u8; 3]>,
    /// Place of the mesh in the frame of the file, metres.
    pub translation: [f64; 3],
    /// What the file says about itself, such as its reference system.
    pub extras: Value,
}

/// Writes a mesh as GLB, with its picture as JPEG inside.
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`], also for a mesh without
/// triangles and for one that is too large for the format.
pub fn write_textured_glb(path: &Path, mesh: &TexturedMesh<'_>, overwrite: bool) -> Result<(), SaveError> {
    let unwritable = |reason: String| SaveError::unwritable(path, reason);
    if mesh.triangles.is_empty() {
        return Err(unwritable("the mesh has no triangles".to_owned()));
    }
    let mut buffers = GlbBuffers::default();
    let attributes = json!({
        "POSITION": buffers.positions(mesh.positions),
        "TEXCOORD_0": buffers.texture_positions(mesh.texture_positions),
    });
    let indices = buffers.indices(mesh.triangles.as_flattened());
    let picture = buffers.picture(jpeg(mesh.picture).map_err(unwritable)?);
    let document = json!({
        "asset": { "version": "2.0", "generator": "skysweep", "extras": mesh.extras },
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "translation": mesh.translation }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 }] }],
        "materials": [{
            "doubleSided": true,
            "extensions": { "KHR_materials_unlit": {} },
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0, "roughnessFactor": 1.0,
            },
        }],
        "textures": [{ "source": 0, "sampler": 0 }],
        // Linear with mipmaps, clamped to the edge.
        "samplers": [{ "magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071 }],
        "images": [{ "bufferView": picture, "mimeType": "image/jpeg" }],
    });
    let glb = Glb::new(document, buffers).map_err(unwritable)?;
    write_stream(path, overwrite, |out| glb.write(out))
}

fn jpeg(picture: &Grid<[u8; 3]>) -> Result<Vec<u8>, String> {
    let (width, height) = (picture.width(), picture.height());
    if width.max(height) > PICTURE_SIDE {
        return Err(format!("the picture has {width} x {height} pixels, at most {PICTURE_SIDE} along a side"));
    }
    let mut out = Vec::new();
    let bytes = picture.data().as_flattened();
    JpegEncoder::new_with_quality(&mut out, QUALITY)
        .encode(bytes, width as u32, height as u32, ExtendedColorType::Rgb8)
        .map_err(|error| error.to_string())?;
    Ok(out)
}

/// A tile of a tileset.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshTile {
    /// File of the mesh, relative to the tileset.
    pub file: String,
    /// Least and greatest corner in the frame of the tileset: east, north, up, metres.
    pub low: [f64; 3],
    /// Greatest corner.
    pub high: [f64; 3],
    /// Error where this tile is shown instead of its children, metres.
    pub error_m: f64,
    /// The tiles that replace this one.
    pub children: Vec<MeshTile>,
}

/// Writes a tileset of 3D Tiles 1.1. `ecef_from_frame` has the columns of the matrix from the frame
/// of the tiles to EPSG:4978.
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`].
pub fn write_tileset(
    path: &Path,
    root: &MeshTile,
    ecef_from_frame: [f64; 16],
    extras: &Value,
    overwrite: bool,
) -> Result<(), SaveError> {
    let mut tile = tile(root);
    tile["transform"] = json!(ecef_from_frame);
    tile["refine"] = "REPLACE".into();
    let tileset = json!({
        "asset": { "version": "1.1", "generator": "skysweep", "extras": extras },
        "geometricError": 2.0 * root.error_m.max(1.0),
        "root": tile,
    });
    let text = format!("{tileset:#}\n");
    write_bytes(path, text.as_bytes(), overwrite)
}

fn tile(of: &MeshTile) -> Value {
    let middle = [0, 1, 2].map(|axis| 0.5 * (of.low[axis] + of.high[axis]));
    // A box has a volume also where the ground is level.
    let half = [0, 1, 2].map(|axis| (0.5 * (of.high[axis] - of.low[axis])).max(0.01));
    let [x, y, z] = half;
    let bounds = [middle[0], middle[1], middle[2], x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z];
    let mut out = json!({
        "boundingVolume": { "box": bounds },
        "geometricError": of.error_m,
        "content": { "uri": of.file },
    });
    if !of.children.is_empty() {
        out["children"] = of.children.iter().map(tile).collect();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_one_primitive_with_its_picture() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.glb");
        let picture = Grid::filled(5, 3, [200u8, 100, 50]);
        let mesh = TexturedMesh {
            positions: &[[0.0, 1.0, 0.0], [2.0, 1.5, 0.0], [0.0, 2.0, -2.0]],
            texture_positions: &[[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]],
            triangles: &[[0, 1, 2]],
            picture: &picture,
            translation: [10.0, 20.0, -30.5],
            extras: json!({ "crs": "EPSG:32631" }),
        };
        write_textured_glb(&path, &mesh, false).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let int = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], int(4), int(8)), (&b"glTF"[..], 2, bytes.len()));
        let document: Value = serde_json::from_slice(&bytes[20..20 + int(12)]).unwrap();
        assert_eq!(document["asset"]["extras"]["crs"], "EPSG:32631");
        assert_eq!(document["nodes"][0]["translation"], json!([10.0, 20.0, -30.5]));
        assert_eq!(document["accessors"][0]["max"], json!([2.0, 2.0, 0.0]));
        let view = &document["bufferViews"][document["images"][0]["bufferView"].as_u64().unwrap() as usize];
        let start = 28 + int(12) + view["byteOffset"].as_u64().unwrap() as usize;
        let jpeg = &bytes[start..start + view["byteLength"].as_u64().unwrap() as usize];
        let read = image::load_from_memory(jpeg).unwrap().to_rgb8();
        assert_eq!(read.dimensions(), (5, 3));
        assert!(read.as_raw().iter().zip(picture.data().as_flattened()).all(|(a, b)| a.abs_diff(*b) < 6));
        let none = TexturedMesh { triangles: &[], ..mesh };
        assert!(write_textured_glb(&folder.path().join("none.glb"), &none, false).is_err());
    }

    #[test]
    fn tiles_have_boxes_and_children() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tileset.json");
        let leaf =
            MeshTile { file: "1/0_0.glb".into(), low: [0.0; 3], high: [2.0, 4.0, 0.0], error_m: 0.0, children: vec![] };
        let root = MeshTile { file: "0/0_0.glb".into(), error_m: 4.0, children: vec![leaf.clone()], ..leaf };
        let mut matrix = [0.0; 16];
        (0..4).for_each(|i| matrix[5 * i] = 1.0);
        write_tileset(&path, &root, matrix, &json!({}), false).unwrap();
        let found: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!((&found["asset"]["version"], &found["root"]["refine"]), (&"1.1".into(), &"REPLACE".into()));
        assert!(found["geometricError"].as_f64() > found["root"]["geometricError"].as_f64());
        let child = &found["root"]["children"][0];
        let bounds = json!([1.0, 2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.01]);
        assert_eq!((&child["boundingVolume"]["box"], &child["content"]["uri"]), (&bounds, &"1/0_0.glb".into()));
        assert!(child.get("children").is_none());
    }
}
