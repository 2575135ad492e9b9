//! The shells of solids: closed or not, and which of their polygons look the wrong way.
//!
//! Every edge of a closed shell is used by two polygons, once in each direction. Where that holds but for the directions,
//! the polygons are turned until it does, and the sign of the enclosed volume says which side is out.

use crate::sets::DisjointSets;
use crate::{DefectCode, Surface};
use numeric::vector::{Vector, add_cross, dot, sub};

/// What was found out about a shell.
#[derive(Debug, Default)]
pub(crate) struct ShellCheck {
    /// Which of the surfaces are to be turned around.
    pub(crate) turn: Vec<bool>,
    /// Defects of the shell with details; wrong orientations are repaired by `turn`.
    pub(crate) found: Vec<(DefectCode, String)>,
}

/// An edge of a polygon: its vertices ascending, whether it runs that way, and the polygon.
type Edge = (u32, u32, bool, u32);

/// Checks a shell of `surfaces`; `outer` is false for the shell of a cavity.
pub(crate) fn check(surfaces: &[&Surface], outer: bool, position: impl Fn(u32) -> Vector) -> ShellCheck {
    let mut out = ShellCheck { turn: vec![false; surfaces.len()], found: Vec::new() };
    if surfaces.len() < 4 {
        out.found.push((DefectCode::TooFewPolygons, format!("{}", surfaces.len())));
        return out;
    }
    let edges = sorted_edges(surfaces);
    let groups = || edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
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
    let pairs: Vec<(usize, usize, bool)> =
        groups().map(|g| (g[0].3 as usize, g[1].3 as usize, g[0].2 == g[1].2)).collect();
    let Some((component, count)) = orient(surfaces.len(), &pairs, &mut out.turn) else {
        out.turn.fill(false);
        out.found.push((DefectCode::NonManifold, "the surface has one side only".to_owned()));
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

/// What is wrong with surfaces that claim to be connected, but to enclose nothing.
pub(crate) fn check_sheet(surfaces: &[&Surface]) -> Vec<(DefectCode, String)> {
    let edges = sorted_edges(surfaces);
    let crowded = edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|group| group.len() > 2).count();
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

fn sorted_edges(surfaces: &[&Surface]) -> Vec<Edge> {
    let mut edges: Vec<Edge> = Vec::new();
    for (number, surface) in surfaces.iter().enumerate() {
        for ring in &surface.rings {
            let next = ring.iter().cycle().skip(1);
            let pairs = ring.iter().zip(next).filter(|(a, b)| a != b);
            edges.extend(pairs.map(|(&a, &b)| (a.min(b), a.max(b), a < b, number as u32)));
        }
    }
    edges.sort_unstable();
    edges
}

/// How many pieces polygons form that hang together by edges.
fn pieces(count: usize, edges: &[Edge]) -> usize {
    let mut sets = DisjointSets::new(count);
    for pair in edges.windows(2).filter(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1)) {
        sets.join(pair[0].3 as usize, pair[1].3 as usize);
    }
    sets.count()
}

/// Turns polygons until neighbours agree; the connected component of each and how many there are.
///
/// `None` for a surface with one side, such as a Möbius strip.
fn orient(count: usize, pairs: &[(usize, usize, bool)], turn: &mut [bool]) -> Option<(Vec<usize>, usize)> {
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); count];
    for &(a, b, against) in pairs {
        neighbours[a].push((b, against));
        neighbours[b].push((a, against));
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
            for &(next, against) in &neighbours[at] {
                if component[next] == usize::MAX {
                    component[next] = components;
                    turn[next] = turn[at] ^ against;
                    open.push(next);
                } else if turn[next] != turn[at] ^ against {
                    return None;
                }
            }
        }
        components += 1;
    }
    Some((component, components))
}

fn turn_outwards(
    surfaces: &[&Surface],
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

/// Six times the volume of the cone from `reference` over a polygon, positive where it looks away.
fn flux(surface: &Surface, reference: Vector, position: &impl Fn(u32) -> Vector) -> f64 {
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
        let surfaces: Vec<Surface> =
            faces.iter().map(|ring| Surface::new(vec![ring.clone()], SurfaceClass::Wall)).collect();
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
            let surfaces: Vec<Surface> =
                faces.iter().map(|ring| Surface::new(vec![ring.clone()], SurfaceClass::Roof)).collect();
            let found = check_sheet(&surfaces.iter().collect::<Vec<_>>());
            found.iter().map(|(code, _)| code.number()).collect()
        };
        let mut faces = cube();
        assert_eq!(codes(&faces[..3]), []);
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
