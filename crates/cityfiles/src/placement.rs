//! Places shapes with their own coordinates in the model: CityJSON's templates and CityGML's
//! implicit geometries.

use std::collections::HashMap;

use city::ModelPoint;
use serde_json::{Map, Value};

use super::CityFault;
use super::builder::Builder;

/// Limit of the size of what references in a file repeat: a few kilobytes of text can ask for any
/// number of surfaces. The unit is about four bytes of memory.
const EXPANDED_MAX: usize = 40_000_000;
/// Size of a surface without its rings, of a ring without its vertices, and of a vertex.
const SURFACE_SIZE: usize = 16;
const RING_SIZE: usize = 8;
const VERTEX_SIZE: usize = 8;
/// Size of a value of an attribute without its text.
const VALUE_SIZE: usize = 8;

/// Placement of a shape: a 4 × 4 matrix in row order, then a shift by a point of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    pub(super) matrix: [f64; 16],
    pub(super) origin: ModelPoint,
}

impl Placement {
    /// Returns the place of a point of the shape.
    fn of(&self, [x, y, z]: [f64; 3]) -> ModelPoint {
        let row = |i: usize| {
            let m = &self.matrix[4 * i..4 * i + 4];
            m[0] * x + m[1] * y + m[2] * z + m[3]
        };
        ModelPoint::new(self.origin.x + row(0), self.origin.y + row(1), self.origin.z + row(2))
    }
}

/// Size of what the references of a file have repeated so far.
#[derive(Debug, Default)]
pub(super) struct Expansion {
    size: usize,
}

/// Returns the size of a surface with `rings` rings of `corners` corners in all.
pub(super) fn surface_size(rings: usize, corners: usize) -> usize {
    SURFACE_SIZE + rings.saturating_mul(RING_SIZE).saturating_add(corners)
}

/// Returns the size of the attributes of a surface. Each description of a surface that is written
/// repeats them.
pub(super) fn attributes_size(attributes: &Map<String, Value>) -> usize {
    let member = |(name, value): (&String, &Value)| (name.len() / 4).saturating_add(value_size(value));
    attributes.iter().map(member).fold(VALUE_SIZE, usize::saturating_add)
}

fn value_size(value: &Value) -> usize {
    match value {
        Value::Object(members) => attributes_size(members),
        Value::Array(list) => list.iter().map(value_size).fold(VALUE_SIZE, usize::saturating_add),
        Value::String(text) => VALUE_SIZE + text.len() / 4,
        _ => VALUE_SIZE,
    }
}

impl Expansion {
    /// Counts the size of what is repeated next, before it is made. A file may repeat `own`, the
    /// size of what it holds itself, any number of times up to the limit, and once in any case.
    ///
    /// # Errors
    /// A fault at the place `at` when the file repeats too much.
    pub(super) fn add(&mut self, size: usize, own: usize, at: &str) -> Result<(), CityFault> {
        self.size = self.size.saturating_add(size);
        if self.size > own.saturating_add(EXPANDED_MAX) {
            let what = "the shapes that the file repeats by reference do not fit the memory, cut it into tiles";
            return Err(CityFault::unsupported(what, at));
        }
        Ok(())
    }
}

/// Placed shapes of a file.
#[derive(Debug, Default)]
pub(super) struct Instances {
    pub(super) expansion: Expansion,
}

impl Instances {
    /// Adds the vertices of an instance to the model, and returns their indices by their numbers in
    /// the shape.
    ///
    /// # Errors
    /// A fault at the place `at` when the instances of the file are too large.
    pub(super) fn place(
        &mut self,
        builder: &mut Builder,
        placement: &Placement,
        vertices: impl ExactSizeIterator<Item = (u64, [f64; 3])>,
        at: &str,
    ) -> Result<HashMap<u64, u32>, CityFault> {
        self.expansion.add(vertices.len().saturating_mul(VERTEX_SIZE), 0, at)?;
        let mut index_of = HashMap::with_capacity(vertices.len());
        for (number, position) in vertices {
            let vertex = builder.vertex(placement.of(position));
            index_of.insert(
                number,
                vertex.ok_or_else(|| {
                    CityFault::unsupported("the model has more than 2^32 vertices, cut it into tiles", at)
                })?,
            );
        }
        Ok(index_of)
    }
}
