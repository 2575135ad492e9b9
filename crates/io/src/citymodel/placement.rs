//! Shapes with coordinates of their own, placed in the model: CityJSON's geometry templates and CityGML's implicit geometries.

use std::collections::HashMap;

use city::ModelPoint;

use super::CityFault;
use super::builder::Builder;

/// Vertices that the instances of a file may make: a few kilobytes of text can ask for as many as they like.
const MAX_VERTICES: usize = 20_000_000;

/// Where a shape is placed: a 4 × 4 matrix (row by row) applied to its coordinates, then a shift to a point of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    pub(super) matrix: [f64; 16],
    pub(super) origin: ModelPoint,
}

impl Placement {
    fn of(&self, [x, y, z]: [f64; 3]) -> ModelPoint {
        let row = |i: usize| {
            let m = &self.matrix[4 * i..4 * i + 4];
            m[0] * x + m[1] * y + m[2] * z + m[3]
        };
        ModelPoint::new(self.origin.x + row(0), self.origin.y + row(1), self.origin.z + row(2))
    }
}

/// The instances of a file, counted.
#[derive(Debug, Default)]
pub(super) struct Instances {
    vertices: usize,
}

impl Instances {
    /// Adds the vertices of an instance to the model; the index of each by the number it has in its shape.
    ///
    /// # Errors
    /// More vertices than the instances of a file may have; `at` is the place that is named then.
    pub(super) fn place(
        &mut self,
        builder: &mut Builder,
        placement: &Placement,
        vertices: impl ExactSizeIterator<Item = (u64, [f64; 3])>,
        at: &str,
    ) -> Result<HashMap<u64, u32>, CityFault> {
        self.vertices += vertices.len();
        if self.vertices > MAX_VERTICES {
            let what = format!("the instances of shapes have more than {MAX_VERTICES} vertices");
            return Err(CityFault::unsupported(what, at));
        }
        let mut index_of = HashMap::with_capacity(vertices.len());
        for (number, position) in vertices {
            let vertex = builder.vertex(placement.of(position));
            index_of.insert(number, vertex.ok_or_else(|| CityFault::unsupported("more than 2^32 vertices", at))?);
        }
        Ok(index_of)
    }
}
