//! Single rays of any origin and direction: the closest hit and any hit.
//!
//! Boxes are tested eight at a time in f32 with error bounds. Triangles are tested in f64 with the
//! edge functions of [`Facet`].

use crate::Bvh;
use crate::eye::Eye;
use crate::node::{Child, Node, WIDTH};
use crate::setup::Facet;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// The triangle index of a ray that meets nothing.
pub const MISS: u32 = u32::MAX;

/// A ray with the positions `origin + t · direction`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Start, metres from the local origin.
    pub origin: [f64; 3],
    /// Direction, of any length but zero.
    pub direction: [f64; 3],
    /// Largest t, in lengths of `direction`; may be infinite.
    pub end: f64,
}

/// The closest triangle on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Parameter of the position, in lengths of the direction.
    pub t: f64,
    /// Index of the triangle.
    pub triangle: u32,
}

impl Bvh {
    /// Returns the first triangle that a ray meets between its origin (exclusive) and its end.
    ///
    /// A ray meets nothing if its direction is zero or if a number is not finite.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let search = Search::new(self, ray, false)?;
        dispatch(search)
    }

    /// Returns whether a ray meets a triangle between its origin (exclusive) and its end.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        Search::new(self, ray, true).is_some_and(|search| dispatch(search).is_some())
    }
}

struct Search<'a> {
    bvh: &'a Bvh,
    /// Frame whose forward axis is the ray, so that triangles are tested as they are for images.
    eye: Eye,
    /// Length of the direction.
    length: f64,
    end: f64,
    any: bool,
    slabs: [Slab; 3],
}

/// The ray along one axis: t = (position − start) · inverse. `pad` widens boxes outwards against
/// rounding.
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
            // A ray parallel to a face of the box gets a tiny slope, whose effect is smaller than
            // the padding.
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

    /// Returns the children whose boxes the ray meets before `end` as a bit mask, and where it
    /// enters each, metres.
    #[inline(always)]
    fn touch<I: InstructionSet>(&self, isa: I, node: &Node, end: f32) -> (u32, [f32; WIDTH]) {
        let (mut enter, mut leave) = (isa.splat(0.0), isa.splat(end));
        for (axis, slab) in self.slabs.iter().enumerate() {
            let (near, far, pad) = if slab.inverse > 0.0 {
                (&node.low[axis], &node.high[axis], slab.pad)
            } else {
                (&node.high[axis], &node.low[axis], -slab.pad)
            };
            let at = |corner: &[f32; WIDTH], pad: f32| {
                isa.load(corner).sub(isa.splat(slab.start)).add(isa.splat(pad)).mul(isa.splat(slab.inverse))
            };
            enter = enter.max(at(near, -pad));
            leave = leave.min(at(far, pad));
        }
        // The factors cover a few roundings of the quotient.
        let (enter, leave) = (enter.mul(isa.splat(0.999_998)), leave.mul(isa.splat(1.000_002)));
        let mut depths = [0.0; WIDTH];
        enter.store(&mut depths);
        (leave.above(enter).bits() | leave_equal(enter, leave), depths)
    }
}

/// Returns the lanes in which a box is entered and left at the same t, as happens with flat boxes.
#[inline(always)]
fn leave_equal<L: Lanes>(enter: L, leave: L) -> u32 {
    // Equal values are not above each other. A missing child is entered at +∞ and left at −∞.
    !(enter.above(leave).bits() | leave.above(enter).bits()) & 0xff
}

/// Makes a frame whose forward axis is the ray.
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
    fn run<I: InstructionSet>(self, isa: I) -> Option<Hit> {
        // The best hit so far as (inverse depth, index). A larger inverse depth is nearer.
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
                let (mut open, depths) = self.touch(isa, node, round_up(end));
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
