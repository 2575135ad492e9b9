//! Finds self-intersections of a shell: triangles of different polygons that meet elsewhere than at
//! shared vertices.
//!
//! A sweep of bounding boxes along the longest side of the shell finds the candidates. An edge that
//! passes through a polygon within a millimetre of its border does not count, because rounding of
//! the coordinates can cause that.

use super::contact::{normal, shared_face};
use super::limits::{MAX_COMPARISONS, OVERLAP_M, SHELL_TOLERANCE_M};
use super::patch::{Bounds, Patch, distance, to_segment};
use numeric::vector::{Vector, dot, sub};

/// Counts the pairs of triangles that meet. Returns `None` when there are too many to compare.
pub(super) fn meetings(shell: &Patch) -> Option<usize> {
    let extent = sub(shell.bounds.high, shell.bounds.low);
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let mut boxes: Vec<(Bounds, usize)> =
        shell.corners.iter().enumerate().map(|(index, t)| (Bounds::of(*t), index)).collect();
    boxes.sort_by(|a, b| a.0.low[axis].total_cmp(&b.0.low[axis]).then(a.1.cmp(&b.1)));
    let shell = &Shell { patch: shell, borders: borders(shell) };
    let (mut found, mut comparisons) = (0, 0);
    for (position, (bounds, a)) in boxes.iter().enumerate() {
        for (other, b) in &boxes[position + 1..] {
            if other.low[axis] > bounds.high[axis] + SHELL_TOLERANCE_M {
                break;
            }
            comparisons += 1;
            if comparisons > MAX_COMPARISONS {
                return None;
            }
            let apart = shell.patch.polygon[*a] == shell.patch.polygon[*b] || !bounds.meets(other, SHELL_TOLERANCE_M);
            found += usize::from(!apart && meet(shell, *a, *b));
        }
    }
    Some(found)
}

/// A shell, and per triangle which of its edges are on the border of its polygon. Edge i begins at
/// corner i.
struct Shell<'a> {
    patch: &'a Patch,
    borders: Vec<[bool; 3]>,
}

fn borders(shell: &Patch) -> Vec<[bool; 3]> {
    let key = |triangle: usize, i: usize| {
        let (from, to) = (shell.vertices[triangle][i], shell.vertices[triangle][(i + 1) % 3]);
        (shell.polygon[triangle], from.min(to), from.max(to))
    };
    let mut edges: Vec<_> = (0..shell.vertices.len()).flat_map(|t| [0, 1, 2].map(|i| (key(t, i), t, i))).collect();
    edges.sort_unstable();
    let mut borders = vec![[false; 3]; shell.vertices.len()];
    for group in edges.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() == 1) {
        borders[group[0].1][group[0].2] = true;
    }
    borders
}

fn meet(shell: &Shell<'_>, a: usize, b: usize) -> bool {
    let (s, t) = (&shell.patch.corners[a], &shell.patch.corners[b]);
    goes_through(shell, a, b) || goes_through(shell, b, a) || shared_face(s, t, OVERLAP_M).is_some()
}

/// Returns whether a corner of triangle `a` lies on triangle `b`, or an edge of `a` passes through
/// it.
///
/// Corners that both triangles have do not count.
fn goes_through(&Shell { patch: shell, ref borders }: &Shell<'_>, a: usize, b: usize) -> bool {
    let (corners, triangle) = (&shell.corners[a], &shell.corners[b]);
    let Some(normal) = normal(triangle) else { return false };
    let heights = corners.map(|corner| dot(normal, sub(corner, triangle[0])));
    let of_both = shell.vertices[a].map(|vertex| shell.vertices[b].contains(&vertex));
    let on = |point: Vector| distance(point, triangle) <= SHELL_TOLERANCE_M;
    let rests = |i: usize| {
        let near_corner = |corner: &Vector| distance(corners[i], &[*corner; 3]) <= SHELL_TOLERANCE_M;
        !of_both[i] && heights[i].abs() <= SHELL_TOLERANCE_M && on(corners[i]) && !triangle.iter().any(near_corner)
    };
    let pierces = |i: usize, k: usize| {
        let (from, to) = (heights[i], heights[k]);
        let opposite = from.abs().min(to.abs()) > OVERLAP_M && from * to < 0.0;
        opposite && {
            let along = from / (from - to);
            let at = [0, 1, 2].map(|c| corners[i][c] + along * (corners[k][c] - corners[i][c]));
            let beside = |i: usize| borders[b][i] && to_segment(at, triangle[i], triangle[(i + 1) % 3]) <= OVERLAP_M;
            on(at) && !(0..3).any(beside)
        }
    };
    (0..3).any(rests) || [(0, 1), (1, 2), (2, 0)].into_iter().any(|(i, k)| pierces(i, k))
}
