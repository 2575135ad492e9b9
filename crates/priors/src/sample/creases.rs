//! The edges at which a surface bends or ends, in a grid of cells.
//!
//! A flat disk of radius s around a point p may reach over an edge at distance d. Beyond it the surface leaves the disk's plane
//! at the angle α between the normals, and the disk is off by up to (s − d) sin α; where the surface ends, or turns by more
//! than a right angle, by s − d. The spacing that keeps this under half of the error e is s ≤ d + e / (2 sin α). The half makes
//! surfaces keep the whole of e that bend a little at each of many edges (a tower of radius R in narrow facets): there the
//! smallest of these bounds is √(2 e R), the radius whose disk is off by e.

use std::collections::HashMap;

use super::LIMIT;
use crate::vector::{Vector, along, cross, dot, norm, sub};
use crate::{PriorModel, PriorsError};

/// Normals closer than this belong to one plane (sine of the angle).
const FLAT: f64 = 1e-4;
/// Faces kept per edge; an edge with more counts as an end of the surface.
const FACES: usize = 2;

/// An edge with the faces that meet there.
#[derive(Debug, Clone, Copy)]
struct Crease {
    ends: [Vector; 2],
    /// Normals of the faces; none where the surface ends.
    faces: Option<[Vector; FACES]>,
}

/// The creases of a model, by cells.
#[derive(Debug)]
pub(super) struct Creases {
    creases: Vec<Crease>,
    cells: HashMap<[i64; 3], Vec<u32>>,
    side_m: f64,
    reach_m: f64,
}

/// Cells along the reach: the shells of cells around a point are searched from the inside, and most points lie near an edge.
const CELLS: i64 = 4;

impl Creases {
    /// The creases of a model, found from points up to `reach_m` away.
    pub(super) fn new(model: &PriorModel, reach_m: f64) -> Result<Self, PriorsError> {
        let creases = collect(model);
        let side_m = reach_m / CELLS as f64;
        let pieces: f64 = creases.iter().map(|c| norm(sub(c.ends[1], c.ends[0])) / side_m + 1.0).sum();
        if pieces > LIMIT as f64 / 5.0 {
            return Err(PriorsError::TooMany { asked: pieces as u64, limit: LIMIT / 5 });
        }
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        for (number, crease) in (0u32..).zip(&creases) {
            for cell in touched(crease.ends, side_m) {
                let list = cells.entry(cell).or_default();
                if list.last() != Some(&number) {
                    list.push(number);
                }
            }
        }
        Ok(Self { creases, cells, side_m, reach_m })
    }

    /// The largest radius of a disk at a point with a normal that stays within the error, at most the reach.
    pub(super) fn spacing(&self, position: Vector, normal: Vector, error_m: f64) -> f64 {
        let home = position.map(|c| (c / self.side_m).floor() as i64);
        let mut spacing = self.reach_m;
        for shell in 0..=CELLS {
            // What lies in this shell of cells is at least this far away, and can take nothing off a smaller spacing.
            if (shell - 1) as f64 * self.side_m >= spacing {
                break;
            }
            for list in around(home, shell).filter_map(|cell| self.cells.get(&cell)) {
                for &number in list {
                    let crease = &self.creases[number as usize];
                    let distance = to_segment(position, crease.ends);
                    if distance < spacing {
                        spacing = spacing.min(distance + 0.5 * error_m / crease.bend(normal));
                    }
                }
            }
        }
        spacing
    }
}

/// The cells at a distance from one, counted as a king moves.
fn around([x, y, z]: [i64; 3], shell: i64) -> impl Iterator<Item = [i64; 3]> {
    (-shell..=shell).flat_map(move |dx| {
        (-shell..=shell).flat_map(move |dy| {
            let step = if dx.abs() == shell || dy.abs() == shell { 1 } else { (2 * shell).max(1) as usize };
            (-shell..=shell).step_by(step).map(move |dz| [x + dx, y + dy, z + dz])
        })
    })
}

impl Crease {
    /// The sine of the angle by which the surface leaves a plane here; 1 for an end and for more than a right angle.
    fn bend(&self, normal: Vector) -> f64 {
        let Some(faces) = self.faces else { return 1.0 };
        let sine = |face: Vector| if dot(normal, face) <= 0.0 { 1.0 } else { norm(cross(normal, face)) };
        faces.map(sine).into_iter().fold(1e-9, f64::max)
    }
}

/// Every edge that is not inside a plane, in the order of the triangles.
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

/// The cells that a segment may touch: those around its pieces, each no longer than a cell.
fn touched([start, end]: [Vector; 2], side: f64) -> impl Iterator<Item = [i64; 3]> {
    let span = sub(end, start);
    let pieces = (norm(span) / side).ceil().max(1.0) as usize;
    let cell = move |t: usize| along(start, t as f64 / pieces as f64, span).map(|c| (c / side).floor() as i64);
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

fn to_segment(position: Vector, [start, end]: [Vector; 2]) -> f64 {
    let (span, from_start) = (sub(end, start), sub(position, start));
    let length_2 = dot(span, span);
    let t = if length_2 > 0.0 { (dot(from_start, span) / length_2).clamp(0.0, 1.0) } else { 0.0 };
    norm(sub(from_start, span.map(|c| t * c)))
}
