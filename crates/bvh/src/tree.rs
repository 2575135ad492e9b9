//! The tree that rays are cast at.

use crate::node::Node;

/// Triangles arranged for ray casting.
#[derive(Debug, Clone)]
pub struct Bvh {
    pub(crate) nodes: Vec<Node>,
    /// Corners in the order of the leaves, f64: the decisions of last resort are made on them.
    pub(crate) corners: Vec<[[f64; 3]; 3]>,
    /// Index of each triangle as it was given.
    pub(crate) index_of: Vec<u32>,
    /// Largest absolute coordinate, for the error bounds of the boxes.
    pub(crate) extent: f64,
}

/// Triangles that rays cannot be cast at.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BvhError {
    /// A triangle names a corner that is not there.
    #[error("triangle {triangle} names corner {corner}, and there are {positions}")]
    Corner {
        /// Index of the triangle.
        triangle: usize,
        /// The corner.
        corner: u32,
        /// How many positions there are.
        positions: usize,
    },
    /// A corner at NaN, at infinity, or too far away for its box in f32.
    #[error("a corner of triangle {triangle} is not within {limit:e} m of the origin: choose a local origin")]
    Position {
        /// Index of the triangle.
        triangle: usize,
        /// The largest distance.
        limit: f64,
    },
    /// More triangles than indices.
    #[error("{triangles} triangles, at most {limit} can be searched: cut the model into tiles")]
    TooMany {
        /// How many there are.
        triangles: usize,
        /// The limit.
        limit: usize,
    },
}

impl Bvh {
    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }
}
