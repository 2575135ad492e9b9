//! Binary glTF 2.0 (GLB): the buffers of a document, and the file.

use std::io::Write;

use serde_json::{Value, json};

const FLOAT: u32 = 5126;
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The accessors of a document and the binary chunk behind them.
#[derive(Debug, Default)]
pub struct GlbBuffers {
    accessors: Vec<Value>,
    views: Vec<Value>,
    binary: Vec<u8>,
}

impl GlbBuffers {
    /// Adds positions and returns the index of their accessor.
    pub fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let bound = |pick: fn(f32, f32) -> f32, start: f32| -> [f32; 3] {
            [0, 1, 2].map(|axis| positions.iter().fold(start, |bound, p| pick(bound, p[axis])))
        };
        let (low, high) = (bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY));
        let bytes = positions.as_flattened().iter().flat_map(|c| c.to_le_bytes());
        let view = self.view(bytes, Some(ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": positions.len(), "type": "VEC3",
            "min": low, "max": high,
        }))
    }

    /// Adds positions in a texture and returns the index of their accessor.
    pub fn texture_positions(&mut self, positions: &[[f32; 2]]) -> usize {
        let bytes = positions.as_flattened().iter().flat_map(|c| c.to_le_bytes());
        let view = self.view(bytes, Some(ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": positions.len(), "type": "VEC2",
        }))
    }

    /// Adds linear colours, 0 to 1, and returns the index of their accessor.
    pub fn colours(&mut self, colours: &[[f32; 3]]) -> usize {
        let bytes = colours.as_flattened().iter().flat_map(|c| c.to_le_bytes());
        let view = self.view(bytes, Some(ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": colours.len(), "type": "VEC3",
        }))
    }

    /// Adds colours with opacities as bytes, four of each, and returns the index of their accessor.
    pub fn byte_colours(&mut self, bytes: Vec<u8>) -> usize {
        let count = bytes.len() / 4;
        let view = self.view(bytes.into_iter(), Some(ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED_BYTE, "normalized": true, "count": count, "type": "VEC4",
        }))
    }

    /// Adds `count` scalars or vectors, such as `VEC4`, and returns the index of their accessor.
    pub fn numbers(&mut self, kind: &'static str, count: usize, numbers: &[f32]) -> usize {
        let view = self.view(numbers.iter().flat_map(|n| n.to_le_bytes()), Some(ARRAY_BUFFER));
        self.accessor(json!({ "bufferView": view, "componentType": FLOAT, "count": count, "type": kind }))
    }

    /// Adds corners and returns the index of their accessor.
    pub fn indices(&mut self, indices: &[u32]) -> usize {
        let view = self.view(indices.iter().flat_map(|i| i.to_le_bytes()), Some(ELEMENT_ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(), "type": "SCALAR",
        }))
    }

    /// Adds the bytes of a picture and returns the index of their buffer view.
    pub fn picture(&mut self, bytes: Vec<u8>) -> usize {
        self.view(bytes.into_iter(), None)
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds bytes and returns the index of their buffer view.
    fn view(&mut self, bytes: impl Iterator<Item = u8>, target: Option<u32>) -> usize {
        let start = self.binary.len();
        self.binary.extend(bytes);
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": self.binary.len() - start });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.views.push(view);
        // Numbers lie on multiples of four bytes.
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }
}

/// The two chunks of a GLB file.
#[derive(Debug)]
pub struct Glb {
    json: Vec<u8>,
    binary: Vec<u8>,
}

impl Glb {
    /// Puts a document without buffers and its buffers together.
    ///
    /// # Errors
    /// A text for a file that is too large for the format.
    pub fn new(mut document: Value, buffers: GlbBuffers) -> Result<Self, String> {
        // glTF does not allow empty lists.
        if !buffers.accessors.is_empty() {
            document["accessors"] = Value::Array(buffers.accessors);
            document["bufferViews"] = Value::Array(buffers.views);
            document["buffers"] = json!([{ "byteLength": buffers.binary.len() }]);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        // 28 bytes are the header and the two chunk headers.
        let total = 28 + text.len() + buffers.binary.len();
        if u32::try_from(total).is_err() {
            return Err(format!("a glTF file holds at most 4 GiB, this one would have {total} bytes"));
        }
        Ok(Self { json: text, binary: buffers.binary })
    }

    /// Writes the header and both chunks.
    ///
    /// # Errors
    /// The error of the writer.
    pub fn write(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let Self { json, binary } = self;
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
}
