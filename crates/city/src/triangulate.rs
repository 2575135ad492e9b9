//! Polygons with holes cut into triangles, by constrained Delaunay triangulation in the best-fit plane (`spade`).
//!
//! Triangles and strictly convex quadrilaterals, most of a city, need none: the latter are cut from their first corner,
//! because the rounding of coordinates must not choose between the two diagonals of a rectangle. Rings off their plane, whose
//! surface depends on how they are cut, are cut by [`ears`], as other tools do. A polygon whose rings cross or share edges is
//! split where they cross, and a triangle counts when its centroid is inside the outer ring and in no hole (even-odd rule).
//! Coordinates are metres relative to any nearby origin. Nothing is lost in silence: what was met on the way comes back as
//! [`Finding`]s.

use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation as _};

use crate::DefectCode;
use crate::ears;
use crate::ring::{Plane, clean};
use numeric::vector::{Vector, cross, dot, norm, sub, unit};

mod faces;

use faces::{faces_by_parity, pieces_inside};

/// A vertex off the plane by more than this is reported, metres (val3dity's default).
const PLANARITY_M: f64 = 0.01;
/// A triangle that deviates by more than 20 degrees from the polygon's normal is reported (val3dity's default).
const NORMAL_COSINE: f64 = 0.939_692_620_785_908_4;
/// Triangles that are narrower look anywhere where coordinates are on millimetres, metres.
const NARROW_M: f64 = 2.5e-3;
/// Below this the way a polygon is cut changes its surface by less than can be seen, metres.
const FLAT_M: f64 = 2e-4;
/// Ears are searched in rings up to this length: the search is quadratic.
const MAX_EARS: usize = 1000;
/// Tests of a point against an edge that one broken polygon may cost.
const MAX_EDGE_TESTS: usize = 50_000_000;
/// Vertices that the crossings of one polygon may add.
const MAX_CROSSINGS: usize = 20_000;
/// Rings of one polygon that are compared with each other; further repetitions show as edges that meet.
const MAX_COMPARED: usize = 256;

/// The triangles of a polygon.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Triangulation {
    /// Vertex indices as in the rings, counter-clockwise as the outer ring. Indices from `u32::MAX` downwards are the
    /// [`Triangulation::added`] vertices: `u32::MAX - i`.
    pub triangles: Vec<[u32; 3]>,
    /// Positions where rings crossed.
    pub added: Vec<[f64; 3]>,
    /// What was wrong with the polygon.
    pub findings: Vec<Finding>,
}

/// Something wrong with a polygon.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What.
    pub code: DefectCode,
    /// Whether the polygon, or the ring, is left out because of it.
    pub dropped: bool,
    /// Details.
    pub detail: String,
}

impl Finding {
    fn note(code: DefectCode, detail: impl Into<String>) -> Self {
        Self { code, dropped: false, detail: detail.into() }
    }
}

/// Cuts a polygon into triangles. `rings` are indices that `position` turns into metres; the first ring is the outer one.
///
/// A polygon that cannot be used has no triangles and a finding that says that it is dropped.
pub fn triangulate(rings: &[Vec<u32>], position: impl Fn(u32) -> [f64; 3]) -> Triangulation {
    let mut out = Triangulation::default();
    let Some((rings, plane)) = usable_rings(rings, &position, &mut out.findings) else { return out };
    let off_plane_m = check_planarity(&rings, &plane, &position, &mut out.findings);
    if let Some(triangles) = convex_shortcut(&rings, &plane, &position) {
        out.triangles = triangles;
    } else {
        Polygon::new(&rings, plane, &position).cut(off_plane_m, &mut out);
    }
    if off_plane_m > FLAT_M {
        check_normals(&mut out, &plane, &position);
    }
    out
}

/// The rings without repeated vertices and without those that bound nothing; and the plane of the outer ring.
fn usable_rings(
    rings: &[Vec<u32>],
    position: &impl Fn(u32) -> Vector,
    findings: &mut Vec<Finding>,
) -> Option<(Vec<Vec<u32>>, Plane)> {
    let mut kept: Vec<Vec<u32>> = Vec::with_capacity(rings.len());
    let mut outer: Option<Plane> = None;
    for (index, ring) in rings.iter().enumerate() {
        let mut ring = ring.clone();
        let found = clean(&mut ring, |a, b| a == b || position(a) == position(b));
        if found.repeated > 0 {
            let detail = format!("{} in ring {index}", found.repeated);
            findings.push(Finding::note(DefectCode::ConsecutivePointsSame, detail));
        }
        if found.spikes > 0 {
            let detail = format!("{} edges lead back over themselves in ring {index}", found.spikes);
            findings.push(Finding::note(DefectCode::RingSelfIntersection, detail));
        }
        if found.spikes == 0 && touches_itself(&ring, position) {
            let detail = format!("ring {index} comes to a vertex twice");
            findings.push(Finding::note(DefectCode::RingSelfIntersection, detail));
        }
        let points: Vec<Vector> = ring.iter().map(|&v| position(v)).collect();
        let code = match ring.len() {
            0..=2 => DefectCode::TooFewPoints,
            // No area and not on a line: loops that cancel each other.
            _ if points.windows(3).any(|corner| Plane::of_ring(corner).is_some()) => DefectCode::RingSelfIntersection,
            _ => DefectCode::ZeroArea,
        };
        let Some(plane) = Plane::of_ring(&points) else {
            findings.push(Finding { code, dropped: true, detail: format!("ring {index}") });
            if index == 0 {
                return None;
            }
            continue;
        };
        if kept.len() < MAX_COMPARED && kept.iter().any(|other| same_ring(other, &ring, position)) {
            findings.push(Finding {
                code: DefectCode::DuplicateRings,
                dropped: false,
                detail: format!("ring {index}"),
            });
            continue;
        }
        match outer {
            None => outer = Some(plane),
            Some(outer) if dot(outer.normal, plane.normal) > 0.0 => {
                findings.push(Finding::note(DefectCode::OrientationRingsSame, format!("ring {index}")));
            }
            Some(_) => {}
        }
        kept.push(ring);
    }
    outer.map(|plane| (kept, plane))
}

/// Whether a vertex occurs twice in a cleaned ring.
fn touches_itself(ring: &[u32], position: &impl Fn(u32) -> Vector) -> bool {
    // Two triangles that share a corner are the shortest such ring.
    if ring.len() < 6 {
        return false;
    }
    let mut places: Vec<[u64; 3]> = ring.iter().map(|&vertex| position(vertex).map(|c| (c + 0.0).to_bits())).collect();
    places.sort_unstable();
    places.windows(2).any(|pair| pair[0] == pair[1])
}

/// Whether two rings have the same corners in the same or the opposite order, wherever they begin.
fn same_ring(a: &[u32], b: &[u32], position: &impl Fn(u32) -> Vector) -> bool {
    let n = a.len();
    let same = |i: usize, j: usize| position(a[i % n]) == position(b[j % n]);
    if n != b.len() {
        return false;
    }
    let starts = (0..n).filter(|&start| same(0, start));
    starts.into_iter().take(2).any(|start| (0..n).all(|i| same(i, start + i)) || (0..n).all(|i| same(i, start + n - i)))
}

fn check_planarity(
    rings: &[Vec<u32>],
    plane: &Plane,
    position: &impl Fn(u32) -> Vector,
    findings: &mut Vec<Finding>,
) -> f64 {
    let worst = rings.iter().flatten().map(|&v| plane.distance(position(v)).abs()).fold(0.0, f64::max);
    if worst > PLANARITY_M {
        findings.push(Finding::note(DefectCode::NonPlanarDistance, format!("{worst:.3} m")));
    }
    worst
}

fn check_normals(out: &mut Triangulation, plane: &Plane, position: &impl Fn(u32) -> Vector) {
    let corner = |v: u32| out.added.get((u32::MAX - v) as usize).copied().unwrap_or_else(|| position(v));
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(corner);
        let doubled = cross(sub(b, a), sub(c, a));
        let longest = [sub(b, a), sub(c, a), sub(c, b)].map(norm).into_iter().fold(0.0, f64::max);
        // Of a narrower one the rounding of coordinates makes what it likes.
        unit(doubled).filter(|_| norm(doubled) > NARROW_M * longest)
    };
    let least = out.triangles.iter().filter_map(normal).map(|n| dot(n, plane.normal)).fold(1.0, f64::min);
    if least < NORMAL_COSINE {
        let detail = format!("by {:.0} degrees", least.clamp(-1.0, 1.0).acos().to_degrees());
        out.findings.push(Finding::note(DefectCode::NonPlanarNormals, detail));
    }
}

/// A triangle as it is, and a strictly convex quadrilateral cut from its first corner.
fn convex_shortcut(rings: &[Vec<u32>], plane: &Plane, position: &impl Fn(u32) -> Vector) -> Option<Vec<[u32; 3]>> {
    let [ring] = rings else { return None };
    match ring[..] {
        [a, b, c] => Some(vec![[a, b, c]]),
        [a, b, c, d] => {
            let corners = [a, b, c, d].map(position);
            let edge = |i: usize| sub(corners[(i + 1) % 4], corners[i % 4]);
            let turn = |i: usize| dot(cross(edge(i), edge(i + 1)), plane.normal);
            let strict = (0..4).all(|i| turn(i) > 1e-6 * plane.area);
            // A rectangle has two Delaunay triangulations, and rounding must not choose: cut from the first corner.
            strict.then(|| vec![[a, b, c], [a, c, d]])
        }
        _ => None,
    }
}

/// A vertex in the plane; vertices that were added where edges cross have no index yet.
#[derive(Debug, Clone, Copy)]
struct Corner {
    at: Point2<f64>,
    vertex: Option<u32>,
}

impl HasPosition for Corner {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.at
    }
}

type Cdt = ConstrainedDelaunayTriangulation<Corner>;

/// A polygon laid into its plane.
struct Polygon {
    rings: Vec<Vec<Corner>>,
    plane: Plane,
    u: Vector,
    v: Vector,
}

impl Polygon {
    fn new(rings: &[Vec<u32>], plane: Plane, position: &impl Fn(u32) -> Vector) -> Self {
        let (u, v) = plane.axes();
        let corner = |&vertex: &u32| {
            let from_point = sub(position(vertex), plane.point);
            // spade refuses numbers below its smallest: nothing in a city is a picometre away from something else.
            let plain = |c: f64| if c.abs() < 1e-12 { 0.0 } else { c };
            Corner { at: Point2::new(plain(dot(from_point, u)), plain(dot(from_point, v))), vertex: Some(vertex) }
        };
        Self { rings: rings.iter().map(|ring| ring.iter().map(corner).collect()).collect(), plane, u, v }
    }

    fn edge_count(&self) -> usize {
        self.rings.iter().map(Vec::len).sum()
    }

    /// The triangles of a ring that is off its plane by more than the planar ones are; `None` for all others.
    fn cut_by_ears(&self, off_plane_m: f64) -> Option<Vec<[u32; 3]>> {
        let [ring] = &self.rings[..] else { return None };
        if off_plane_m <= FLAT_M || ring.len() > MAX_EARS {
            return None;
        }
        let corners: Vec<[f64; 2]> = ring.iter().map(|corner| [corner.at.x, corner.at.y]).collect();
        let vertex = |i: usize| ring[i].vertex;
        ears::cut(&corners)?.into_iter().map(|[a, b, c]| Some([vertex(a)?, vertex(b)?, vertex(c)?])).collect()
    }

    fn cut(&self, off_plane_m: f64, out: &mut Triangulation) {
        let out_of_range = || fatal(DefectCode::NotTriangulated, "the coordinates are out of range");
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
            return out.findings.push(fatal(DefectCode::NotTriangulated, detail));
        }
        if crossing {
            let Some(split) = self.constrain_split() else {
                return out.findings.push(fatal(DefectCode::NotTriangulated, "its edges cross too often"));
            };
            cdt = split;
        }
        let inside = self.faces_by_centroid(&cdt);
        self.collect(&cdt, &inside, out);
    }

    /// The triangulation with every ring as constraints; and whether edges cross, when it lacks the crossing ones.
    fn constrain(&self) -> Option<(Cdt, bool)> {
        let mut cdt = Cdt::new();
        let mut crossing = false;
        // Where the crossings could not be cut, the first one is enough to know.
        let patient = self.edge_count().saturating_mul(self.edge_count()) <= MAX_EDGE_TESTS;
        for ring in &self.rings {
            crossing |= !constrain_ring(&mut cdt, ring, patient)?;
        }
        Some((cdt, crossing))
    }

    /// The triangulation of rings that were given a vertex wherever they cross.
    ///
    /// A crossing point is rounded, so that a piece may still cross another by a hair: such a piece stays out.
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

    fn meeting_rings(&self, crossing: bool) -> Finding {
        // A ring that is alone in a triangulation meets nothing but itself.
        let meets_itself = |ring: &Vec<Corner>| {
            let mut alone = Cdt::new();
            constrain_ring(&mut alone, ring, false) != Some(true) || alone.num_constraints() != ring.len()
        };
        let code = if self.rings.len() == 1 || self.rings.iter().any(meets_itself) {
            DefectCode::RingSelfIntersection
        } else {
            DefectCode::RingIntersection
        };
        Finding::note(code, if crossing { "edges cross" } else { "a vertex or an edge lies on another edge" })
    }

    /// Whether every hole is inside the outer ring and in no other hole.
    fn check_holes(&self, findings: &mut Vec<Finding>) -> bool {
        let before = findings.len();
        for (index, hole) in self.rings.iter().enumerate().skip(1) {
            // The middle of an edge, because a corner of a hole may rest on another ring.
            let probe = midpoint(hole[0].at, hole[1].at);
            if !contains(&self.rings[0], probe) {
                findings.push(Finding::note(DefectCode::InnerRingOutside, format!("ring {index}")));
            }
            let nested = |(other, ring): (usize, &Vec<Corner>)| other != index && contains(ring, probe);
            if self.rings.iter().enumerate().skip(1).any(nested) {
                findings.push(Finding::note(DefectCode::InnerRingsNested, format!("ring {index}")));
            }
        }
        findings.len() == before
    }

    /// Whether holes that touch cut the inside into pieces.
    fn check_connected(&self, cdt: &Cdt, inside: &[bool], findings: &mut Vec<Finding>) {
        // A ring that touches itself is the defect already.
        if self.rings.len() == 1 || findings.iter().any(|found| found.code == DefectCode::RingSelfIntersection) {
            return;
        }
        let pieces = pieces_inside(cdt, inside);
        if pieces > 1 {
            findings.push(Finding::note(DefectCode::InteriorDisconnected, format!("{pieces} pieces")));
        }
    }

    /// Which faces have their centroid inside the outer ring and in no hole.
    fn faces_by_centroid(&self, cdt: &Cdt) -> Vec<bool> {
        let mut inside = vec![false; cdt.num_all_faces()];
        for face in cdt.inner_faces() {
            let centre = face.center();
            inside[face.index()] =
                contains(&self.rings[0], centre) && !self.rings[1..].iter().any(|hole| contains(hole, centre));
        }
        inside
    }

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
            out.findings.push(fatal(DefectCode::ZeroArea, "nothing is inside the outer ring"));
        }
    }

    fn lift(&self, at: Point2<f64>) -> Vector {
        let along = |i: usize| self.plane.point[i] + at.x * self.u[i] + at.y * self.v[i];
        [along(0), along(1), along(2)]
    }
}

fn fatal(code: DefectCode, detail: &str) -> Finding {
    Finding { code, dropped: true, detail: detail.to_owned() }
}

fn midpoint(a: Point2<f64>, b: Point2<f64>) -> Point2<f64> {
    Point2::new(0.5 * (a.x + b.x), 0.5 * (a.y + b.y))
}

/// Inserts a ring and constrains its edges, leaving out those that cross a constraint; whether none did. One that is not
/// `patient` stops at the first.
///
/// `None` for coordinates that `spade` refuses.
fn constrain_ring(cdt: &mut Cdt, ring: &[Corner], patient: bool) -> Option<bool> {
    let handles: Vec<FixedVertexHandle> = ring.iter().map(|&corner| cdt.insert(corner).ok()).collect::<Option<_>>()?;
    let mut complete = true;
    for (i, &from) in handles.iter().enumerate() {
        let to = handles[(i + 1) % handles.len()];
        if from != to && cdt.can_add_constraint(from, to) {
            cdt.add_constraint(from, to);
        } else if from != to {
            complete = false;
            if !patient {
                break;
            }
        }
    }
    Some(complete)
}

fn ring_edges(ring: &[Corner]) -> impl Iterator<Item = [Point2<f64>; 2]> + '_ {
    (0..ring.len()).map(|i| [ring[i].at, ring[(i + 1) % ring.len()].at])
}

/// A ring with a new vertex at each place where one of its edges crosses one of `edges`.
fn split_at_crossings(ring: &[Corner], edges: &[[Point2<f64>; 2]]) -> Vec<Corner> {
    let mut split = Vec::with_capacity(ring.len());
    for (corner, edge) in ring.iter().zip(ring_edges(ring)) {
        split.push(*corner);
        let mut cuts: Vec<(f64, Point2<f64>)> = edges.iter().filter_map(|&other| crossing(edge, other)).collect();
        cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
        split.extend(cuts.into_iter().map(|(_, at)| Corner { at, vertex: None }));
        if split.len() > ring.len() + MAX_CROSSINGS {
            break;
        }
    }
    split
}

/// Where an edge crosses another in the inside of both: the fraction along the edge, and the place.
fn crossing([a, b]: [Point2<f64>; 2], [c, d]: [Point2<f64>; 2]) -> Option<(f64, Point2<f64>)> {
    let side = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
    let (from, to) = (side(c, d, a), side(c, d, b));
    let crosses = from * to < 0.0 && side(a, b, c) * side(a, b, d) < 0.0;
    let t = from / (from - to);
    // The same place from both sides: computed along the edge that comes first in the order of coordinates.
    let along = |p: Point2<f64>, q: Point2<f64>, t: f64| Point2::new(p.x + t * (q.x - p.x), p.y + t * (q.y - p.y));
    crosses.then(|| {
        let key = |p: Point2<f64>, q: Point2<f64>| [p.x, p.y, q.x, q.y];
        let at = if key(a, b) <= key(c, d) {
            along(a, b, t)
        } else {
            let (start, end) = (side(a, b, c), side(a, b, d));
            along(c, d, start / (start - end))
        };
        (t, at)
    })
}

/// Whether a point is inside a ring (even-odd rule).
fn contains(ring: &[Corner], point: Point2<f64>) -> bool {
    let mut inside = false;
    let mut from = match ring.last() {
        Some(corner) => corner.at,
        None => return false,
    };
    for corner in ring {
        let to = corner.at;
        if (from.y > point.y) != (to.y > point.y) {
            let x = from.x + (point.y - from.y) / (to.y - from.y) * (to.x - from.x);
            inside ^= point.x < x;
        }
        from = to;
    }
    inside
}

#[cfg(test)]
mod tests;
