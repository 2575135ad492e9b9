//! The cases of marching cubes, derived rather than listed.
//!
//! The surface crosses a face of a cube in segments. Going around a face, each run of corners
//! inside is cut off by one segment, from the edge where the run begins to the one where it ends.
//! Neighbours see the same face from the other side and cut it in the same places, so that the mesh
//! has no gaps. The segments of the six faces join to closed loops, which become fans of triangles.

/// Corners of a cube are numbered by bits: 1 for x, 2 for y, 4 for z.
pub(crate) const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];

/// Corners of the six faces, counter-clockwise seen from outside.
const FACES: [[u8; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// An edge of a cube: its corner next to the origin, and its axis.
pub(crate) type CubeEdge = (u8, u8);

/// Returns the triangles of a cube, as edges on which their corners lie. `inside` has a bit for
/// each corner inside. Triangles are counter-clockwise seen from outside.
pub(crate) fn triangles(inside: u8) -> Vec<[CubeEdge; 3]> {
    let is_inside = |corner: u8| inside >> corner & 1 == 1;
    let mut segments: Vec<(CubeEdge, CubeEdge)> = Vec::new();
    for face in FACES {
        let step = |at: usize| (face[at % 4], face[(at + 1) % 4]);
        for at in 0..4 {
            let (from, to) = step(at);
            if is_inside(from) || !is_inside(to) {
                continue;
            }
            // A run begins here. It ends where the next corner is outside again.
            let end = (at + 1..at + 4).find(|&end| !is_inside(step(end).1)).expect("a corner of the face is outside");
            segments.push((edge(from, to), edge(step(end).0, step(end).1)));
        }
    }
    let mut out = Vec::new();
    while let Some((first, mut last)) = segments.pop() {
        let mut ring = vec![first];
        while last != first {
            ring.push(last);
            let next = segments.iter().position(|segment| segment.0 == last).expect("segments join to loops");
            last = segments.swap_remove(next).1;
        }
        out.extend((1..ring.len() - 1).map(|k| [ring[0], ring[k], ring[k + 1]]));
    }
    out
}

fn edge(a: u8, b: u8) -> CubeEdge {
    (a.min(b), (a ^ b).trailing_zeros() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn middle((corner, axis): CubeEdge) -> [f64; 3] {
        let mut at = CORNERS[usize::from(corner)].map(|c| c as f64);
        at[usize::from(axis)] += 0.5;
        at
    }

    #[test]
    fn every_crossed_edge_is_used_and_triangles_look_outside() {
        for inside in 0..=255u8 {
            let found = triangles(inside);
            let crossed: std::collections::BTreeSet<CubeEdge> = (0..8u8)
                .flat_map(|a| (0..3).map(move |axis| (a, a | 1 << axis)))
                .filter(|(a, b)| a != b && (inside >> a & 1) != (inside >> b & 1))
                .map(|(a, b)| edge(a, b))
                .collect();
            let used: std::collections::BTreeSet<CubeEdge> = found.iter().flatten().copied().collect();
            assert_eq!(used, crossed, "case {inside:08b}");
        }
        for corner in 0..8u8 {
            let [triangle] = triangles(1 << corner)[..] else { panic!("one corner is cut off by one triangle") };
            let [a, b, c] = triangle.map(middle);
            let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let outwards = CORNERS[usize::from(corner)].map(|c| 0.5 - c as f64);
            assert!((0..3).map(|i| n[i] * outwards[i]).sum::<f64>() > 0.0, "corner {corner}");
        }
    }
}
