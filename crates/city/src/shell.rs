//! Checks whether the shells of solids are closed, and turns polygons that face the wrong side.
//!
//! Two polygons use every edge of a closed shell, once in each direction. Where only the directions
//! are wrong, polygons are turned until neighbours agree. The sign of the enclosed volume then
//! tells which side is outside.

use crate::sets::DisjointSets;
use crate::{DefectCode, SurfacePolygon};
use numeric::vector::{Vector, add_cross, dot, sub};

/// Result of the check of a shell.
#[derive(Debug, Default)]
pub(crate) struct ShellCheck {
    /// Per surface whether it must be turned around.
    pub(crate) turn: Vec<bool>,
    /// Defects of the shell with details. `turn` repairs wrong orientations.
    pub(crate) found: Vec<(DefectCode, String)>,
}

/// An edge of a polygon. Sorting brings the edges between the same two vertices together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    low: u32,
    high: u32,
    /// Whether the polygon runs from `low` to `high`.
    ascending: bool,
    polygon: u32,
}

impl Edge {
    fn joins_the_same(&self, other: &Self) -> bool {
        (self.low, self.high) == (other.low, other.high)
    }
}

/// Two polygons that share an edge.
struct Neighbours {
    a: usize,
    b: usize,
    /// Whether both run along the edge in the same direction, so that one of them must be turned.
    disagree: bool,
}

/// Checks the shell that `surfaces` form; `outer` is false for the shell of a cavity.
pub(crate) fn check(surfaces: &[&SurfacePolygon], outer: bool, position: impl Fn(u32) -> Vector) -> ShellCheck {
    let mut out = ShellCheck { turn: vec![false; surfaces.len()], found: Vec::new() };
    if surfaces.len() < 4 {
        out.found.push((DefectCode::TooFewPolygons, format!("{}", surfaces.len())));
        return out;
    }
    let edges = sorted_edges(surfaces);
    let groups = || edges.chunk_by(Edge::joins_the_same);
    let open = groups().filter(|group| group.len() == 1).count();
    let crowded = groups().filter(|group| group.len() > 2).count();
    if open > 0 {
        out.found.push((DefectCode::ShellNotClosed, format!("{open} edges are used once")));
    }
    if crowded > 0 {
        out.found.push((DefectCode::NonManifold, format!("{crowded} edges")));
    }
    if open + crowded > 0 {
        let pieces = pieces(surfaces.len(), &edges);
        if pieces > 1 {
            out.found.push((DefectCode::MultipleComponents, format!("{pieces}")));
        }
        return out;
    }
    let pair = |group: &[Edge]| Neighbours {
        a: group[0].polygon as usize,
        b: group[1].polygon as usize,
        disagree: group[0].ascending == group[1].ascending,
    };
    let pairs: Vec<Neighbours> = groups().map(pair).collect();
    let Some((component, count)) = orient(surfaces.len(), &pairs, &mut out.turn) else {
        out.turn.fill(false);
        out.found.push((DefectCode::NonManifold, "the surface has only one side".to_owned()));
        return out;
    };
    if count > 1 {
        out.found.push((DefectCode::MultipleComponents, format!("{count}")));
    }
    turn_outwards(surfaces, &component, count, outer, position, &mut out.turn);
    let turned = out.turn.iter().filter(|&&turn| turn).count();
    if turned == surfaces.len() {
        out.found.push((DefectCode::WrongOrientationShell, String::new()));
    } else if turned > 0 {
        out.found.push((DefectCode::WrongOrientation, format!("{turned} of {}", surfaces.len())));
    }
    out
}

/// Checks surfaces that should be connected without enclosing a volume.
pub(crate) fn check_sheet(surfaces: &[&SurfacePolygon]) -> Vec<(DefectCode, String)> {
    let edges = sorted_edges(surfaces);
    let crowded = edges.chunk_by(Edge::joins_the_same).filter(|group| group.len() > 2).count();
    let pieces = pieces(surfaces.len(), &edges);
    let mut found = Vec::new();
    if crowded > 0 {
        found.push((DefectCode::NonManifold, format!("{crowded} edges")));
    }
    if pieces > 1 {
        found.push((DefectCode::MultipleComponents, format!("{pieces}")));
    }
    found
}

fn sorted_edges(surfaces: &[&SurfacePolygon]) -> Vec<Edge> {
    let mut edges: Vec<Edge> = Vec::new();
    for (number, surface) in surfaces.iter().enumerate() {
        for ring in &surface.rings {
            let next = ring.iter().cycle().skip(1);
            let pairs = ring.iter().zip(next).filter(|(a, b)| a != b);
            let polygon = number as u32;
            edges.extend(pairs.map(|(&a, &b)| Edge { low: a.min(b), high: a.max(b), ascending: a < b, polygon }));
        }
    }
    edges.sort_unstable();
    edges
}

/// Counts the pieces that the polygons form when those that share an edge are joined.
fn pieces(count: usize, edges: &[Edge]) -> usize {
    let mut sets = DisjointSets::new(count);
    for pair in edges.windows(2).filter(|pair| pair[0].joins_the_same(&pair[1])) {
        sets.join(pair[0].polygon as usize, pair[1].polygon as usize);
    }
    sets.count()
}

/// Turns polygons until neighbours agree, and returns the connected component of each and the
/// number of components.
///
/// Returns `None` for a surface with only one side, such as a Möbius strip.
fn orient(count: usize, pairs: &[Neighbours], turn: &mut [bool]) -> Option<(Vec<usize>, usize)> {
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); count];
    for &Neighbours { a, b, disagree } in pairs {
        neighbours[a].push((b, disagree));
        neighbours[b].push((a, disagree));
    }
    let mut component = vec![usize::MAX; count];
    let mut components = 0;
    for start in 0..count {
        if component[start] != usize::MAX {
            continue;
        }
        component[start] = components;
        let mut open = vec![start];
        while let Some(at) = open.pop() {
            for &(next, disagree) in &neighbours[at] {
                if component[next] == usize::MAX {
                    component[next] = components;
                    turn[next] = turn[at] ^ disagree;
                    open.push(next);
                } else if turn[next] != turn[at] ^ disagree {
                    return None;
                }
            }
        }
        components += 1;
    }
    Some((component, components))
}

/// Turns each component as a whole so that an outer shell faces away from its volume, and a cavity
/// towards it.
fn turn_outwards(
    surfaces: &[&SurfacePolygon],
    component: &[usize],
    count: usize,
    outer: bool,
    position: impl Fn(u32) -> Vector,
    turn: &mut [bool],
) {
    let mut volume = vec![0.0; count];
    let reference = surfaces.iter().find_map(|s| s.rings.first()?.first()).map_or([0.0; 3], |&i| position(i));
    for ((surface, &component), &turned) in surfaces.iter().zip(component).zip(turn.iter()) {
        let part = flux(surface, reference, &position);
        volume[component] += if turned { -part } else { part };
    }
    for (turn, &component) in turn.iter_mut().zip(component) {
        *turn ^= (volume[component] < 0.0) == outer && volume[component] != 0.0;
    }
}

/// Returns six times the volume of the cone from `reference` to a polygon, positive when the
/// polygon faces away from it.
fn flux(surface: &SurfacePolygon, reference: Vector, position: &impl Fn(u32) -> Vector) -> f64 {
    let of_ring = |ring: &Vec<u32>| {
        let Some(&first) = ring.first() else { return 0.0 };
        let at = |i: u32| sub(position(i), reference);
        let start = at(first);
        let area = ring
            .windows(2)
            .fold([0.0; 3], |sum, pair| add_cross(sum, sub(at(pair[0]), start), sub(at(pair[1]), start)));
        dot(area, start)
    };
    surface.rings.iter().map(of_ring).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfaceClass;

    const CORNERS: [Vector; 8] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
    ];
    const CUBE: [[u32; 4]; 6] = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

    fn checked(faces: &[Vec<u32>], outer: bool) -> (Vec<bool>, Vec<u16>) {
        let surfaces: Vec<SurfacePolygon> =
            faces.iter().map(|ring| SurfacePolygon::new(vec![ring.clone()], SurfaceClass::Wall)).collect();
        let check = check(&surfaces.iter().collect::<Vec<_>>(), outer, |i| {
            let corner = CORNERS[i as usize % 8];
            [corner[0] + 50.0 * f64::from(i / 8), corner[1] + 70.0, corner[2] - 9.0]
        });
        (check.turn, check.found.iter().map(|(code, _)| code.number()).collect())
    }

    fn cube() -> Vec<Vec<u32>> {
        CUBE.iter().map(|face| face.to_vec()).collect()
    }

    #[test]
    fn a_cube_is_closed_and_looks_outwards() {
        assert_eq!(checked(&cube(), true), (vec![false; 6], vec![]));
        assert_eq!(checked(&cube(), false), (vec![true; 6], vec![405]));
    }

    #[test]
    fn wrong_faces_are_turned() {
        let mut faces = cube();
        faces[2].reverse();
        assert_eq!(checked(&faces, true), (vec![false, false, true, false, false, false], vec![307]));
        faces.iter_mut().for_each(|face| face.reverse());
        assert_eq!(checked(&faces, true).0, [true, true, false, true, true, true]);
    }

    #[test]
    fn open_and_crowded_shells_are_left_alone() {
        let mut faces = cube();
        faces[2].reverse();
        let lid = faces.pop().unwrap();
        assert_eq!(checked(&faces, true), (vec![false; 5], vec![302]));
        faces.extend([lid.clone(), lid]);
        assert_eq!(checked(&faces, true).1, [303]);
        assert_eq!(checked(&faces[..3], true).1, [301]);
    }

    #[test]
    fn a_sheet_hangs_together_and_branches_nowhere() {
        let codes = |faces: &[Vec<u32>]| -> Vec<u16> {
            let surfaces: Vec<SurfacePolygon> =
                faces.iter().map(|ring| SurfacePolygon::new(vec![ring.clone()], SurfaceClass::Roof)).collect();
            let found = check_sheet(&surfaces.iter().collect::<Vec<_>>());
            found.iter().map(|(code, _)| code.number()).collect()
        };
        let mut faces = cube();
        assert_eq!(codes(&faces[..3]), [0u16; 0]);
        assert_eq!(codes(&faces[..2]), [305]);
        faces.push(vec![0, 1, 6, 7]);
        assert_eq!(codes(&faces), [303]);
    }

    #[test]
    fn pieces_are_turned_each_by_itself() {
        let mut faces = cube();
        faces.extend(CUBE.iter().map(|face| face.iter().rev().map(|i| i + 8).collect::<Vec<_>>()));
        let (turn, codes) = checked(&faces, true);
        assert_eq!(codes, [305, 307]);
        assert!(turn[..6].iter().all(|t| !t) && turn[6..].iter().all(|&t| t));
    }
}
