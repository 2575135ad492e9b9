//! The walls of a surface as upright faces: flat, between an upper and a lower edge, from the lines
//! that the crate `occlusion` finds between the cells.
//!
//! Points of a line are left out as long as plan, upper and lower edge stay within a tolerance
//! (Douglas and Peucker 1973), so that a straight façade is one face. Faces of one line share their
//! corners: there is no gap between them.

use occlusion::{OcclusionSurface, WallLine};

use super::SplatSurface;
use super::surface::SLOPE_MAX;

/// Notches of the upper edge and bumps of the lower one up to twice this length are closed, cells:
/// a parapet thinner than the cells is missing in one or two of them.
const NOTCH_CELLS: f64 = 1.5;
/// How fast a wall leaves its last face where it stops. That is where its step becomes a slope, or
/// where the next cells' pattern puts it a little aside: no corner that stands out.
const STOP: f64 = 0.25;

/// An upright face in local positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Facade {
    /// Both ends in plan, easting and northing.
    pub(super) ends: [[f64; 2]; 2],
    /// Heights of the lower edge at both ends.
    pub(super) lower: [f64; 2],
    /// Heights of the upper edge at both ends.
    pub(super) upper: [f64; 2],
    /// Unit vector in plan towards the lower side.
    pub(super) outward: [f64; 2],
    /// How fast the wall leaves this face at both ends, metres per metre: it turns back behind it,
    /// or its upper edge falls below it. 1 where it turns by a right angle or more, 0 where it goes
    /// on, turns forwards or rises, [`STOP`] where it stops.
    pub(super) turn: [f64; 2],
    /// Number of the line.
    pub(super) line: usize,
}

impl Facade {
    /// Length in plan, metres.
    pub(super) fn length(&self) -> f64 {
        let [a, b] = self.ends;
        (b[0] - a[0]).hypot(b[1] - a[1])
    }

    /// Position at a share of the length and a share of the way from the upper to the lower edge.
    pub(super) fn position(&self, along: f64, down: f64) -> [f64; 3] {
        let mix = |values: [f64; 2]| values[0] + along * (values[1] - values[0]);
        let (upper, lower) = (mix(self.upper), mix(self.lower));
        let [a, b] = self.ends;
        [a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1]), upper + down * (lower - upper)]
    }

    /// Mean height between the edges, metres.
    pub(super) fn mean_height(&self) -> f64 {
        0.5 * (self.upper[0] + self.upper[1] - self.lower[0] - self.lower[1])
    }
}

/// Returns the faces of all walls of a surface, within `tolerance_m` of their lines. Walls that are
/// nowhere higher than the steepest slope of a splat over one cell are left to those splats.
pub(super) fn facades(surface: &SplatSurface<'_>, obstacle: &OcclusionSurface<'_>, tolerance_m: f64) -> Vec<Facade> {
    let (along_columns, along_rows) = surface.geotransform().cell_size();
    let least = (SLOPE_MAX * (along_columns * along_rows).sqrt()) as f32;
    let lines: Vec<WallLine> = obstacle.wall_lines();
    let high = lines.iter().filter(|line| line.points.iter().any(|point| point.upper_m - point.lower_m > least));
    high.enumerate().flat_map(|(number, line)| of_line(surface, line, number, tolerance_m)).collect()
}

/// A point of a line in local metres: easting, northing, lower and upper height.
type Corner = [f64; 4];

fn of_line(surface: &SplatSurface<'_>, line: &WallLine, number: usize, tolerance_m: f64) -> Vec<Facade> {
    let local = |height: f32| f64::from(height) - surface.origin()[2];
    let corner = |point: &occlusion::WallPoint| {
        let [x, y, lower] = surface.position(point.place[0], point.place[1], local(point.lower_m));
        let upper = local(point.upper_m).min(highest_around(surface, point.place)).max(lower);
        [x, y, lower, upper]
    };
    let mut corners: Vec<Corner> = line.points.iter().map(corner).collect();
    let (width, height) = surface.geotransform().cell_size();
    close_notches(&mut corners, line.is_closed, NOTCH_CELLS * 0.5 * (width + height));
    let kept = if line.is_closed { closed(&corners, tolerance_m) } else { simplified(&corners, tolerance_m) };
    let count = kept.len();
    let pairs = (0..if line.is_closed { count } else { count - 1 }).map(|k| (kept[k], kept[(k + 1) % count]));
    let mut faces: Vec<Facade> = pairs.filter_map(|(a, b)| face(surface, a, b, number)).collect();
    let count = faces.len();
    for k in 0..count {
        let follows = if k + 1 < count || line.is_closed { Some((k + 1) % count) } else { None };
        if let Some(next) = follows {
            let (here, there) = (faces[k], faces[next]);
            let (back, ahead) = (direction(&here), direction(&there));
            let is_sharp = back[0] * ahead[0] + back[1] * ahead[1] < 0.0;
            // The next face turns away from the lower side: this one's end would stand before it.
            let sine = -(ahead[0] * here.outward[0] + ahead[1] * here.outward[1]);
            let turn = if is_sharp && sine > 0.0 { 1.0 } else { sine.max(0.0) };
            let turn = turn.max(rise(&here) - rise(&there)).min(1.0);
            (faces[k].turn[1], faces[next].turn[0]) = (turn, turn);
        }
    }
    faces
}

/// Returns the height of the highest of the 16 cells around a place. The plane that goes on from a
/// roof to its wall rises above a parapet of one cell.
fn highest_around(surface: &SplatSurface<'_>, place: [f64; 2]) -> f64 {
    let [column, row] = place.map(|c| c.floor() as i64 - 1);
    let around = (0..16).map(|k| surface.local_height(column + k % 4, row + k / 4));
    around.fold(f64::NEG_INFINITY, f64::max)
}

/// Rise of the upper edge along a face, metres per metre.
fn rise(face: &Facade) -> f64 {
    (face.upper[1] - face.upper[0]) / face.length()
}

fn direction(face: &Facade) -> [f64; 2] {
    let ([a, b], length) = (face.ends, face.length());
    [(b[0] - a[0]) / length, (b[1] - a[1]) / length]
}

/// Returns the face between two corners; `None` for one without extent.
fn face(surface: &SplatSurface<'_>, a: Corner, b: Corner, line: usize) -> Option<Facade> {
    let (x, y) = (b[0] - a[0], b[1] - a[1]);
    let length = x.hypot(y);
    if length < 1e-6 || a[3] + b[3] - a[2] - b[2] < 1e-6 {
        return None;
    }
    // To the right on a grid with rows downwards: on the map too, unless the grid is mirrored.
    let [[cx, cy], [rx, ry]] = surface.steps();
    let sign = if cx * ry - cy * rx < 0.0 { 1.0 } else { -1.0 };
    Some(Facade {
        ends: [[a[0], a[1]], [b[0], b[1]]],
        lower: [a[2].min(a[3]), b[2].min(b[3])],
        upper: [a[3], b[3]],
        outward: [sign * y / length, -sign * x / length],
        turn: [STOP; 2],
        line,
    })
}

/// Closes notches of the upper edge and bumps of the lower edge that are shorter than twice
/// `reach_m` (a morphological closing along the line).
fn close_notches(corners: &mut [Corner], is_closed: bool, reach_m: f64) {
    let count = corners.len();
    let step =
        |k: usize| (corners[(k + 1) % count][0] - corners[k][0]).hypot(corners[(k + 1) % count][1] - corners[k][1]);
    let steps: Vec<f64> = (0..count).map(step).collect();
    // Numbers of the corners within reach of each, itself first.
    let mut within: Vec<Vec<usize>> = (0..count).map(|k| vec![k]).collect();
    for from in 0..count {
        let (mut at, mut reached) = (from, steps[from]);
        while reached <= reach_m && (is_closed || at + 1 < count) {
            at = (at + 1) % count;
            if at == from {
                break;
            }
            within[from].push(at);
            within[at].push(from);
            reached += steps[at];
        }
    }
    for (edge, outwards) in [(2, f64::min as fn(f64, f64) -> f64), (3, f64::max)] {
        let inwards = if edge == 2 { f64::max } else { f64::min };
        for pick in [outwards, inwards] {
            let values: Vec<f64> = corners.iter().map(|corner| corner[edge]).collect();
            for (corner, near) in corners.iter_mut().zip(&within) {
                corner[edge] = near.iter().map(|&k| values[k]).fold(corner[edge], pick);
            }
        }
    }
}

/// Leaves out corners of a closed line.
fn closed(corners: &[Corner], tolerance_m: f64) -> Vec<Corner> {
    let farthest = |from: usize| {
        let distance = |k: usize| (corners[k][0] - corners[from][0]).hypot(corners[k][1] - corners[from][1]);
        (0..corners.len()).fold(0, |best, k| if distance(k) > distance(best) { k } else { best })
    };
    // A corner of the outline to begin with, and the one across.
    let first = farthest(0);
    let second = farthest(first);
    let around: Vec<Corner> = (0..=corners.len()).map(|k| corners[(first + k) % corners.len()]).collect();
    let across = (second + corners.len() - first) % corners.len();
    let mut kept = simplified(&around[..=across], tolerance_m);
    kept.pop();
    kept.extend(simplified(&around[across..], tolerance_m));
    kept.pop();
    kept
}

/// Leaves out corners between the first and the last.
fn simplified(corners: &[Corner], tolerance_m: f64) -> Vec<Corner> {
    let mut is_kept = vec![false; corners.len()];
    let last = corners.len() - 1;
    (is_kept[0], is_kept[last]) = (true, true);
    let mut parts = vec![(0, last)];
    while let Some((from, to)) = parts.pop() {
        let deviations = (from + 1..to).map(|k| (k, deviation(&corners[k], &corners[from], &corners[to])));
        let worst = deviations.fold((from, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst });
        if worst.1 > tolerance_m {
            is_kept[worst.0] = true;
            parts.extend([(from, worst.0), (worst.0, to)]);
        }
    }
    corners.iter().zip(is_kept).filter(|(_, kept)| *kept).map(|(corner, _)| *corner).collect()
}

/// Largest distance of a corner from the face between two others: in plan and along both edges.
fn deviation(corner: &Corner, from: &Corner, to: &Corner) -> f64 {
    let by = [to[0] - from[0], to[1] - from[1]];
    let length2 = by[0] * by[0] + by[1] * by[1];
    let off = [corner[0] - from[0], corner[1] - from[1]];
    let along = if length2 > 0.0 { ((off[0] * by[0] + off[1] * by[1]) / length2).clamp(0.0, 1.0) } else { 0.0 };
    let plan = (off[0] - along * by[0]).hypot(off[1] - along * by[1]);
    (2..4).map(|k| (corner[k] - from[k] - along * (to[k] - from[k])).abs()).fold(plan, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::{GeoTransform, Grid};

    /// A house of 26 × 16 cells of half a metre under a gable roof, turned by 17°.
    fn house() -> Grid<f32> {
        let (sin, cos) = 17.0f64.to_radians().sin_cos();
        let height = |i: usize| {
            let (c, r) = ((i % 48) as f64 - 23.6, (i / 48) as f64 - 23.7);
            let (a, b) = (cos * c + sin * r, cos * r - sin * c);
            if a.abs() < 13.0 && b.abs() < 8.0 { 7.0 - 0.2 * b.abs() as f32 } else { 0.0 }
        };
        Grid::from_vec(48, 48, (0..48 * 48).map(height).collect()).unwrap()
    }

    #[test]
    fn a_house_has_few_faces_that_look_outwards() {
        let heights = house();
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(300.0, 200.0, 0.5), [312.0, 188.0, 0.0]);
        let faces = facades(&surface, &OcclusionSurface::new(&heights, 0.5), 0.25);
        assert!((6..=9).contains(&faces.len()), "{faces:?}");
        let middle = surface.position(23.6, 23.7, 0.0);
        for (k, face) in faces.iter().enumerate() {
            let [x, y, _] = face.position(0.5, 0.5);
            let out = (x - middle[0]) * face.outward[0] + (y - middle[1]) * face.outward[1];
            assert!(out > 3.0, "{face:?}");
            assert_eq!(face.ends[1], faces[(k + 1) % faces.len()].ends[0]);
            assert!(face.lower == [0.0; 2] && face.upper.iter().all(|h| (5.0..7.2).contains(h)), "{face:?}");
        }
        // Once around, and over both gables.
        let around: f64 = faces.iter().map(|face| face.turn[1].asin().to_degrees()).sum();
        // At both ridges the upper edge leaves a face by 0.8 m per metre: an angle of 53°.
        assert!((around - 466.0).abs() < 30.0, "{around}");
        let length: f64 = faces.iter().map(Facade::length).sum();
        assert!((length - 42.0).abs() < 1.5, "{length}");
    }
}
