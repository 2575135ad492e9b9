//! The tree that rays are cast at.

use numeric::failures;

use crate::node::Node;

/// Triangles in a bounding volume hierarchy.
#[derive(Debug, Clone)]
pub struct Bvh {
    pub(crate) nodes: Vec<Node>,
    /// Corners in the order of the leaves, in f64 for the final decisions.
    pub(crate) corners: Vec<[[f64; 3]; 3]>,
    /// Index of each triangle in the input.
    pub(crate) index_of: Vec<u32>,
    /// Largest absolute coordinate, from which the error bounds of the boxes follow.
    pub(crate) extent: f64,
}

/// Triangles that no tree can be built of.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BvhError {
    /// A triangle names a position that does not exist.
    #[error("triangle {triangle} refers to position {corner}, but there are only {positions} positions")]
    Corner {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the position.
        corner: u32,
        /// Number of positions.
        positions: usize,
    },
    /// A coordinate is NaN, infinite, or too large for a box in f32.
    #[error("a corner of triangle {triangle} is not within {limit:e} m of the origin: subtract a local origin first")]
    Position {
        /// Index of the triangle.
        triangle: usize,
        /// Largest permitted coordinate, metres.
        limit: f64,
    },
    /// More triangles than the tree can index.
    #[error("found {triangles} triangles, expected at most {limit}: cut the model into tiles")]
    TooMany {
        /// Number of triangles.
        triangles: usize,
        /// Largest permitted number.
        limit: usize,
    },
}

failures!(BvhError: Input);

impl Bvh {
    /// Returns the number of triangles.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Returns whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }
}
