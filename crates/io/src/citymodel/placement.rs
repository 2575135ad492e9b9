//! Places shapes with their own coordinates in the model: CityJSON's templates and CityGML's
//! implicit geometries.

use std::collections::HashMap;

use city::ModelPoint;

use super::CityFault;
use super::builder::Builder;

/// Limit of the vertices of all instances in a file. A few kilobytes of text can ask for any number
/// of vertices.
const MAX_VERTICES: usize = 20_000_000;

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

/// Counter of the instances of a file.
#[derive(Debug, Default)]
pub(super) struct Instances {
    /// Vertices so far.
    vertices: usize,
}

impl Instances {
    /// Adds the vertices of an instance to the model, and returns their indices by their numbers in
    /// the shape.
    ///
    /// # Errors
    /// A fault at the place `at` when the instances of the file have too many vertices.
    pub(super) fn place(
        &mut self,
        builder: &mut Builder,
        placement: &Placement,
        vertices: impl ExactSizeIterator<Item = (u64, [f64; 3])>,
        at: &str,
    ) -> Result<HashMap<u64, u32>, CityFault> {
        self.vertices += vertices.len();
        if self.vertices > MAX_VERTICES {
            let what = format!("the instances of shapes have more than {MAX_VERTICES} vertices, which is the limit");
            return Err(CityFault::unsupported(what, at));
        }
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
