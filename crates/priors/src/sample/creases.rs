//! The edges at which a surface bends or ends, in a grid of cells.
//!
//! A flat disk of radius s around a point may extend beyond an edge at distance d. Beyond the edge
//! the surface leaves the plane of the disk at the angle α between the normals, and the disk is off
//! by up to (s − d) sin α. Where the surface ends, or turns by more than a right angle, the disk is
//! off by up to s − d. The spacing s ≤ d + e / (2 sin α) keeps this below half of the error e.
//!
//! The factor one half makes surfaces that bend slightly at many edges (a tower of radius R with
//! narrow facets) keep the whole error e: the smallest of these bounds is then √(2 e R), the radius
//! of a disk that is off by e.

use std::collections::HashMap;

use rayon::prelude::*;

use super::limits::LIMIT;
use crate::{PriorModel, PriorsError};
use numeric::vector::{Vector, along, cross, dot, norm, sub};

/// Sine of the angle below which two normals belong to one plane.
const FLAT: f64 = 1e-4;
/// Number of faces of an ordinary edge. An edge with another number counts as an end of the
/// surface.
const FACES: usize = 2;

/// An edge and the faces that meet there.
#[derive(Debug, Clone, Copy)]
struct Crease {
    ends: [Vector; 2],
    /// Normals of the faces; `None` where the surface ends.
    faces: Option<[Vector; FACES]>,
}

/// The creases of a model in a grid of cells.
#[derive(Debug)]
pub(super) struct Creases {
    creases: Vec<Crease>,
    /// Pairs of a cell and the index of a crease that may touch it, ascending.
    touching: Vec<([i32; 3], u32)>,
    /// Per cell the range of its pairs.
    cells: HashMap<[i32; 3], (u32, u32)>,
    /// Side of a cell, metres.
    side_m: f64,
    /// Largest distance at which a crease is found, metres.
    reach_m: f64,
}

/// A crease near a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    ends: [Vector; 2],
    /// How far a disk may extend beyond the crease, metres.
    over_m: f64,
}

impl Near {
    /// Returns the largest radius of a disk at a point that this crease allows, metres.
    pub(super) fn allows(&self, position: Vector) -> f64 {
        to_segment(position, self.ends) + self.over_m
    }
}

impl Creases {
    /// Collects the creases of a model. They are found from points up to `reach_m` away.
    pub(super) fn new(model: &PriorModel, reach_m: f64) -> Result<Self, PriorsError> {
        let creases = collect(model);
        // With cells as wide as the reach most triangles look into a few dozen cells.
        let side_m = reach_m;
        let pieces: f64 = creases.iter().map(|c| norm(sub(c.ends[1], c.ends[0])) / side_m + 1.0).sum();
        let extent = model.mesh().positions.iter().flatten().fold(0.0, |most: f64, c| most.max(c.abs()));
        if pieces > LIMIT as f64 / 5.0 || extent / side_m > f64::from(i32::MAX / 2) {
            return Err(PriorsError::TooMany { asked: pieces.max(extent / side_m) as u64, limit: LIMIT / 5 });
        }
        let of_crease = |(number, crease): (u32, &Crease)| touched(crease.ends, side_m).map(move |cell| (cell, number));
        let mut touching: Vec<([i32; 3], u32)> = (0u32..).zip(&creases).flat_map(of_crease).collect();
        touching.par_sort_unstable();
        touching.dedup();
        let mut cells = HashMap::new();
        let mut start = 0;
        for group in touching.chunk_by(|a, b| a.0 == b.0) {
            let end = start + group.len() as u32;
            cells.insert(group[0].0, (start, end));
            start = end;
        }
        Ok(Self { creases, touching, cells, side_m, reach_m })
    }

    /// Returns the largest radius of any disk, metres.
    pub(super) fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Returns the creases that may limit the radius of a disk on a triangle with a normal.
    pub(super) fn near(&self, corners: &[Vector; 3], normal: Vector, error_m: f64) -> Vec<Near> {
        let limit = |axis: usize, pick: fn(f64, f64) -> f64, by: f64| {
            let most = corners.iter().map(|c| c[axis]).reduce(pick).unwrap_or(0.0);
            ((most + by) / self.side_m).floor() as i32
        };
        let range = |axis| limit(axis, f64::min, -self.reach_m)..=limit(axis, f64::max, self.reach_m);
        let cells = range(0).flat_map(|x| range(1).flat_map(move |y| range(2).map(move |z| [x, y, z])));
        let of_cell = |cell: [i32; 3]| {
            let (start, end) = self.cells.get(&cell).copied().unwrap_or_default();
            &self.touching[start as usize..end as usize]
        };
        let mut numbers: Vec<u32> = cells.flat_map(of_cell).map(|(_, number)| *number).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let of_crease = |number: u32| {
            let crease = &self.creases[number as usize];
            Near { ends: crease.ends, over_m: 0.5 * error_m / crease.bend(normal) }
        };
        numbers.into_iter().map(of_crease).collect()
    }
}

impl Crease {
    /// Returns the sine of the angle between the surface and a plane with a normal; 1 where the
    /// surface ends or turns by more than a right angle.
    fn bend(&self, normal: Vector) -> f64 {
        let Some(faces) = self.faces else { return 1.0 };
        let sine = |face: Vector| if dot(normal, face) <= 0.0 { 1.0 } else { norm(cross(normal, face)) };
        faces.map(sine).into_iter().fold(1e-9, f64::max)
    }
}

/// Returns the edges that are not inside a plane, in the order of the triangles.
fn collect(model: &PriorModel) -> Vec<Crease> {
    let mesh = model.mesh();
    let mut faces_at: HashMap<(u32, u32), Vec<u32>> = HashMap::new();
    let mut order = Vec::new();
    for (number, triangle) in (0u32..).zip(&mesh.triangles) {
        for i in 0..3 {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            let faces = faces_at.entry((a.min(b), a.max(b))).or_default();
            if faces.is_empty() {
                order.push((a.min(b), a.max(b)));
            }
            faces.push(number);
        }
    }
    let crease = |edge: (u32, u32)| {
        let ends = [edge.0, edge.1].map(|corner| mesh.positions[corner as usize]);
        let normals = faces_at.get(&edge)?.iter().map(|&t| model.normal(t as usize)).collect::<Vec<_>>();
        let faces = <[Vector; FACES]>::try_from(normals).ok();
        let flat = faces.is_some_and(|[a, b]| dot(a, b) > 0.0 && norm(cross(a, b)) < FLAT);
        (!flat).then_some(Crease { ends, faces })
    };
    order.into_iter().filter_map(crease).collect()
}

/// Iterates over the cells that a segment may touch: the cells around pieces no longer than a cell.
fn touched([start, end]: [Vector; 2], side: f64) -> impl Iterator<Item = [i32; 3]> {
    let span = sub(end, start);
    let pieces = (norm(span) / side).ceil().max(1.0) as usize;
    let cell = move |t: usize| along(start, t as f64 / pieces as f64, span).map(|c| (c / side).floor() as i32);
    (0..pieces).flat_map(move |piece| {
        let (a, b) = (cell(piece), cell(piece + 1));
        let range = |axis: usize| a[axis].min(b[axis])..=a[axis].max(b[axis]);
        let (x, y, z) = (range(0), range(1), range(2));
        x.flat_map(move |x| {
            let z = z.clone();
            y.clone().flat_map(move |y| z.clone().map(move |z| [x, y, z]))
        })
    })
}

/// Returns the distance of a point from a segment.
fn to_segment(position: Vector, [start, end]: [Vector; 2]) -> f64 {
    let (span, from_start) = (sub(end, start), sub(position, start));
    let length_2 = dot(span, span);
    let t = if length_2 > 0.0 { (dot(from_start, span) / length_2).clamp(0.0, 1.0) } else { 0.0 };
    norm(sub(from_start, span.map(|c| t * c)))
}
