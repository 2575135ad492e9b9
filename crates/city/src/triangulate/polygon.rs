//! A polygon in its plane, cut by ears or by a constrained Delaunay triangulation.

use spade::{Point2, Triangulation as _};

use super::faces::{faces_by_parity, pieces_inside};
use super::plane::{Cdt, Corner, MAX_CROSSINGS, constrain_ring, contains, midpoint, ring_edges, split_at_crossings};
use super::result::{PolygonFinding, Triangulation};
use crate::DefectCode;
use crate::ears;
use crate::ring::Plane;
use numeric::vector::{Vector, dot, sub};

/// Deviation from the plane below which the way a polygon is cut does not change its surface
/// visibly, metres.
pub(super) const FLAT_M: f64 = 2e-4;
/// Longest ring that is cut by ears, because the search for ears is quadratic.
const MAX_EARS: usize = 1000;
/// Limit of the tests of a point against an edge for one invalid polygon.
const MAX_EDGE_TESTS: usize = 50_000_000;
/// Coordinates in the plane below this are taken as zero, metres. `spade` refuses tiny numbers, and
/// no two things of a city are a picometre apart.
const SMALLEST_M: f64 = 1e-12;

/// A polygon in its plane, with the axes `u` and `v`.
pub(super) struct Polygon {
    rings: Vec<Vec<Corner>>,
    plane: Plane,
    u: Vector,
    v: Vector,
}

impl Polygon {
    pub(super) fn new(rings: &[Vec<u32>], plane: Plane, position: &impl Fn(u32) -> Vector) -> Self {
        let (u, v) = plane.axes();
        let corner = |&vertex: &u32| {
            let from_point = sub(position(vertex), plane.point);
            let plain = |c: f64| if c.abs() < SMALLEST_M { 0.0 } else { c };
            Corner { at: Point2::new(plain(dot(from_point, u)), plain(dot(from_point, v))), vertex: Some(vertex) }
        };
        Self { rings: rings.iter().map(|ring| ring.iter().map(corner).collect()).collect(), plane, u, v }
    }

    fn edge_count(&self) -> usize {
        self.rings.iter().map(Vec::len).sum()
    }

    /// Cuts a single ring that is not planar by ears. Returns `None` for all other polygons.
    fn cut_by_ears(&self, off_plane_m: f64) -> Option<Vec<[u32; 3]>> {
        let [ring] = &self.rings[..] else { return None };
        if off_plane_m <= FLAT_M || ring.len() > MAX_EARS {
            return None;
        }
        let corners: Vec<[f64; 2]> = ring.iter().map(|corner| [corner.at.x, corner.at.y]).collect();
        let vertex = |i: usize| ring[i].vertex;
        ears::cut(&corners)?.into_iter().map(|[a, b, c]| Some([vertex(a)?, vertex(b)?, vertex(c)?])).collect()
    }

    /// Cuts the polygon into triangles; `off_plane_m` is the largest distance of a vertex from the
    /// plane.
    pub(super) fn cut(&self, off_plane_m: f64, out: &mut Triangulation) {
        let out_of_range = || PolygonFinding::fatal(DefectCode::NotTriangulated, "the coordinates are out of range");
        let Some((mut cdt, crossing)) = self.constrain() else { return out.findings.push(out_of_range()) };
        let simple = !crossing && cdt.num_constraints() == self.edge_count();
        let cost = (cdt.num_inner_faces() + self.edge_count()).saturating_mul(self.edge_count());
        let bounded = cost <= MAX_EDGE_TESTS;
        if !simple {
            out.findings.push(self.meeting_rings(crossing));
        }
        let holes_fit = self.rings.len() == 1 || (bounded && self.check_holes(&mut out.findings));
        if let Some(triangles) = self.cut_by_ears(off_plane_m).filter(|_| simple) {
            out.triangles = triangles;
            return;
        }
        if simple && holes_fit {
            let inside = faces_by_parity(&cdt);
            self.check_connected(&cdt, &inside, &mut out.findings);
            return self.collect(&cdt, &inside, out);
        }
        if !bounded {
            let detail = "too many vertices for a polygon with such rings";
            return out.findings.push(PolygonFinding::fatal(DefectCode::NotTriangulated, detail));
        }
        if crossing {
            let Some(split) = self.constrain_split() else {
                return out
                    .findings
                    .push(PolygonFinding::fatal(DefectCode::NotTriangulated, "its edges cross too often"));
            };
            cdt = split;
        }
        let inside = self.faces_by_centroid(&cdt);
        self.collect(&cdt, &inside, out);
    }

    /// Triangulates with the edges of all rings as constraints, and returns whether edges were left
    /// out because they cross.
    fn constrain(&self) -> Option<(Cdt, bool)> {
        let mut cdt = Cdt::new();
        let mut crossing = false;
        // When the polygon is too large for its crossings to be cut, the first crossing is enough.
        let patient = self.edge_count().saturating_mul(self.edge_count()) <= MAX_EDGE_TESTS;
        for ring in &self.rings {
            crossing |= !constrain_ring(&mut cdt, ring, patient)?;
        }
        Some((cdt, crossing))
    }

    /// Triangulates the rings with a vertex at each crossing. Returns `None` when there are too
    /// many crossings.
    ///
    /// Crossing points are rounded, so that parts of edges may still cross slightly. Such parts are
    /// left out.
    fn constrain_split(&self) -> Option<Cdt> {
        let edges: Vec<[Point2<f64>; 2]> = self.rings.iter().flat_map(|ring| ring_edges(ring)).collect();
        let mut cdt = Cdt::new();
        let mut added = 0;
        for ring in &self.rings {
            let split = split_at_crossings(ring, &edges);
            added += split.len() - ring.len();
            if added > MAX_CROSSINGS {
                return None;
            }
            constrain_ring(&mut cdt, &split, true)?;
        }
        Some(cdt)
    }

    /// Returns the defect of rings that touch or cross.
    fn meeting_rings(&self, crossing: bool) -> PolygonFinding {
        // In a triangulation of its own a ring can only meet itself.
        let meets_itself = |ring: &Vec<Corner>| {
            let mut alone = Cdt::new();
            constrain_ring(&mut alone, ring, false) != Some(true) || alone.num_constraints() != ring.len()
        };
        let code = if self.rings.len() == 1 || self.rings.iter().any(meets_itself) {
            DefectCode::RingSelfIntersection
        } else {
            DefectCode::RingIntersection
        };
        PolygonFinding::note(code, if crossing { "edges cross" } else { "a vertex or an edge lies on another edge" })
    }

    /// Reports holes outside the outer ring or inside another hole, and returns whether there are
    /// none.
    fn check_holes(&self, findings: &mut Vec<PolygonFinding>) -> bool {
        let before = findings.len();
        for (index, hole) in self.rings.iter().enumerate().skip(1) {
            // A corner of a hole may lie on another ring, so the middle of an edge is tested.
            let probe = midpoint(hole[0].at, hole[1].at);
            if !contains(&self.rings[0], probe) {
                findings.push(PolygonFinding::note(DefectCode::InnerRingOutside, format!("ring {index}")));
            }
            let nested = |(other, ring): (usize, &Vec<Corner>)| other != index && contains(ring, probe);
            if self.rings.iter().enumerate().skip(1).any(nested) {
                findings.push(PolygonFinding::note(DefectCode::InnerRingsNested, format!("ring {index}")));
            }
        }
        findings.len() == before
    }

    /// Reports holes that touch and cut the interior into pieces.
    fn check_connected(&self, cdt: &Cdt, inside: &[bool], findings: &mut Vec<PolygonFinding>) {
        // A ring that touches itself has been reported already.
        if self.rings.len() == 1 || findings.iter().any(|found| found.code == DefectCode::RingSelfIntersection) {
            return;
        }
        let pieces = pieces_inside(cdt, inside);
        if pieces > 1 {
            findings.push(PolygonFinding::note(DefectCode::InteriorDisconnected, format!("{pieces} pieces")));
        }
    }

    /// Returns per face whether its centroid is inside the outer ring and in no hole.
    fn faces_by_centroid(&self, cdt: &Cdt) -> Vec<bool> {
        let mut inside = vec![false; cdt.num_all_faces()];
        for face in cdt.inner_faces() {
            let centre = face.center();
            inside[face.index()] =
                contains(&self.rings[0], centre) && !self.rings[1..].iter().any(|hole| contains(hole, centre));
        }
        inside
    }

    /// Adds the faces inside to the result.
    fn collect(&self, cdt: &Cdt, inside: &[bool], out: &mut Triangulation) {
        let mut index_of: Vec<u32> = Vec::with_capacity(cdt.num_vertices());
        for vertex in cdt.vertices() {
            let corner = vertex.data();
            index_of.push(corner.vertex.unwrap_or_else(|| {
                out.added.push(self.lift(corner.at));
                u32::MAX - (out.added.len() - 1) as u32
            }));
        }
        for face in cdt.inner_faces().filter(|face| inside[face.index()]) {
            out.triangles.push(face.vertices().map(|vertex| index_of[vertex.index()]));
        }
        if out.triangles.is_empty() {
            out.findings.push(PolygonFinding::fatal(DefectCode::ZeroArea, "nothing is inside the outer ring"));
        }
    }

    /// Returns the place of a point of the plane, metres.
    fn lift(&self, at: Point2<f64>) -> Vector {
        let along = |i: usize| self.plane.point[i] + at.x * self.u[i] + at.y * self.v[i];
        [along(0), along(1), along(2)]
    }
}
