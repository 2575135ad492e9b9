//! Single rays of any origin and direction: the closest hit and any hit.
//!
//! Boxes are tested eight at a time in f32 with bounds of the error, triangles in f64 with the edge functions of [`Facet`].

use crate::Bvh;
use crate::eye::Eye;
use crate::node::{Child, Node, WIDTH};
use crate::setup::Facet;
use crate::simd::{Kernel, Lanes, dispatch};

/// The triangle index of a ray that meets nothing.
pub const MISS: u32 = u32::MAX;

/// A ray: positions are `origin + t · direction`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts, metres from the local origin.
    pub origin: [f64; 3],
    /// Where it goes; need not be a unit vector.
    pub direction: [f64; 3],
    /// Where it ends, in lengths of `direction`; may be infinite.
    pub end: f64,
}

/// What a ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Where, in lengths of the direction.
    pub t: f64,
    /// Index of the triangle.
    pub triangle: u32,
}

impl Bvh {
    /// The first triangle that a ray meets between its origin (exclusive) and its end.
    ///
    /// A ray with a direction of zero or with numbers that are not finite meets nothing.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let search = Search::new(self, ray, false)?;
        dispatch(search)
    }

    /// Whether a ray meets anything between its origin (exclusive) and its end.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        Search::new(self, ray, true).is_some_and(|search| dispatch(search).is_some())
    }
}

struct Search<'a> {
    bvh: &'a Bvh,
    /// The ray as the middle of an image, so that triangles are tested as everywhere else.
    eye: Eye,
    /// Length of the direction.
    length: f64,
    end: f64,
    any: bool,
    slabs: [Slab; 3],
}

/// The ray along one axis: t = (position − start) · inverse, with `pad` added outwards against rounding.
#[derive(Debug, Clone, Copy)]
struct Slab {
    start: f32,
    inverse: f32,
    pad: f32,
}

impl<'a> Search<'a> {
    fn new(bvh: &'a Bvh, ray: &Ray, any: bool) -> Option<Self> {
        let finite = ray.origin.iter().chain(&ray.direction).all(|c| c.is_finite());
        let d = ray.direction;
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        if bvh.is_empty() || !finite || !(length > 0.0 && length.is_finite()) || ray.end.is_nan() {
            return None;
        }
        let forward = d.map(|c| c / length);
        let slab = |axis: usize| {
            // A direction along a box is moved off it by less than the padding.
            let steep = if forward[axis].abs() < 1e-9 { 1e-9f64.copysign(forward[axis]) } else { forward[axis] };
            let size = ray.origin[axis].abs().max(bvh.extent);
            let pad = (4.0 * f64::from(f32::EPSILON) + 3e-9) * size.max(1.0);
            Slab { start: ray.origin[axis] as f32, inverse: (1.0 / steep) as f32, pad: pad as f32 }
        };
        Some(Self {
            bvh,
            eye: frame(ray.origin, forward),
            length,
            end: ray.end * length,
            any,
            slabs: [slab(0), slab(1), slab(2)],
        })
    }

    /// The children whose boxes the ray meets before `end`, and where it enters them (metres).
    #[inline(always)]
    fn touch<V: Lanes>(&self, node: &Node, end: f32) -> (u32, [f32; WIDTH]) {
        let (mut enter, mut leave) = (V::splat(0.0), V::splat(end));
        for (axis, slab) in self.slabs.iter().enumerate() {
            let (near, far, pad) = if slab.inverse > 0.0 {
                (&node.low[axis], &node.high[axis], slab.pad)
            } else {
                (&node.high[axis], &node.low[axis], -slab.pad)
            };
            let at = |corner: &[f32; WIDTH], pad: f32| {
                V::load(corner).sub(V::splat(slab.start)).add(V::splat(pad)).mul(V::splat(slab.inverse))
            };
            enter = enter.max(at(near, -pad));
            leave = leave.min(at(far, pad));
        }
        // Both are off by a few roundings of the quotient.
        let (enter, leave) = (enter.mul(V::splat(0.999_998)), leave.mul(V::splat(1.000_002)));
        let mut depths = [0.0; WIDTH];
        enter.store(&mut depths);
        (leave.above(enter).bits() | leave_equal(enter, leave), depths)
    }
}

/// Lanes where a box is entered and left at once, as a flat box may be.
#[inline(always)]
fn leave_equal<V: Lanes>(enter: V, leave: V) -> u32 {
    // Neither is above the other; a missing child is entered at infinity and left at minus infinity.
    !(enter.above(leave).bits() | leave.above(enter).bits()) & 0xff
}

/// A frame whose forward axis is the ray.
fn frame(centre: [f64; 3], forward: [f64; 3]) -> Eye {
    let least = (0..3).min_by(|&a, &b| forward[a].abs().total_cmp(&forward[b].abs())).unwrap_or(0);
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    let right = cross(axis, forward);
    let norm = (right[0] * right[0] + right[1] * right[1] + right[2] * right[2]).sqrt();
    let right = right.map(|c| c / norm);
    Eye { centre, right, down: cross(forward, right), forward }
}

impl Kernel for Search<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<V: Lanes>(self) -> Option<Hit> {
        // (inverse depth, index): a larger inverse is nearer.
        let mut best: Option<(f64, u32)> = None;
        let mut end = self.end;
        let mut stack: Vec<(Child, f32)> = Vec::with_capacity(64);
        stack.push((Child::node(0), 0.0));
        while let Some((child, enter)) = stack.pop() {
            if f64::from(enter) > end {
                continue;
            }
            let Some(triangles) = child.triangles() else {
                let node = &self.bvh.nodes[child.index()];
                let (mut open, depths) = self.touch::<V>(node, round_up(end));
                let first = stack.len();
                while open != 0 {
                    let lane = open.trailing_zeros() as usize;
                    open &= open - 1;
                    stack.push((node.children[lane], depths[lane]));
                }
                stack[first..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
                continue;
            };
            for number in triangles {
                let met = Facet::new(&self.eye, &self.bvh.corners[number]).and_then(|facet| facet.meets(0.0, 0.0));
                let Some(inverse) = met.filter(|inverse| 1.0 / inverse < self.end) else { continue };
                let index = self.bvh.index_of[number];
                if best.is_none_or(|(i, known)| inverse > i || (inverse == i && index < known)) {
                    best = Some((inverse, index));
                    end = 1.0 / inverse;
                }
                if self.any {
                    break;
                }
            }
            if self.any && best.is_some() {
                break;
            }
        }
        best.map(|(inverse, triangle)| Hit { t: 1.0 / inverse / self.length, triangle })
    }
}

fn round_up(value: f64) -> f32 {
    (value as f32).next_up()
}
