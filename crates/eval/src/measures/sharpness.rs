//! Overreach of roofs: how far the roofs of the test reach beyond those of the reference.
//!
//! A roof edge is a jump of the reference (see [`crate::EdgeRule`]) with level ground or roof on
//! both sides: beyond the two cells of the jump, three cells on either side stay within a quarter
//! of the jump. The profile across the edge runs along the row or column that is closer to the
//! edge's normal. The test's profile falls through the height half-way between the two levels at
//! some position; the reference's own profile falls between its two cells. The overreach is the
//! distance between the two positions, projected onto the normal, in metres. It is positive where
//! roofs are too large (the fattening of matching windows) and negative where they are too small.
//! An edge is not measured if the test is void there, or does not fall through that height within
//! [`REACH_M`].

use crate::alignment::align::MetresFromCells;
use crate::measures::edges::{Cell, EdgeRule, jumps};
use crate::measures::gradient::{gradients, steepness};
use crate::measures::statistics::ErrorStatistics;
use numeric::percentile;
use raster::Grid;
use serde::Serialize;

/// Distance from an edge within which the edge of the test is searched, metres. At least four cells
/// are searched.
pub const REACH_M: f64 = 5.0;
/// Lowest number of cells on either side in which the edge of the test is searched.
const LEAST_REACH_CELLS: isize = 4;
/// Highest number of cells on either side in which the edge of the test is searched.
const MOST_REACH_CELLS: isize = 64;
/// Number of cells on either side that must be level.
const LEVEL_CELLS: isize = 3;
/// Highest deviation from level, as a share of the jump.
const LEVEL_SHARE: f64 = 0.25;
/// Lowest cosine between the profile and the edge's normal.
const LEAST_COSINE: f64 = 0.7;

/// Overreach of a surface at the reference's roof edges.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sharpness {
    /// Number of positions on roof edges of the reference.
    pub edges: usize,
    /// Number of these positions where the test has an edge too.
    pub measured: usize,
    /// Overreach in metres, positive outwards. `None` if no position was measured.
    pub overreach_m: Option<ErrorStatistics>,
    /// Median of the overreach in cells. `None` if no position was measured.
    pub median_cells: Option<f64>,
}

/// Measures the overreach of `test`, which is aligned and on the reference grid. `roof` selects the
/// edges by their higher and their lower cell.
pub(crate) fn sharpness(
    reference: &Grid<f32>,
    test: &Grid<f32>,
    metres_from_cells: MetresFromCells,
    roof: impl Fn(Cell, Cell) -> bool,
) -> Sharpness {
    let gradients = gradients(reference, metres_from_cells);
    let rule = EdgeRule::of(metres_from_cells);
    let mut edges = 0;
    let (mut overreach, mut in_cells) = (Vec::new(), Vec::new());
    for (high, low) in jumps(reference, rule).filter(|&(high, low)| roof(high, low)) {
        let profile = Profile { high, step: (offset(high.0, low.0), offset(high.1, low.1)) };
        let Some((level, at)) = profile.edge(reference) else { continue };
        let Some((cosine, side_m)) = profile.metres(metres_from_cells, [gradients[high], gradients[low]]) else {
            continue;
        };
        edges += 1;
        let reach = ((REACH_M / side_m).ceil() as isize).clamp(LEAST_REACH_CELLS, MOST_REACH_CELLS);
        if let Some(found) = profile.crossing(test, level, at, reach) {
            overreach.push((found - at) * side_m * cosine);
            in_cells.push((found - at) * cosine);
        }
    }
    let median_cells = percentile(&mut in_cells, 50.0);
    Sharpness { edges, measured: overreach.len(), overreach_m: ErrorStatistics::of(&mut overreach), median_cells }
}

fn offset(from: usize, to: usize) -> isize {
    to as isize - from as isize
}

/// Profile across an edge, in a row or column. Cell 0 is the edge's higher cell, cell 1 its lower
/// one.
struct Profile {
    high: Cell,
    step: (isize, isize),
}

impl Profile {
    fn height(&self, grid: &Grid<f32>, number: isize) -> Option<f64> {
        let column = self.high.0.checked_add_signed(number * self.step.0)?;
        let row = self.high.1.checked_add_signed(number * self.step.1)?;
        grid.get(column, row).map(|&h| f64::from(h)).filter(|h| h.is_finite())
    }

    /// Returns the height half-way down the jump, and the position where the reference falls
    /// through it. Returns `None` if a side is not level, or if a jump over several cells falls
    /// through it between two other cells.
    fn edge(&self, reference: &Grid<f32>) -> Option<(f64, f64)> {
        let (inside, outside) = (self.height(reference, -1)?, self.height(reference, 2)?);
        let slack = LEVEL_SHARE * (inside - outside);
        let (mut top, mut foot) = (0.0, 0.0);
        for k in 0..LEVEL_CELLS {
            let (a, b) = (self.height(reference, -1 - k)?, self.height(reference, 2 + k)?);
            if (a - inside).abs() > slack || (b - outside).abs() > slack {
                return None;
            }
            (top, foot) = (top + a / LEVEL_CELLS as f64, foot + b / LEVEL_CELLS as f64);
        }
        let level = (top + foot) / 2.0;
        let (high, low) = (self.height(reference, 0)?, self.height(reference, 1)?);
        (high >= level && low < level).then(|| (level, (high - level) / (high - low)))
    }

    /// Returns the cosine between the profile and the edge's normal, and the distance of the
    /// profile's cells in metres.
    fn metres(&self, metres_from_cells: MetresFromCells, gradients: [[f32; 2]; 2]) -> Option<(f64, f64)> {
        let (x, y) = metres_from_cells.apply(self.step.0 as f64, self.step.1 as f64);
        let sum = [gradients[0][0] + gradients[1][0], gradients[0][1] + gradients[1][1]];
        let (side_m, steep) = (x.hypot(y), steepness(sum));
        let cosine = (x * f64::from(sum[0]) + y * f64::from(sum[1])).abs() / (side_m * steep);
        (cosine >= LEAST_COSINE).then_some((cosine, side_m))
    }

    /// Returns the position nearest to `at` where the heights fall through `level` outwards, in
    /// cells.
    fn crossing(&self, test: &Grid<f32>, level: f64, at: f64, reach: isize) -> Option<f64> {
        let fall = |number: isize| {
            let (inner, outer) = (self.height(test, number)?, self.height(test, number + 1)?);
            (inner >= level && outer < level).then(|| number as f64 + (inner - level) / (inner - outer))
        };
        (-reach..=reach).filter_map(fall).min_by(|a, b| (a - at).abs().total_cmp(&(b - at).abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::GeoTransform;

    const CELL: f64 = 0.5;

    /// Returns a roof of 30 × 24 m that is `grown` outwards and turned by an angle. Its rim falls
    /// over two cells, like a rim that a sensor blurs.
    fn roof(grown: f64, turn_deg: f64) -> Grid<f32> {
        let (sin, cos) = turn_deg.to_radians().sin_cos();
        let height = |i: usize| {
            let (x, y) = (((i % 120) as f64 - 59.5) * CELL, ((i / 120) as f64 - 59.5) * CELL);
            let (u, v) = (x * cos + y * sin, y * cos - x * sin);
            let outside = (u.abs() - 15.0 - grown).max(v.abs() - 12.0 - grown);
            (4.0 + 10.0 * (0.5 - outside / CELL).clamp(0.0, 1.0)) as f32
        };
        Grid::from_vec(120, 120, (0..120 * 120).map(height).collect()).unwrap()
    }

    fn metres() -> MetresFromCells {
        MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, CELL), (1.0, 1.0))
    }

    #[test]
    fn a_roof_that_is_too_large_reaches_out_by_as_much_in_every_direction() {
        for (grown, turn) in [(0.0, 0.0), (1.25, 0.0), (-0.75, 0.0), (1.25, 23.0), (-0.6, 40.0)] {
            let found = sharpness(&roof(0.0, turn), &roof(grown, turn), metres(), |_, _| true);
            let overreach = found.overreach_m.unwrap();
            assert!((overreach.median - grown).abs() < 0.1, "{grown} m, {turn}°: {found:?}");
            assert!((found.median_cells.unwrap() * CELL - overreach.median).abs() < 1e-9);
            assert!(found.measured > 150 && found.measured as f64 > 0.9 * found.edges as f64, "{found:?}");
        }
    }

    #[test]
    fn a_missing_roof_is_counted_and_not_measured() {
        let found = sharpness(&roof(0.0, 0.0), &Grid::filled(120, 120, 4.0), metres(), |_, _| true);
        assert!(found.edges > 150 && found.measured == 0 && found.overreach_m.is_none(), "{found:?}");
        let void = sharpness(&roof(0.0, 0.0), &Grid::filled(120, 120, f32::NAN), metres(), |_, _| true);
        assert_eq!(void.measured, 0);
        assert_eq!(sharpness(&roof(0.0, 0.0), &roof(0.0, 0.0), metres(), |_, _| false).edges, 0);
    }
}
