//! Ray casting on triangles: which triangle a ray meets first, and whether it meets any.
//!
//! Positions are f64 metres from a local origin. The results are the same as if every triangle were
//! tested in f64. Vectorised f32 arithmetic decides only what its error bounds make certain, and
//! f64 decides the rest. No ray slips through an edge that two triangles share. Results do not
//! depend on the number of threads, the instruction set or the order of the rays. Of several
//! triangles at the same distance the one with the lowest index is hit.
//!
//! - [`Bvh::cast_image`] casts the rays of an image through one centre of projection.
//! - [`Bvh::occluded`] tests which of many points are hidden from one centre of projection.
//! - [`Bvh::closest_hit`] and [`Bvh::any_hit`] cast single rays of any origin.
//! - [`Bvh::nearest`] finds the point of the triangles that is nearest to a position.
//!
//! ```
//! use bvh::{Bvh, Ray};
//!
//! let square = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 1.0, 5.0], [0.0, 1.0, 5.0]];
//! let tree = Bvh::new(&square, &[[0, 1, 2], [0, 2, 3]])?;
//! let down = Ray { origin: [0.7, 0.2, 9.0], direction: [0.0, 0.0, -1.0], end: f64::INFINITY };
//! let hit = tree.closest_hit(&down).expect("the ray goes through the square");
//! assert_eq!((hit.t, hit.triangle), (4.0, 0));
//! # Ok::<(), bvh::BvhError>(())
//! ```

mod build;
mod eye;
mod nearest;
mod node;
mod ray;
mod setup;
mod simd;
mod tile;
mod traverse;
mod tree;
mod view;

pub use eye::{Eye, Target};
pub use nearest::NearestPoint;
pub use ray::{Hit, MISS, Ray};
pub use tree::{Bvh, BvhError};
pub use view::DepthImage;
