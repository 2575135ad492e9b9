//! Writes glTF 2.0 as one binary file: a node and a mesh per city object, a primitive and a colour
//! per class.
//!
//! The y axis of glTF points up: (x, y, z) of the model becomes (x, z, −y). Positions are f32
//! metres from the origin, which the extras of the asset hold together with the reference system.
//! The triangles of an object share their corners. Faces have no normals, so that viewers shade
//! them flat.

use std::collections::BTreeMap;

use city::SurfaceClass;
use serde_json::{Value, json};

use super::source::Export;
use formats::gltf::{Glb, GlbBuffers};

/// Returns the file, or a text for one that is too large.
pub(super) fn encode(export: &Export<'_>) -> Result<Glb, String> {
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
    }
    Glb::new(document, scene.buffers).map_err(|reason| format!("{reason}, write PLY instead"))
}

/// The lists of the JSON document, and its buffers.
#[derive(Default)]
struct Scene {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    buffers: GlbBuffers,
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
        let positions = self.buffers.positions(&positions);
        let primitive = |(class, indices): (SurfaceClass, Vec<u32>)| {
            let material = materials.iter().position(|&known| known == class);
            let indices = self.buffers.indices(&indices);
            json!({ "attributes": { "POSITION": positions }, "indices": indices, "material": material })
        };
        let primitives: Value = by_class.into_iter().map(primitive).collect();
        self.nodes.push(json!({ "name": export.name(object), "mesh": self.meshes.len() }));
        self.meshes.push(json!({ "primitives": primitives }));
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
