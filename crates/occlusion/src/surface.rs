//! A surface model as an obstacle between its points and a sensor.
//!
//! The search follows the line of sight from the point in steps of an eighth of a cell along the
//! faster axis, and of a sixty-fourth near the surface, until the line is above everything. The
//! point is hidden where the surface is above the line. Between cell centres the surface is
//! bilinear, except where neighbours differ by more than a slope of [`STEP_SLOPE`]: there is a
//! wall, whose position [`wall`](super::wall) finds from the cells around it. (A ramp in its place
//! would take half a cell off every roof's edge and let the sensor see behind it.) Cells without a
//! height hide nothing.

use raster::Grid;

use super::lines::{self, WallLine};
use super::wall::Walls;

/// Slope between neighbours beyond which they form a wall (58°): a parapet of 0.9 m on cells of
/// 0.5 m is a wall.
pub const STEP_SLOPE: f32 = 1.6;

/// Sides of the blocks whose highest cell is kept, cells: the large ones pass over flat country,
/// the small ones between buildings.
const BLOCKS: [usize; 2] = [16, 4];
/// Steps of the line of sight per cell.
const STEPS_PER_CELL: f64 = 8.0;
/// Substeps of a step near the surface.
const PARTS: u32 = 8;

/// Heights on a grid, made ready for lines of sight.
#[derive(Debug, Clone)]
pub struct OcclusionSurface<'a> {
    heights: &'a Grid<f32>,
    walls: Walls,
    /// The highest cell of each block and of one cell around it, for each size of blocks.
    ceilings: [Grid<f32>; 2],
    highest: f32,
}

impl<'a> OcclusionSurface<'a> {
    /// Prepares heights (metres, NaN where there is none) on cells of `cell_m` metres.
    pub fn new(heights: &'a Grid<f32>, cell_m: f64) -> Self {
        let ceilings = BLOCKS.map(|side| ceilings(heights, side));
        let highest = ceilings[0].data().iter().fold(f32::NEG_INFINITY, |high, &h| high.max(h));
        Self { heights, walls: Walls::find(heights, STEP_SLOPE * cell_m as f32), ceilings, highest }
    }

    /// Returns the height at a (column, row): bilinear, with upright walls; NaN if the cells that
    /// count have none.
    #[inline]
    pub fn height_at(&self, column: f64, row: f64) -> f32 {
        self.quad(column, row).map_or(f32::NAN, |quad| self.height_in(&quad))
    }

    /// Returns the walls between the cells as lines on the grid.
    ///
    /// ```
    /// use occlusion::OcclusionSurface;
    /// use raster::Grid;
    ///
    /// // A block of four by four cells, 10 m high: one closed line.
    /// let high = |i: usize| (2..6).contains(&(i % 8)) && (2..6).contains(&(i / 8));
    /// let heights = Grid::from_vec(8, 8, (0..64).map(|i| if high(i) { 10.0 } else { 0.0 }).collect()).unwrap();
    /// let lines = OcclusionSurface::new(&heights, 1.0).wall_lines();
    /// assert!(lines.len() == 1 && lines[0].is_closed);
    /// assert!(lines[0].points.iter().all(|p| p.lower_m == 0.0 && (p.upper_m - 10.0).abs() < 1e-4));
    /// ```
    pub fn wall_lines(&self) -> Vec<WallLine> {
        lines::trace(&self.walls, self.heights)
    }

    /// The height at a (column, row) where it may be above a level, else something below it.
    #[inline]
    fn height_above(&self, column: f64, row: f64, level: f64) -> f64 {
        let Some(quad) = self.quad(column, row) else { return f64::NEG_INFINITY };
        let (low, high) = quad.range();
        match f64::from(high) > level {
            true if low == high => f64::from(high),
            true => f64::from(self.height_in(&quad)),
            false => f64::NEG_INFINITY,
        }
    }

    /// The cells around a position; `None` outside their centres.
    #[inline]
    fn quad(&self, column: f64, row: f64) -> Option<Quad> {
        let (last_column, last_row) = (self.heights.width().checked_sub(1)?, self.heights.height().checked_sub(1)?);
        // Negated, so that NaN is outside.
        if !(column >= 0.0 && row >= 0.0 && column <= last_column as f64 && row <= last_row as f64) {
            return None;
        }
        let (c, r) = (column as usize, row as usize);
        let (next_column, next_row) = ((c + 1).min(last_column), (r + 1).min(last_row));
        let (top, low) = (self.heights.row(r), self.heights.row(next_row));
        Some(Quad {
            corner: (c, r),
            at: [(column - c as f64) as f32, (row - r as f64) as f32],
            heights: [top[c], top[next_column], low[c], low[next_column]],
        })
    }

    fn height_in(&self, quad: &Quad) -> f32 {
        let [a, b, c, d] = quad.heights;
        let [u, v] = quad.at;
        if quad.heights.iter().any(|h| h.is_nan()) {
            // The nearest cell; at equal distance the later one.
            return quad.heights[usize::from(u >= 0.5) + 2 * usize::from(v >= 0.5)];
        }
        self.walls.height(self.heights, quad.corner, quad.heights, quad.at).unwrap_or_else(|| {
            let (upper, lower) = (a + (b - a) * u, c + (d - c) * u);
            upper + (lower - upper) * v
        })
    }

    /// Returns whether the surface hides the point at (column, row) and `height_m` from a sensor.
    /// The line of sight moves by `per_metre` (columns, rows) for each metre that it rises. Surface
    /// less than `tolerance_m` above the line does not count.
    ///
    /// ```
    /// use occlusion::OcclusionSurface;
    /// use raster::Grid;
    ///
    /// // A wall of 10 m in column 5, and a sensor to the right at 45°.
    /// let cells = (0..18).map(|i| if i % 9 == 5 { 10.0 } else { 0.0 }).collect();
    /// let heights = Grid::from_vec(9, 2, cells).unwrap();
    /// let surface = OcclusionSurface::new(&heights, 1.0);
    /// assert!(surface.hides(1.0, 0.5, 0.0, [1.0, 0.0], 0.05));
    /// assert!(!surface.hides(7.0, 0.5, 0.0, [1.0, 0.0], 0.05));
    /// ```
    pub fn hides(&self, column: f64, row: f64, height_m: f64, per_metre: [f64; 2], tolerance_m: f64) -> bool {
        let fastest = per_metre[0].abs().max(per_metre[1].abs());
        if !(fastest > 0.0 && fastest.is_finite() && height_m.is_finite()) {
            return false;
        }
        let rise = 1.0 / (STEPS_PER_CELL * fastest);
        let step = [per_metre[0] * rise, per_metre[1] * rise];
        let (width, height) = (self.heights.width() as f64, self.heights.height() as f64);
        let top = f64::from(self.highest) - tolerance_m;
        let mut k = 1.0;
        loop {
            let line = height_m + k * rise;
            let (c, r) = (column + k * step[0], row + k * step[1]);
            // Negated, so that NaN ends the search.
            if !(line - rise < top && c > -0.5 && r > -0.5 && c < width - 0.5 && r < height - 0.5) {
                return false;
            }
            let cell = [(c + 0.5) as usize, (r + 0.5) as usize];
            let below = |(side, ceilings): &(usize, &Grid<f32>)| {
                f64::from(ceilings[(cell[0] / side, cell[1] / side)]) - tolerance_m <= line - rise
            };
            if let Some((side, _)) = BLOCKS.into_iter().zip(&self.ceilings).find(below) {
                k += steps_out([c, r], step, cell, side);
                continue;
            }
            let surface = |c: f64, r: f64, level: f64| {
                self.height_above(c.clamp(0.0, width - 1.0), r.clamp(0.0, height - 1.0), level) - tolerance_m
            };
            let here = surface(c, r, line - rise + tolerance_m);
            let between = |part: u32| {
                let back = f64::from(part) / f64::from(PARTS);
                let line = line - back * rise;
                surface(c - back * step[0], r - back * step[1], line + tolerance_m) > line
            };
            if here > line || (here > line - rise && (1..PARTS).any(between)) {
                return true;
            }
            k += 1.0;
        }
    }
}

/// Four cells around a position.
struct Quad {
    /// Column and row of the first.
    corner: (usize, usize),
    /// Where the position is among them, 0 to 1 along columns and rows.
    at: [f32; 2],
    /// Upper left, upper right, lower left, lower right.
    heights: [f32; 4],
}

impl Quad {
    /// Least and greatest height; NaN for the least where one is missing.
    #[inline]
    fn range(&self) -> (f32, f32) {
        let [a, b, c, d] = self.heights;
        let low = if (a + b + c + d).is_nan() { f32::NAN } else { a.min(b).min(c.min(d)) };
        // f32::max ignores NaN.
        (low, a.max(b).max(c.max(d)))
    }
}

/// Returns the highest cell of each block and of one cell around it.
fn ceilings(heights: &Grid<f32>, side: usize) -> Grid<f32> {
    let blocks = |cells: usize| cells.div_ceil(side).max(1);
    let mut ceilings = Grid::filled(blocks(heights.width()), blocks(heights.height()), f32::NEG_INFINITY);
    for j in 0..ceilings.height() {
        let rows = (j * side).saturating_sub(1)..(j * side + side + 1).min(heights.height());
        for i in 0..ceilings.width() {
            let columns = (i * side).saturating_sub(1)..(i * side + side + 1).min(heights.width());
            let cells = rows.clone().flat_map(|row| &heights.row(row)[columns.clone()]);
            // f32::max ignores NaN.
            ceilings[(i, j)] = cells.fold(f32::NEG_INFINITY, |high, &h| high.max(h));
        }
    }
    ceilings
}

/// Whole steps that lead out of the block of a cell, at least one.
#[inline]
fn steps_out(at: [f64; 2], step: [f64; 2], cell: [usize; 2], side: usize) -> f64 {
    let along = |i: usize| {
        let low = (cell[i] / side * side) as f64 - 0.5;
        let edge = if step[i] > 0.0 { low + side as f64 } else { low };
        if step[i] == 0.0 { f64::INFINITY } else { (edge - at[i]) / step[i] }
    };
    along(0).min(along(1)).floor().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Flat ground with a block of 10 m between columns 20 and 29.
    fn block() -> Grid<f32> {
        let mut heights = Grid::filled(64, 40, 100.0_f32);
        for row in 0..40 {
            heights.row_mut(row)[20..30].fill(110.0);
        }
        heights
    }

    #[test]
    fn a_wall_hides_as_far_as_its_height_and_the_angle_say() {
        let heights = block();
        let surface = OcclusionSurface::new(&heights, 0.5);
        // The sensor stands towards smaller columns, under 45°: two cells per metre.
        let hidden =
            |column: usize| surface.hides(column as f64, 20.0, f64::from(heights[(column, 20)]), [-2.0, 0.0], 0.01);
        // The wall stands at column 29.5; its shadow is 10 m, 20 cells, long.
        for column in 0..64 {
            assert_eq!(hidden(column), (30..=49).contains(&column), "{column}");
        }
        // From above nothing is hidden, and beyond the edge nothing stands.
        assert!(!surface.hides(31.0, 20.0, 100.0, [0.0, 0.0], 0.01));
        assert!(!surface.hides(31.0, 20.0, 100.0, [2.0, 0.0], 0.01));
        assert!(!surface.hides(31.0, 20.0, f64::NAN, [-2.0, 0.0], 0.01));
    }

    #[test]
    fn a_slope_hides_itself_only_where_it_is_steeper_than_the_line() {
        let slope = |s: f32| Grid::from_vec(40, 3, (0..120).map(|i| -(i % 40) as f32 * 0.5 * s).collect()).unwrap();
        for (s, expected) in [(0.9, false), (1.1, true)] {
            let heights = slope(s);
            let surface = OcclusionSurface::new(&heights, 0.5);
            let hidden = surface.hides(20.0, 1.0, f64::from(heights[(20, 1)]), [-2.0, 0.0], 0.0);
            assert_eq!(hidden, expected, "{s}");
        }
    }

    proptest! {
        /// Leaving blocks out changes nothing.
        #[test]
        fn blocks_are_passed_over_and_nothing_in_them(
            cells in prop::collection::vec(0.0..12.0f32, 70 * 50), column in 0..70usize, row in 0..50usize,
            dx in -3.0..3.0f64, dy in -3.0..3.0f64, spikes in prop::collection::vec((0..70usize, 0..50usize, 20.0..60.0f32), 0..6),
        ) {
            let mut heights = Grid::from_vec(70, 50, cells.iter().map(|h| if *h < 0.5 { f32::NAN } else { *h * 0.1 }).collect()).unwrap();
            for (c, r, h) in spikes {
                heights[(c, r)] = h;
            }
            let surface = OcclusionSurface::new(&heights, 0.5);
            let nowhere_below = surface.ceilings.clone().map(|blocks| blocks.map(|_| f32::INFINITY));
            let slow = OcclusionSurface { ceilings: nowhere_below, ..surface.clone() };
            let from = f64::from(heights[(column, row)]);
            let ask = |s: &OcclusionSurface<'_>| s.hides(column as f64, row as f64, from, [dx, dy], 0.05);
            prop_assert_eq!(ask(&surface), ask(&slow));
        }
    }
}
