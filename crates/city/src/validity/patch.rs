//! A closed surface as triangles. A point is inside, outside or on it by its winding number
//! (Jacobson et al. 2013) and its distance.

use crate::SurfacePolygon;
use crate::triangulate::triangulate;
use numeric::vector::{Vector, cross, dot, norm, sub};

/// Triangles of a closed surface.
pub(super) struct Patch {
    /// Corners of the triangles, metres.
    pub(super) corners: Vec<[Vector; 3]>,
    /// Vertices of the triangles in the model; equal indices have equal places.
    pub(super) vertices: Vec<[u32; 3]>,
    /// Polygon that each triangle belongs to.
    pub(super) polygon: Vec<u32>,
    /// Bounding box of all corners.
    pub(super) bounds: Bounds,
}

/// Axis-aligned bounding box, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: Vector,
    pub(super) high: Vector,
}

/// Side of a closed surface that a point is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Inside,
    Outside,
    On,
}

impl Bounds {
    pub(super) fn of(points: impl IntoIterator<Item = Vector>) -> Self {
        let empty = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };
        points.into_iter().fold(empty, |bounds, p| Self {
            low: [0, 1, 2].map(|i| bounds.low[i].min(p[i])),
            high: [0, 1, 2].map(|i| bounds.high[i].max(p[i])),
        })
    }

    /// Returns whether two boxes are nearer than `by` along every axis.
    pub(super) fn meets(&self, other: &Self, by: f64) -> bool {
        (0..3).all(|i| self.low[i] <= other.high[i] + by && other.low[i] <= self.high[i] + by)
    }
}

impl Patch {
    /// Cuts polygons into triangles and turns those with `turn`. Returns `None` when edges of a
    /// polygon cross.
    pub(super) fn new(surfaces: &[&SurfacePolygon], turn: &[bool], position: &impl Fn(u32) -> Vector) -> Option<Self> {
        let (mut vertices, mut polygon) = (Vec::new(), Vec::new());
        for (number, (surface, &turn)) in surfaces.iter().zip(turn).enumerate() {
            let cut = triangulate(&surface.rings, position);
            if !cut.added.is_empty() {
                return None;
            }
            for [a, b, c] in cut.triangles {
                vertices.push(if turn { [a, c, b] } else { [a, b, c] });
                polygon.push(number as u32);
            }
        }
        let corners: Vec<[Vector; 3]> = vertices.iter().map(|t| t.map(position)).collect();
        let bounds = Bounds::of(corners.iter().flatten().copied());
        Some(Self { corners, vertices, polygon, bounds })
    }

    /// Joins the shells of one solid.
    pub(super) fn joined(shells: Vec<Self>) -> Self {
        let bounds = Bounds::of(shells.iter().flat_map(|shell| [shell.bounds.low, shell.bounds.high]));
        let mut all = Self { corners: Vec::new(), vertices: Vec::new(), polygon: Vec::new(), bounds };
        for shell in shells {
            let first = all.polygon.iter().max().map_or(0, |&last| last + 1);
            all.corners.extend(shell.corners);
            all.vertices.extend(shell.vertices);
            all.polygon.extend(shell.polygon.into_iter().map(|polygon| first + polygon));
        }
        all
    }

    /// Returns the side that a point is on. A point nearer than `tolerance_m` is on the surface.
    ///
    /// The orientation of a single shell does not matter.
    pub(super) fn side(&self, point: Vector, tolerance_m: f64) -> Side {
        let here = Bounds { low: point, high: point };
        if !self.bounds.meets(&here, tolerance_m) {
            return Side::Outside;
        }
        let near = |t: &[Vector; 3]| Bounds::of(*t).meets(&here, tolerance_m) && distance(point, t) <= tolerance_m;
        if self.corners.iter().any(near) {
            return Side::On;
        }
        let turns: f64 = self.corners.iter().map(|t| solid_angle(point, t)).sum::<f64>() / (4.0 * std::f64::consts::PI);
        if turns.abs() > 0.5 { Side::Inside } else { Side::Outside }
    }

    /// Returns each edge of the triangles once: its vertices and their places.
    pub(super) fn edges(&self) -> Vec<([u32; 2], [Vector; 2])> {
        let of_triangle = |(vertices, corners): (&[u32; 3], &[Vector; 3])| {
            [(0, 1), (1, 2), (2, 0)].map(|(i, k)| {
                let (i, k) = if vertices[i] <= vertices[k] { (i, k) } else { (k, i) };
                ([vertices[i], vertices[k]], [corners[i], corners[k]])
            })
        };
        let mut edges: Vec<_> = self.vertices.iter().zip(&self.corners).flat_map(of_triangle).collect();
        edges.sort_by_key(|(vertices, _)| *vertices);
        edges.dedup_by_key(|(vertices, _)| *vertices);
        edges
    }
}

/// Returns the solid angle of a triangle seen from a point (Van Oosterom and Strackee 1983),
/// positive from its back.
fn solid_angle(from: Vector, triangle: &[Vector; 3]) -> f64 {
    let [a, b, c] = triangle.map(|corner| sub(corner, from));
    let (la, lb, lc) = (norm(a), norm(b), norm(c));
    let volume = dot(a, cross(b, c));
    2.0 * volume.atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
}

/// Returns the distance of a point from a triangle.
pub(super) fn distance(point: Vector, &[a, b, c]: &[Vector; 3]) -> f64 {
    let normal = cross(sub(b, a), sub(c, a));
    let beside = |from: Vector, to: Vector| dot(cross(sub(to, from), sub(point, from)), normal) < 0.0;
    let length = norm(normal);
    if length > 0.0 && ![(a, b), (b, c), (c, a)].into_iter().any(|(from, to)| beside(from, to)) {
        return (dot(sub(point, a), normal) / length).abs();
    }
    [(a, b), (b, c), (c, a)].into_iter().map(|(from, to)| to_segment(point, from, to)).fold(f64::INFINITY, f64::min)
}

/// Returns the distance of a point from a line segment.
pub(super) fn to_segment(point: Vector, from: Vector, to: Vector) -> f64 {
    let along = sub(to, from);
    let square = dot(along, along);
    let t = if square > 0.0 { (dot(sub(point, from), along) / square).clamp(0.0, 1.0) } else { 0.0 };
    norm(sub(point, [0, 1, 2].map(|i| from[i] + t * along[i])))
}
