//! Traversal of the tree by the rays of a tile.
//!
//! Nodes are visited from near to far. Boxes outside the pyramid of the rays, and boxes behind all
//! hits, are skipped.

use crate::Bvh;
use crate::eye::Eye;
use crate::node::{Child, Node, WIDTH};
use crate::simd::{InstructionSet, Kernel, Lanes};
use crate::tile::Tile;

/// A child that is still to be visited, with a lower bound on its depth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Visit {
    child: Child,
    depth: f32,
}

/// The traversal of the tree by all rays of a tile.
pub(crate) struct TileCast<'a> {
    pub(crate) bvh: &'a Bvh,
    pub(crate) eye: &'a Eye,
    pub(crate) tile: &'a mut Tile,
    pub(crate) stack: &'a mut Vec<Visit>,
}

/// A linear function of a position in f32, with an error bound that holds over the tree.
#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: [f32; 3],
    offset: f32,
    error: f32,
}

impl Plane {
    /// Makes the function `normal · (p − centre)` for coordinates up to `extent` in size.
    fn new(normal: [f64; 3], centre: [f64; 3], extent: f64) -> Self {
        let offset = -(normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2]);
        let size = normal.iter().map(|n| n.abs()).sum::<f64>() * extent + offset.abs();
        let error = (8.0 * f64::from(f32::EPSILON) * size) as f32;
        Self { normal: normal.map(|n| n as f32), offset: offset as f32, error }
    }

    /// Returns the largest (or smallest) value in each box of a node.
    #[inline(always)]
    fn extreme<I: InstructionSet>(&self, isa: I, node: &Node, largest: bool) -> I::Lanes {
        let mut sum = isa.splat(self.offset);
        for axis in 0..3 {
            let corner = if (self.normal[axis] > 0.0) == largest { &node.high } else { &node.low };
            // Zero times the infinite box of a missing child would be NaN.
            if self.normal[axis] != 0.0 {
                sum = sum.add(isa.splat(self.normal[axis]).mul(isa.load(&corner[axis])));
            }
        }
        sum
    }
}

/// The pyramid around the rays of a tile: four sides and the depth.
struct Pyramid {
    sides: [Plane; 4],
    depth: Plane,
}

impl Pyramid {
    fn new(eye: &Eye, tile: &Tile, extent: f64) -> Self {
        let side = |axis: [f64; 3], slope: f32, sign: f64| {
            let normal = [0, 1, 2].map(|i| sign * (axis[i] - f64::from(slope) * eye.forward[i]));
            Plane::new(normal, eye.centre, extent)
        };
        Self {
            sides: [
                side(eye.right, tile.low[0], 1.0),
                side(eye.right, tile.high[0], -1.0),
                side(eye.down, tile.low[1], 1.0),
                side(eye.down, tile.high[1], -1.0),
            ],
            depth: Plane::new(eye.forward, eye.centre, extent),
        }
    }

    /// Returns the children that the pyramid may touch as a bit mask, and a lower bound on the
    /// depth of each.
    #[inline(always)]
    fn touch<I: InstructionSet>(&self, isa: I, node: &Node) -> (u32, [f32; WIDTH]) {
        let mut inside = self.depth.extreme(isa, node, true).above(isa.splat(-self.depth.error));
        for side in &self.sides {
            inside = inside.and(side.extreme(isa, node, true).above(isa.splat(-side.error)));
        }
        let mut depth = [0.0; WIDTH];
        self.depth.extreme(isa, node, false).sub(isa.splat(self.depth.error)).store(&mut depth);
        (inside.bits(), depth)
    }
}

impl Kernel for TileCast<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: InstructionSet>(self, isa: I) {
        let Self { bvh, eye, tile, stack } = self;
        let pyramid = Pyramid::new(eye, tile, bvh.extent);
        let reach = tile.reach();
        stack.clear();
        if !bvh.nodes.is_empty() {
            stack.push(Visit { child: Child::node(0), depth: 0.0 });
        }
        while let Some(Visit { child, depth }) = stack.pop() {
            // The box is behind all hits. The factor 1.00001 covers the rounding of the product.
            if depth * tile.farthest_of_all > 1.000_01 {
                continue;
            }
            if let Some(triangles) = child.triangles() {
                for number in triangles {
                    tile.meet(isa, eye, bvh, number, reach);
                }
                continue;
            }
            let node = &bvh.nodes[child.index()];
            let (mut open, depths) = pyramid.touch(isa, node);
            let first = stack.len();
            while open != 0 {
                let lane = open.trailing_zeros() as usize;
                open &= open - 1;
                insert(stack, first, Visit { child: node.children[lane], depth: depths[lane] });
            }
        }
    }
}

/// Inserts a visit into the sorted part of the stack from `first` on, where the nearest is last.
#[inline(always)]
fn insert(stack: &mut Vec<Visit>, first: usize, visit: Visit) {
    stack.push(visit);
    let mut at = stack.len() - 1;
    while at > first && stack[at - 1].depth < visit.depth {
        stack[at] = stack[at - 1];
        at -= 1;
    }
    stack[at] = visit;
}
