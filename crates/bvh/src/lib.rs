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
mod tree;
mod view;

pub use eye::{Eye, Target};
pub use ray::{Hit, MISS, Ray};
pub use tree::{Bvh, BvhError};
pub use view::DepthImage;
