//! Cuts polygons with holes into triangles, by constrained Delaunay triangulation in the fitted
//! plane (`spade`).
//!
//! Most polygons of a city are triangles or strictly convex quadrilaterals, which need no
//! triangulation. Quadrilaterals are cut from their first corner, so that the rounding of
//! coordinates does not choose between the two diagonals of a rectangle. The surface of a ring that
//! is not planar depends on the cut; such rings are cut by [`ears`](crate::ears), as other tools
//! do. Where rings cross or share edges, edges are split at the crossings, and a triangle belongs
//! to the polygon when its centroid is inside the outer ring and in no hole (even-odd rule).
//!
//! Coordinates are metres relative to any nearby origin. Every defect comes back as a
//! [`PolygonFinding`].

mod faces;
mod plane;
mod polygon;
mod result;
mod rings;

use crate::DefectCode;
use crate::ring::Plane;
use numeric::vector::{Vector, cross, dot, norm, sub, unit};
use polygon::Polygon;
use rings::usable_rings;

pub use result::{PolygonFinding, Triangulation};

/// A vertex off the plane by more than this is reported, metres (val3dity's default).
const PLANARITY_M: f64 = 0.01;
/// Cosine of 20 degrees: a triangle that deviates more from the normal of the polygon is reported
/// (val3dity's default).
const NORMAL_COSINE: f64 = 0.939_692_620_785_908_4;
/// Narrower triangles have no reliable normal when coordinates are rounded to millimetres, metres.
const NARROW_M: f64 = 2.5e-3;

/// Cuts a polygon into triangles.
///
/// `rings` are vertex indices, the outer ring first. `position` returns the coordinates of a vertex
/// in metres. A polygon that cannot be used gets no triangles, and a finding that says that it was
/// dropped.
///
/// # Examples
/// ```
/// // A square with a square hole.
/// let corners: [[f64; 3]; 8] = [
///     [0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 3.0, 0.0], [0.0, 3.0, 0.0],
///     [1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [2.0, 2.0, 0.0], [2.0, 1.0, 0.0],
/// ];
/// let cut = city::triangulate(&[vec![0, 1, 2, 3], vec![4, 5, 6, 7]], |vertex| corners[vertex as usize]);
/// assert_eq!(cut.triangles.len(), 8);
/// assert!(cut.findings.is_empty());
/// ```
pub fn triangulate(rings: &[Vec<u32>], position: impl Fn(u32) -> [f64; 3]) -> Triangulation {
    let mut out = Triangulation::default();
    let Some((rings, plane)) = usable_rings(rings, &position, &mut out.findings) else { return out };
    let off_plane_m = check_planarity(&rings, &plane, &position, &mut out.findings);
    if let Some(triangles) = convex_shortcut(&rings, &plane, &position) {
        out.triangles = triangles;
    } else {
        Polygon::new(&rings, plane, &position).cut(off_plane_m, &mut out);
    }
    if off_plane_m > polygon::FLAT_M {
        check_normals(&mut out, &plane, &position);
    }
    out
}

/// Returns the largest distance of a vertex from the plane, and reports it when the polygon is not
/// planar.
fn check_planarity(
    rings: &[Vec<u32>],
    plane: &Plane,
    position: &impl Fn(u32) -> Vector,
    findings: &mut Vec<PolygonFinding>,
) -> f64 {
    let worst = rings.iter().flatten().map(|&v| plane.distance(position(v)).abs()).fold(0.0, f64::max);
    if worst > PLANARITY_M {
        findings.push(PolygonFinding::note(DefectCode::NonPlanarDistance, format!("{worst:.3} m")));
    }
    worst
}

/// Reports triangles whose normal deviates from the normal of the polygon.
fn check_normals(out: &mut Triangulation, plane: &Plane, position: &impl Fn(u32) -> Vector) {
    let corner = |v: u32| out.added.get((u32::MAX - v) as usize).copied().unwrap_or_else(|| position(v));
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(corner);
        let doubled = cross(sub(b, a), sub(c, a));
        let longest = [sub(b, a), sub(c, a), sub(c, b)].map(norm).into_iter().fold(0.0, f64::max);
        // The rounding of coordinates decides the normal of a narrower triangle.
        unit(doubled).filter(|_| norm(doubled) > NARROW_M * longest)
    };
    let least = out.triangles.iter().filter_map(normal).map(|n| dot(n, plane.normal)).fold(1.0, f64::min);
    if least < NORMAL_COSINE {
        let detail = format!("by {:.0} degrees", least.clamp(-1.0, 1.0).acos().to_degrees());
        out.findings.push(PolygonFinding::note(DefectCode::NonPlanarNormals, detail));
    }
}

/// Cuts a triangle or a strictly convex quadrilateral. Returns `None` for all other polygons.
fn convex_shortcut(rings: &[Vec<u32>], plane: &Plane, position: &impl Fn(u32) -> Vector) -> Option<Vec<[u32; 3]>> {
    let [ring] = rings else { return None };
    match ring[..] {
        [a, b, c] => Some(vec![[a, b, c]]),
        [a, b, c, d] => {
            let corners = [a, b, c, d].map(position);
            let edge = |i: usize| sub(corners[(i + 1) % 4], corners[i % 4]);
            let turn = |i: usize| dot(cross(edge(i), edge(i + 1)), plane.normal);
            let strict = (0..4).all(|i| turn(i) > 1e-6 * plane.area);
            // A rectangle has two Delaunay triangulations. Cutting from the first corner keeps
            // rounding from choosing.
            strict.then(|| vec![[a, b, c], [a, c, d]])
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests;
