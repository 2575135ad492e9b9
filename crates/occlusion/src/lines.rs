//! The walls of a surface model as lines on its grid.
//!
//! Among four cells a wall is where the signed distance of its form is zero. Marching squares on a
//! lattice of eight meshes per cell follow it. A line goes on among the next four cells where their
//! wall crosses the side between them nearest, between about the same heights; the two crossings
//! are joined in their middle.

use std::collections::{HashMap, HashSet};

use raster::Grid;
use rayon::prelude::*;

use super::wall::{Parting, Walls};

/// Meshes per cell.
const MESHES: usize = 8;
/// Greatest distance of two crossings of one side that are joined, cells.
const JOINED: f32 = 0.5;

/// A wall in plan. In the picture of the grid, columns to the right and rows downwards, the lower
/// side is to the right of the way from point to point.
#[derive(Debug, Clone, PartialEq)]
pub struct WallLine {
    /// The points of the line, at least two.
    pub points: Vec<WallPoint>,
    /// Whether the last point leads to the first.
    pub is_closed: bool,
}

/// A point of a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallPoint {
    /// Column and row.
    pub place: [f64; 2],
    /// Height of the surface on the lower side, metres.
    pub lower_m: f32,
    /// Height of the surface on the upper side, metres.
    pub upper_m: f32,
}

/// A side between two neighbouring cell centres: whether it leads downwards, its first centre.
type Side = (bool, usize, usize);

/// A line among four cells.
struct Piece {
    points: Vec<WallPoint>,
    /// Where it enters and leaves the four cells: the side, and the place along it. `None` for an
    /// end among them.
    ends: [Option<(Side, f32)>; 2],
    is_closed: bool,
}

/// Follows all walls.
pub(super) fn trace(walls: &Walls, cells: &Grid<f32>) -> Vec<WallLine> {
    let (width, height) = (cells.width(), cells.height());
    if width < 2 || height < 2 {
        return Vec::new();
    }
    let row_of_pieces = |row: usize| {
        let among = (0..width - 1).flat_map(|column| {
            let partings = walls.parting(cells, (column, row));
            partings.into_iter().flat_map(move |parting| pieces(&parting, [column, row])).collect::<Vec<_>>()
        });
        among.collect::<Vec<Piece>>()
    };
    let pieces: Vec<Piece> =
        (0..height - 1).into_par_iter().map(row_of_pieces).collect::<Vec<_>>().into_iter().flatten().collect();
    let next = joints(&pieces, walls.step_m());
    lines(&pieces, &next)
}

/// Returns the lines of one wall among the four cells of which the first is at `corner`.
fn pieces(parting: &Parting<'_>, corner: [usize; 2]) -> Vec<Piece> {
    let segments = segments(parting);
    let from: HashMap<Crossing, usize> = segments.iter().enumerate().map(|(k, s)| (s[0], k)).collect();
    let ends: HashSet<Crossing> = segments.iter().map(|s| s[1]).collect();
    let mut taken = vec![false; segments.len()];
    let mut found = Vec::new();
    // Open lines begin where no segment ends; what is left is closed.
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by_key(|&k| ends.contains(&segments[k][0]));
    for first in order {
        if taken[first] {
            continue;
        }
        let mut way = vec![segments[first][0]];
        let mut at = Some(first);
        while let Some(k) = at.filter(|&k| !taken[k]) {
            taken[k] = true;
            way.push(segments[k][1]);
            at = from.get(&segments[k][1]).copied();
        }
        let is_closed = way.len() > 2 && way.first() == way.last();
        if is_closed {
            way.pop();
        }
        let places: Vec<[f32; 2]> = way.iter().map(|crossing| crossing.place(parting)).collect();
        let point = |place: &[f32; 2]| {
            let [lower_m, upper_m] = parting.heights_at(*place);
            let place = [0, 1].map(|i| corner[i] as f64 + f64::from(place[i]));
            WallPoint { place, lower_m, upper_m }
        };
        let end = |k: usize| (!is_closed).then(|| way[k].side(corner, places[k])).flatten();
        found.push(Piece { points: places.iter().map(point).collect(), ends: [end(0), end(way.len() - 1)], is_closed });
    }
    found
}

/// A side of a mesh that a wall crosses: whether it leads downwards, its first node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Crossing {
    down: bool,
    node: [usize; 2],
}

impl Crossing {
    /// Where the signed distance is zero on the side, linearly.
    fn place(&self, parting: &Parting<'_>) -> [f32; 2] {
        let from = node_place(self.node);
        let to = node_place([self.node[0] + usize::from(!self.down), self.node[1] + usize::from(self.down)]);
        let (a, b) = (parting.side_at(from), parting.side_at(to));
        let share = if a == b { 0.5 } else { (a / (a - b)).clamp(0.0, 1.0) };
        [0, 1].map(|i| from[i] + share * (to[i] - from[i]))
    }

    /// The side between cell centres that the crossing is on, and its place along it.
    fn side(&self, [column, row]: [usize; 2], place: [f32; 2]) -> Option<(Side, f32)> {
        match (self.down, self.node) {
            (true, [0, _]) => Some(((true, column, row), place[1])),
            (true, [MESHES, _]) => Some(((true, column + 1, row), place[1])),
            (false, [_, 0]) => Some(((false, column, row), place[0])),
            (false, [_, MESHES]) => Some(((false, column, row + 1), place[0])),
            _ => None,
        }
    }
}

fn node_place(node: [usize; 2]) -> [f32; 2] {
    node.map(|i| i as f32 / MESHES as f32)
}

/// Returns the segments of one wall, each from crossing to crossing.
fn segments(parting: &Parting<'_>) -> Vec<[Crossing; 2]> {
    const NODES: usize = MESHES + 1;
    let is_upper: Vec<bool> =
        (0..NODES * NODES).map(|k| parting.side_at(node_place([k % NODES, k / NODES])) >= 0.0).collect();
    let mut found = Vec::new();
    for j in 0..MESHES {
        for i in 0..MESHES {
            let upper = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| is_upper[j * NODES + i]);
            let middle = [i, j].map(|k| (k as f32 + 0.5) / MESHES as f32);
            if upper == [upper[0]; 4] || !parting.reaches(middle) {
                continue;
            }
            let side = |down: bool, i: usize, j: usize| Crossing { down, node: [i, j] };
            let sides = [side(false, i, j), side(true, i + 1, j), side(false, i, j + 1), side(true, i, j)];
            // Once around: a segment begins where the upper side begins and ends where it ends.
            let begins: Vec<usize> = (0..4).filter(|&k| !upper[k] && upper[(k + 1) % 4]).collect();
            for &begin in &begins {
                // Where both diagonals differ, the middle tells which corners belong together.
                let joined = begins.len() == 2 && parting.side_at(middle) >= 0.0;
                let end = (1..4).map(|step| (if joined { begin + 4 - step } else { begin + step }) % 4);
                let end = end.into_iter().find(|&k| upper[k] && !upper[(k + 1) % 4]);
                found.extend(end.map(|end| [sides[begin], sides[end]]));
            }
        }
    }
    found
}

/// Returns for each piece the one that its line goes on with.
fn joints(pieces: &[Piece], step_m: f32) -> Vec<Option<usize>> {
    let mut arrivals: HashMap<Side, Vec<usize>> = HashMap::new();
    for (k, piece) in pieces.iter().enumerate() {
        if let Some((side, _)) = piece.ends[0] {
            arrivals.entry(side).or_default().push(k);
        }
    }
    let mut pairs: Vec<(f32, usize, usize)> = Vec::new();
    for (k, piece) in pieces.iter().enumerate() {
        let (Some((side, at)), Some(leaving)) = (piece.ends[1], piece.points.last()) else { continue };
        for &other in arrivals.get(&side).into_iter().flatten() {
            let (Some((_, beginning)), Some(entering)) = (pieces[other].ends[0], pieces[other].points.first()) else {
                continue;
            };
            let alike = (leaving.lower_m - entering.lower_m).abs() <= step_m
                && (leaving.upper_m - entering.upper_m).abs() <= step_m;
            if alike && (at - beginning).abs() <= JOINED {
                pairs.push(((at - beginning).abs(), k, other));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut next = vec![None; pieces.len()];
    let mut is_entered = vec![false; pieces.len()];
    for (_, from, to) in pairs {
        if next[from].is_none() && !is_entered[to] {
            (next[from], is_entered[to]) = (Some(to), true);
        }
    }
    next
}

/// Puts pieces together to lines, in the order of their first pieces.
fn lines(pieces: &[Piece], next: &[Option<usize>]) -> Vec<WallLine> {
    let mut is_entered = vec![false; pieces.len()];
    next.iter().flatten().for_each(|&to| is_entered[to] = true);
    let mut taken = vec![false; pieces.len()];
    let mut found = Vec::new();
    let open = (0..pieces.len()).filter(|&k| !is_entered[k]);
    for first in open.collect::<Vec<_>>().into_iter().chain(0..pieces.len()) {
        if taken[first] {
            continue;
        }
        let mut points: Vec<WallPoint> = Vec::new();
        let mut at = Some(first);
        let mut is_closed = pieces[first].is_closed;
        while let Some(k) = at {
            if taken[k] {
                is_closed = k == first;
                break;
            }
            taken[k] = true;
            append(&mut points, &pieces[k].points);
            at = next[k];
        }
        if is_closed && next[first].is_some() {
            // The last point and the first are the two crossings of one side.
            if let Some(last) = points.pop() {
                points[0] = between(&last, &points[0]);
            }
        }
        if points.len() > 1 {
            found.push(WallLine { points, is_closed });
        }
    }
    found
}

/// Adds points to a line whose last point is the other crossing of the side where they begin.
fn append(points: &mut Vec<WallPoint>, more: &[WallPoint]) {
    match (points.last_mut(), more.first()) {
        (Some(last), Some(first)) => {
            *last = between(last, first);
            points.extend_from_slice(&more[1..]);
        }
        _ => points.extend_from_slice(more),
    }
}

fn between(a: &WallPoint, b: &WallPoint) -> WallPoint {
    WallPoint {
        place: [0, 1].map(|i| 0.5 * (a.place[i] + b.place[i])),
        lower_m: 0.5 * (a.lower_m + b.lower_m),
        upper_m: 0.5 * (a.upper_m + b.upper_m),
    }
}

#[cfg(test)]
mod tests {
    use crate::OcclusionSurface;
    use proptest::prelude::*;
    use raster::Grid;

    const SIZE: usize = 48;

    /// Cells of half a metre: 7 m above the ground where `is_high`.
    fn cells(is_high: impl Fn(f64, f64) -> bool) -> Grid<f32> {
        let at = |i: usize| if is_high((i % SIZE) as f64, (i / SIZE) as f64) { 7.0 } else { 0.0 };
        Grid::from_vec(SIZE, SIZE, (0..SIZE * SIZE).map(at).collect()).unwrap()
    }

    /// (along, across) from the middle, in cells, turned.
    fn turned(c: f64, r: f64, degrees: f64) -> [f64; 2] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [cos * (c - 23.6) + sin * (r - 23.7), cos * (r - 23.7) - sin * (c - 23.6)]
    }

    #[test]
    fn a_house_is_one_closed_line_along_its_outline() {
        for degrees in [0.0, 17.0, 38.0, 45.0] {
            let cells = cells(|c, r| {
                let [a, b] = turned(c, r, degrees);
                a.abs() < 13.0 && b.abs() < 8.0
            });
            let lines = OcclusionSurface::new(&cells, 0.5).wall_lines();
            assert_eq!(lines.len(), 1, "{degrees}");
            assert!(lines[0].is_closed);
            let outside = |p: [f64; 2]| {
                let [a, b] = turned(p[0], p[1], degrees);
                (a.abs() - 13.0).max(b.abs() - 8.0)
            };
            let points = &lines[0].points;
            // Along the grid and its diagonals the pattern does not tell where between the rows of
            // centres a wall stands; at a corner few centres do.
            let off: Vec<f64> = points.iter().map(|p| outside(p.place).abs()).collect();
            assert!(off.iter().all(|off| *off < 0.55), "{degrees}");
            let is_along_centres = degrees % 45.0 == 0.0;
            assert!(is_along_centres || off.iter().sum::<f64>() / (off.len() as f64) < 0.1, "{degrees}");
            // The lower side is to the right of the way: around the house in the sense of the rows.
            let area: f64 = (0..points.len())
                .map(|k| {
                    let ([x, y], [u, v]) = (points[k].place, points[(k + 1) % points.len()].place);
                    0.5 * (x * v - y * u)
                })
                .sum();
            assert!((area + 26.0 * 16.0).abs() < 20.0, "{degrees}: {area}");
        }
    }

    proptest! {
        /// Whatever the heights: points are on the grid, one step from the next, and the upper side
        /// is above the lower one on most of a line.
        #[test]
        fn lines_of_any_surface_hold_together(values in prop::collection::vec(0..5u8, 12 * 12)) {
            let cells = Grid::from_vec(12, 12, values.iter().map(|v| f32::from(*v) * 1.5).collect()).unwrap();
            for line in OcclusionSurface::new(&cells, 0.5).wall_lines() {
                prop_assert!(line.points.len() > 1);
                for pair in line.points.windows(2) {
                    let step = (pair[0].place[0] - pair[1].place[0]).hypot(pair[0].place[1] - pair[1].place[1]);
                    prop_assert!(step < 0.7, "{step}");
                }
                prop_assert!(line.points.iter().all(|p| p.place.iter().all(|c| (0.0..=11.0).contains(c))));
                prop_assert!(line.points.iter().all(|p| p.lower_m.is_finite() && p.upper_m.is_finite()));
            }
        }
    }
}
