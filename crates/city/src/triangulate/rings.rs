//! Prepares the rings of a polygon: cleans them, drops those without area, and fits the plane of
//! the outer ring.

use super::result::PolygonFinding;
use crate::DefectCode;
use crate::ring::{Plane, clean};
use numeric::vector::{Vector, dot};

/// Number of rings of one polygon that are compared with each other. Later repetitions show as
/// edges that meet.
const MAX_COMPARED: usize = 256;

/// Returns the clean rings that have an area, and the plane of the outer ring; `None` when the
/// outer ring has no area.
pub(super) fn usable_rings(
    rings: &[Vec<u32>],
    position: &impl Fn(u32) -> Vector,
    findings: &mut Vec<PolygonFinding>,
) -> Option<(Vec<Vec<u32>>, Plane)> {
    let mut kept: Vec<Vec<u32>> = Vec::with_capacity(rings.len());
    let mut outer: Option<Plane> = None;
    for (index, ring) in rings.iter().enumerate() {
        let ring = clean_ring(ring, index, position, findings);
        let points: Vec<Vector> = ring.iter().map(|&v| position(v)).collect();
        let Some(plane) = Plane::of_ring(&points) else {
            let code = code_without_area(&points);
            findings.push(PolygonFinding { code, dropped: true, detail: format!("ring {index}") });
            if index == 0 {
                return None;
            }
            continue;
        };
        if kept.len() < MAX_COMPARED && kept.iter().any(|other| same_ring(other, &ring, position)) {
            findings.push(PolygonFinding::note(DefectCode::DuplicateRings, format!("ring {index}")));
            continue;
        }
        match outer {
            None => outer = Some(plane),
            Some(outer) if dot(outer.normal, plane.normal) > 0.0 => {
                findings.push(PolygonFinding::note(DefectCode::OrientationRingsSame, format!("ring {index}")));
            }
            Some(_) => {}
        }
        kept.push(ring);
    }
    outer.map(|plane| (kept, plane))
}

/// Removes repeated vertices and spikes, and reports them and vertices that occur twice.
fn clean_ring(
    ring: &[u32],
    index: usize,
    position: &impl Fn(u32) -> Vector,
    findings: &mut Vec<PolygonFinding>,
) -> Vec<u32> {
    let mut ring = ring.to_vec();
    let found = clean(&mut ring, |a, b| a == b || position(a) == position(b));
    if found.repeated > 0 {
        let detail = format!("{} in ring {index}", found.repeated);
        findings.push(PolygonFinding::note(DefectCode::ConsecutivePointsSame, detail));
    }
    if found.spikes > 0 {
        let detail = format!("{} spikes in ring {index}", found.spikes);
        findings.push(PolygonFinding::note(DefectCode::RingSelfIntersection, detail));
    }
    if found.spikes == 0 && touches_itself(&ring, position) {
        let detail = format!("ring {index} passes through a vertex twice");
        findings.push(PolygonFinding::note(DefectCode::RingSelfIntersection, detail));
    }
    ring
}

/// Returns the defect of a ring without area.
fn code_without_area(points: &[Vector]) -> DefectCode {
    match points.len() {
        0..=2 => DefectCode::TooFewPoints,
        // A ring without area that is not a line has loops that cancel each other.
        _ if points.windows(3).any(|corner| Plane::of_ring(corner).is_some()) => DefectCode::RingSelfIntersection,
        _ => DefectCode::ZeroArea,
    }
}

/// Returns whether a vertex occurs twice in a clean ring.
fn touches_itself(ring: &[u32], position: &impl Fn(u32) -> Vector) -> bool {
    // The shortest such ring is two triangles that share a corner.
    if ring.len() < 6 {
        return false;
    }
    let mut places: Vec<[u64; 3]> = ring.iter().map(|&vertex| position(vertex).map(|c| (c + 0.0).to_bits())).collect();
    places.sort_unstable();
    places.windows(2).any(|pair| pair[0] == pair[1])
}

/// Returns whether two rings have the same corners in the same or the opposite order, whichever
/// corner is the first.
fn same_ring(a: &[u32], b: &[u32], position: &impl Fn(u32) -> Vector) -> bool {
    let n = a.len();
    let same = |i: usize, j: usize| position(a[i % n]) == position(b[j % n]);
    if n != b.len() {
        return false;
    }
    let starts = (0..n).filter(|&start| same(0, start));
    starts.into_iter().take(2).any(|start| (0..n).all(|i| same(i, start + i)) || (0..n).all(|i| same(i, start + n - i)))
}
