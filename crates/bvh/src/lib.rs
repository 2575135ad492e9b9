//! Ray casting on triangles: which triangle a ray meets first, and whether it meets any.
//!
//! Positions are f64 metres from a local origin. The result is that of testing every triangle in f64: vectorised f32
//! arithmetic only sorts out what is certain within its error bounds, and f64 decides the rest. Edges that triangles
//! share let no ray through. Results do not depend on the number of threads, on the instruction set or on the order
//! of the rays; of triangles at the same distance the one with the lowest index is hit.
//!
//! - [`Bvh::cast_image`] casts the rays of an image through one centre, [`Bvh::occluded`] those to many points.
//! - [`Bvh::closest_hit`] and [`Bvh::any_hit`] take single rays of any origin.

mod build;
mod eye;
mod node;
mod ray;
mod setup;
mod simd;
mod tile;
mod traverse;
mod view;

use build::build;
use node::Node;

pub use eye::{Eye, Target};
pub use ray::{Hit, Ray};
pub use view::{DepthImage, MISS};

/// Triangles arranged for ray casting.
#[derive(Debug, Clone)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Corners in the order of the leaves, f64: the decisions of last resort are made on them.
    corners: Vec<[[f64; 3]; 3]>,
    /// Index of each triangle as it was given.
    index_of: Vec<u32>,
    /// Largest absolute coordinate, for the error bounds of the boxes.
    extent: f64,
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

/// Positions must be this close to the origin, metres.
const EXTENT_LIMIT: f64 = 1e9;

impl Bvh {
    /// Arranges triangles; `positions` are metres from a local origin, `triangles` indices into them.
    ///
    /// # Errors
    /// An index out of range, a position that is not finite or beyond 10⁹ m, or more than 2²⁷ triangles.
    pub fn new(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self, BvhError> {
        if triangles.len() > node::MAX_TRIANGLES {
            return Err(BvhError::TooMany { triangles: triangles.len(), limit: node::MAX_TRIANGLES });
        }
        let mut corners = Vec::with_capacity(triangles.len());
        for (number, triangle) in triangles.iter().enumerate() {
            let mut found = [[0.0; 3]; 3];
            for (at, &corner) in found.iter_mut().zip(triangle) {
                let missing = BvhError::Corner { triangle: number, corner, positions: positions.len() };
                *at = *positions.get(corner as usize).ok_or(missing)?;
            }
            if !found.as_flattened().iter().all(|c| c.abs() <= EXTENT_LIMIT) {
                return Err(BvhError::Position { triangle: number, limit: EXTENT_LIMIT });
            }
            corners.push(found);
        }
        Ok(build(&corners))
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }
}
