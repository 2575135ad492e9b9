//! Building of the tree by the binned surface-area heuristic, from the top (Wald 2007).
//!
//! Nodes first have two children and are then opened up to eight.
//!
//! Boxes are f32, rounded outwards from f64. The tree depends on the triangles alone and not on the
//! number of threads.

use crate::node::{Child, LEAF_SIZE, MAX_TRIANGLES, Node, WIDTH};
use crate::tree::{Bvh, BvhError};

const BINS: usize = 16;
/// From this depth on nodes are split into equal counts, so that no input makes the tree deep.
const MAX_DEPTH: usize = 48;
/// Ranges of fewer triangles than this are built on one thread.
const PARALLEL_FROM: usize = 4096;

/// Largest permitted size of a coordinate, metres.
const EXTENT_LIMIT: f64 = 1e9;

impl Bvh {
    /// Builds the tree. `positions` are metres from a local origin, and `triangles` holds indices
    /// into them.
    ///
    /// # Errors
    /// An index out of range, a position that is not finite or beyond 10⁹ m, or more than 2²⁷
    /// triangles.
    pub fn new(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self, BvhError> {
        if triangles.len() > MAX_TRIANGLES {
            return Err(BvhError::TooMany { triangles: triangles.len(), limit: MAX_TRIANGLES });
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
}

#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: [f32; 3],
    high: [f32; 3],
}

#[derive(Debug, Clone, Copy)]
struct Item {
    bounds: Bounds,
    triangle: u32,
}

/// A binary tree.
#[derive(Debug)]
struct Tree {
    bounds: Bounds,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Leaf { start: usize, count: usize },
    Pair(Box<[Tree; 2]>),
}

impl Bounds {
    const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// Returns the box of a triangle, rounded outwards.
    fn of(corners: &[[f64; 3]; 3]) -> Self {
        let bound =
            |axis: usize, pick: fn(f64, f64) -> f64| pick(pick(corners[0][axis], corners[1][axis]), corners[2][axis]);
        Self {
            low: [0, 1, 2].map(|axis| round_down(bound(axis, f64::min))),
            high: [0, 1, 2].map(|axis| -round_down(-bound(axis, f64::max))),
        }
    }

    fn union(self, other: Self) -> Self {
        Self {
            low: [0, 1, 2].map(|i| self.low[i].min(other.low[i])),
            high: [0, 1, 2].map(|i| self.high[i].max(other.high[i])),
        }
    }

    /// Returns half the surface of the box.
    fn area(self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|i| (self.high[i] - self.low[i]).max(0.0));
        x * y + y * z + z * x
    }

    /// Returns twice the centre of the box.
    fn centre(&self, axis: usize) -> f32 {
        self.low[axis] + self.high[axis]
    }
}

fn round_down(value: f64) -> f32 {
    let near = value as f32;
    if f64::from(near) > value { near.next_down() } else { near }
}

/// Builds the tree over the corners of the triangles.
fn build(corners: &[[[f64; 3]; 3]]) -> Bvh {
    let item = |(i, corners): (usize, &[[f64; 3]; 3])| Item { bounds: Bounds::of(corners), triangle: i as u32 };
    let mut items: Vec<Item> = corners.iter().enumerate().map(item).collect();
    let mut nodes = Vec::new();
    if !items.is_empty() {
        let tree = split(&mut items, 0, 0);
        flatten(&tree, &mut nodes);
    }
    let index_of: Vec<u32> = items.iter().map(|item| item.triangle).collect();
    let extent = corners.as_flattened().as_flattened().iter().fold(0.0, |most: f64, c| most.max(c.abs()));
    Bvh { nodes, corners: index_of.iter().map(|&i| corners[i as usize]).collect(), index_of, extent }
}

fn split(items: &mut [Item], start: usize, depth: usize) -> Tree {
    let bounds = items.iter().fold(Bounds::EMPTY, |b, item| b.union(item.bounds));
    let count = items.len();
    if count <= LEAF_SIZE {
        return Tree { bounds, kind: Kind::Leaf { start, count } };
    }
    let middle = if depth < MAX_DEPTH { partition(items) } else { None };
    let middle = middle.unwrap_or_else(|| halve(items, &bounds));
    let (left, right) = items.split_at_mut(middle);
    let mut build_left = || split(left, start, depth + 1);
    let mut build_right = || split(right, start + middle, depth + 1);
    let (left, right) =
        if count >= PARALLEL_FROM { rayon::join(build_left, build_right) } else { (build_left(), build_right()) };
    Tree { bounds, kind: Kind::Pair(Box::new([left, right])) }
}

/// Splits into two equal counts along the longest axis.
fn halve(items: &mut [Item], bounds: &Bounds) -> usize {
    let length = |axis: &usize| bounds.high[*axis] - bounds.low[*axis];
    let axis = (0..3).max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(0);
    let middle = items.len() / 2;
    let key = |item: &Item| item.bounds.centre(axis);
    items.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.triangle.cmp(&b.triangle)));
    middle
}

/// Splits where the surface-area heuristic is lowest over all bins of all axes. Returns `None`
/// where all centres coincide.
fn partition(items: &mut [Item]) -> Option<usize> {
    let (mut best_cost, mut best) = (f32::INFINITY, None);
    for axis in 0..3 {
        let centres = items.iter().map(|item| item.bounds.centre(axis));
        let (low, high) = centres.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), c| (l.min(c), h.max(c)));
        let bins = Binning { axis, low, scale: BINS as f32 / (high - low) };
        if !(high > low && bins.scale.is_finite()) {
            continue;
        }
        let (cost, at) = bins.cheapest(items);
        if cost < best_cost {
            (best_cost, best) = (cost, Some((bins, at)));
        }
    }
    let (bins, at) = best?;
    // A stable partition keeps the order of the input, so that the tree depends on the input alone.
    let (left, right): (Vec<Item>, Vec<Item>) = items.iter().partition(|item| bins.bin(item) < at);
    items[..left.len()].copy_from_slice(&left);
    items[left.len()..].copy_from_slice(&right);
    (!left.is_empty() && !right.is_empty()).then_some(left.len())
}

#[derive(Debug, Clone, Copy)]
struct Binning {
    axis: usize,
    low: f32,
    scale: f32,
}

impl Binning {
    fn bin(&self, item: &Item) -> usize {
        (((item.bounds.centre(self.axis) - self.low) * self.scale) as usize).min(BINS - 1)
    }

    /// Returns the lowest cost and the first bin of the right side.
    fn cheapest(&self, items: &[Item]) -> (f32, usize) {
        let mut bins = [(Bounds::EMPTY, 0u32); BINS];
        for item in items {
            let (bounds, count) = &mut bins[self.bin(item)];
            *bounds = bounds.union(item.bounds);
            *count += 1;
        }
        let mut right_cost = [0.0f32; BINS];
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for i in (1..BINS).rev() {
            bounds = bounds.union(bins[i].0);
            count += bins[i].1;
            right_cost[i] = if count == 0 { f32::INFINITY } else { bounds.area() * count as f32 };
        }
        (bounds, count) = (Bounds::EMPTY, 0);
        let mut best = (f32::INFINITY, 1);
        for i in 1..BINS {
            bounds = bounds.union(bins[i - 1].0);
            count += bins[i - 1].1;
            if count > 0 {
                let cost = bounds.area() * count as f32 + right_cost[i];
                best = if cost < best.0 { (cost, i) } else { best };
            }
        }
        best
    }
}

/// Writes the node of `tree` and the nodes below it. Returns the index of the node.
fn flatten(tree: &Tree, nodes: &mut Vec<Node>) -> usize {
    let mut open: Vec<&Tree> = match &tree.kind {
        Kind::Leaf { .. } => vec![tree],
        Kind::Pair(pair) => pair.iter().collect(),
    };
    while open.len() < WIDTH {
        let pairs = open.iter().enumerate().filter(|(_, t)| matches!(t.kind, Kind::Pair(_)));
        let largest = pairs.max_by(|a, b| a.1.bounds.area().total_cmp(&b.1.bounds.area())).map(|(i, _)| i);
        let Some(largest) = largest else { break };
        if let Kind::Pair(pair) = &open.swap_remove(largest).kind {
            open.extend(pair.iter());
        }
    }
    let index = nodes.len();
    nodes.push(Node::empty());
    for (slot, below) in open.into_iter().enumerate() {
        let child = match below.kind {
            Kind::Leaf { start, count } => Child::leaf(start, count),
            Kind::Pair(_) => Child::node(flatten(below, nodes)),
        };
        let node = &mut nodes[index];
        node.children[slot] = child;
        for axis in 0..3 {
            node.low[axis][slot] = below.bounds.low[axis];
            node.high[axis][slot] = below.bounds.high[axis];
        }
    }
    index
}
