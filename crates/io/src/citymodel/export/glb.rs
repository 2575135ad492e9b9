//! Writes glTF 2.0 as one binary file: a node and a mesh per city object, a primitive and a colour
//! per class.
//!
//! The y axis of glTF points up: (x, y, z) of the model becomes (x, z, −y). Positions are f32
//! metres from the origin, which the extras of the asset hold together with the reference system.
//! The triangles of an object share their corners. Faces have no normals, so that viewers shade
//! them flat.

use std::collections::BTreeMap;
use std::io::Write;

use city::SurfaceClass;
use serde_json::{Value, json};

use super::source::Export;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Returns the JSON chunk and the binary chunk.
pub(super) fn encode(export: &Export<'_>) -> Result<(Vec<u8>, Vec<u8>), String> {
    let mut scene = Scene::default();
    let materials: Vec<SurfaceClass> = SurfaceClass::all().collect();
    for (object, triangles) in export.objects() {
        scene.add(export, object, triangles, &materials);
    }
    let origin = export.mesh.origin;
    let mut document = json!({
        "asset": {
            "version": "2.0",
            "generator": "skysweep",
            "extras": { "crs": export.model.crs.to_string(), "origin": [origin.x, origin.y, origin.z] },
        },
        "scene": 0,
        "scenes": [{}],
        "materials": materials.iter().map(|&class| material(class)).collect::<Value>(),
    });
    // glTF does not allow empty lists.
    if !scene.nodes.is_empty() {
        document["scenes"] = json!([{ "nodes": (0..scene.nodes.len()).collect::<Vec<_>>() }]);
        document["nodes"] = Value::Array(scene.nodes);
        document["meshes"] = Value::Array(scene.meshes);
        document["accessors"] = Value::Array(scene.accessors);
        document["bufferViews"] = Value::Array(scene.views);
        document["buffers"] = json!([{ "byteLength": scene.binary.len() }]);
    }
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    // 28 bytes are the header and the two chunk headers.
    let total = 28 + text.len() + scene.binary.len();
    if u32::try_from(total).is_err() {
        return Err(format!("a glTF file holds at most 4 GiB, this one would have {total} bytes, write PLY instead"));
    }
    Ok((text, scene.binary))
}

/// Writes the header and both chunks.
pub(super) fn write(out: &mut dyn Write, json: &[u8], binary: &[u8]) -> std::io::Result<()> {
    let mut put = |number: usize| out.write_all(&(number as u32).to_le_bytes());
    let binary_chunk = if binary.is_empty() { 0 } else { 8 + binary.len() };
    put(0x4654_6c67)?;
    put(2)?;
    put(20 + json.len() + binary_chunk)?;
    put(json.len())?;
    put(0x4e4f_534a)?;
    out.write_all(json)?;
    if !binary.is_empty() {
        out.write_all(&(binary.len() as u32).to_le_bytes())?;
        out.write_all(&0x004e_4942u32.to_le_bytes())?;
        out.write_all(binary)?;
    }
    Ok(())
}

/// The lists of the JSON document, and the binary chunk.
#[derive(Default)]
struct Scene {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    binary: Vec<u8>,
}

impl Scene {
    /// Adds an object with its triangles.
    fn add(
        &mut self,
        export: &Export<'_>,
        object: usize,
        triangles: std::ops::Range<usize>,
        materials: &[SurfaceClass],
    ) {
        let mesh = export.mesh;
        let mut corner_of: BTreeMap<u32, u32> = BTreeMap::new();
        let mut by_class: BTreeMap<SurfaceClass, Vec<u32>> = BTreeMap::new();
        for triangle in triangles {
            let indices = by_class.entry(mesh.surface(triangle).class).or_default();
            for corner in mesh.triangles[triangle] {
                let next = corner_of.len() as u32;
                indices.push(*corner_of.entry(corner).or_insert(next));
            }
        }
        let mut positions = vec![[0.0f32; 3]; corner_of.len()];
        for (corner, index) in corner_of {
            let [x, y, z] = mesh.positions[corner as usize];
            positions[index as usize] = [x as f32, z as f32, -y as f32];
        }
        let positions = self.positions(&positions);
        let primitive = |(class, indices): (SurfaceClass, Vec<u32>)| {
            let material = materials.iter().position(|&known| known == class);
            json!({ "attributes": { "POSITION": positions }, "indices": self.indices(&indices), "material": material })
        };
        let primitives: Value = by_class.into_iter().map(primitive).collect();
        self.nodes.push(json!({ "name": export.name(object), "mesh": self.meshes.len() }));
        self.meshes.push(json!({ "primitives": primitives }));
    }

    /// Adds positions and returns the index of their accessor.
    fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let bound = |pick: fn(f32, f32) -> f32, start: f32| -> [f32; 3] {
            [0, 1, 2].map(|axis| positions.iter().fold(start, |bound, p| pick(bound, p[axis])))
        };
        let (low, high) = (bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY));
        let bytes = positions.as_flattened().iter().flat_map(|c| c.to_le_bytes());
        let view = self.view(bytes, ARRAY_BUFFER);
        self.accessors.push(json!({
            "bufferView": view, "componentType": FLOAT, "count": positions.len(), "type": "VEC3", "min": low, "max": high,
        }));
        self.accessors.len() - 1
    }

    /// Adds corners and returns the index of their accessor.
    fn indices(&mut self, indices: &[u32]) -> usize {
        let view = self.view(indices.iter().flat_map(|i| i.to_le_bytes()), ELEMENT_ARRAY_BUFFER);
        self.accessors.push(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(), "type": "SCALAR",
        }));
        self.accessors.len() - 1
    }

    /// Adds bytes and returns the index of their buffer view.
    fn view(&mut self, bytes: impl Iterator<Item = u8>, target: u32) -> usize {
        let start = self.binary.len();
        self.binary.extend(bytes);
        let length = self.binary.len() - start;
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length, "target": target }));
        self.views.len() - 1
    }
}

/// Returns the material of a class. Colours are linear RGB.
fn material(class: SurfaceClass) -> Value {
    let colour = match class {
        SurfaceClass::Roof => [0.6, 0.12, 0.08],
        SurfaceClass::Wall | SurfaceClass::Closure => [0.75, 0.72, 0.65],
        SurfaceClass::Ground | SurfaceClass::OuterFloor | SurfaceClass::OuterCeiling => [0.3, 0.24, 0.18],
        SurfaceClass::Window | SurfaceClass::Door => [0.15, 0.3, 0.5],
        _ => [0.5, 0.5, 0.5],
    };
    let [r, g, b]: [f64; 3] = colour;
    json!({
        "name": class.name(),
        "doubleSided": true,
        "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9 },
    })
}
