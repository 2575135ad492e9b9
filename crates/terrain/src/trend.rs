//! The trend of a surface: planes fitted to the surroundings of each place, so that a slope goes on
//! up to the border of the raster.

use raster::Grid;
use rayon::prelude::*;

use crate::coarse::{difference, spread};
use crate::membrane::filled;
use crate::regions::quantile;

/// Side of the blocks that the planes are fitted to, metres.
const BLOCK_M: f64 = 10.0;
/// Rounds of a fit that turns away from what stands above it.
const ROUNDS: usize = 6;
/// Height above a plane at which the weight of a block has halved, metres.
const HALF_WEIGHT_M: f64 = 1.0;
/// Half-widths of the planes of a robust trend, metres: from a city block down to the blocks next
/// to one. Wide planes lie on the ground where narrow ones would lie on a roof, and narrow ones lie
/// on hilltops.
const ROBUST_HALF_WIDTHS_M: [f64; 4] = [50.0, 30.0, 20.0, 10.0];
/// Height above such a plane at which the weight of a block has halved, as a share of the
/// half-width of the plane: a metre within 20 m. Ground that bends leaves wider planes by more.
const ROBUST_HALF_WEIGHT: f64 = 0.05;
/// How much farther below such a plane a block counts as one above it: roofs and crowns stand above
/// the ground, and only wrong matches lie below it.
const BELOW: f64 = 3.0;
/// Weight of the wider planes in a narrower one, blocks. They decide where hardly a block lies near
/// them.
const WIDER_BLOCKS: f64 = 0.5;

/// Columns, rows and metres to a block, and the share of its cells that have heights.
type Point = ([f64; 3], f64);

/// What a plane follows.
pub(crate) struct TrendConfig {
    /// Half-width of the surroundings, metres.
    pub(crate) half_width_m: f64,
    /// Order statistic of the heights of a block that the planes follow, from 0 (lowest) to 1.
    pub(crate) quantile: f64,
    /// Whether blocks above the plane count less.
    pub(crate) is_lower: bool,
}

/// Returns the trend of a surface, which must have a height somewhere.
pub(crate) fn trend(surface: &Grid<f32>, cell_m: f64, config: &TrendConfig) -> Grid<f32> {
    let side = ((BLOCK_M / cell_m).round() as usize).max(1);
    let radius = (config.half_width_m / (cell_m * side as f64)).round().max(1.0) as usize;
    let (blocks, shares) = block_quantiles(surface, side, config.quantile);
    let mut planes = blocks.clone();
    let width = planes.width();
    planes.data_mut().par_iter_mut().enumerate().for_each(|(at, height)| {
        *height = plane_at((&blocks, &shares), (at % width, at / width), radius, config.is_lower);
    });
    spread(&filled(&planes), side, (surface.width(), surface.height()))
}

/// Returns the trend of a ground in which objects are left that may fill the surroundings of a
/// place: planes from wide to narrow surroundings, each of which turns away from what lies off the
/// wider ones.
pub(crate) fn robust_trend(ground: &Grid<f32>, cell_m: f64) -> Grid<f32> {
    let widest = TrendConfig { half_width_m: ROBUST_HALF_WIDTHS_M[0], quantile: 0.5, is_lower: false };
    let side = ((BLOCK_M / cell_m).round() as usize).max(1);
    let mut out = trend(ground, cell_m, &widest);
    for half_width_m in ROBUST_HALF_WIDTHS_M {
        let radius = (half_width_m / (cell_m * side as f64)).round().max(1.0) as usize;
        let (blocks, shares) = block_quantiles(&difference(ground, &out), side, 0.5);
        let mut steps = blocks.clone();
        let width = steps.width();
        steps.data_mut().par_iter_mut().enumerate().for_each(|(at, step)| {
            let points = points_around((&blocks, &shares), (at % width, at / width), radius);
            *step = robust_step(&points, radius as f64, ROBUST_HALF_WEIGHT * half_width_m);
        });
        out = out.zip_map(&spread(&steps, side, (out.width(), out.height())), |height, step| height + step);
    }
    out
}

/// Returns how far a plane through points above wider planes lies above those, in its middle.
fn robust_step(points: &[Point], radius: f64, half_weight_m: f64) -> f32 {
    // As spread as the blocks are.
    let far = radius * (2.0_f64 / 3.0).sqrt();
    let wider = [(far, 0.0), (-far, 0.0), (0.0, far), (0.0, -far)].map(|(x, y)| ([x, y, 0.0], 0.25 * WIDER_BLOCKS));
    let mut plane = [0.0; 3];
    for _ in 0..ROUNDS {
        let weight = |([x, y, z], share): Point| {
            let above = z - (plane[0] + plane[1] * x + plane[2] * y);
            let off = if above > 0.0 { above } else { above / BELOW };
            share / (1.0 + (off / half_weight_m).powi(4))
        };
        let last = plane;
        plane = fitted(points.iter().map(|point| (point.0, weight(*point))).chain(wider), 0.0);
        if has_settled(last, plane, radius) {
            break;
        }
    }
    plane[0] as f32
}

/// Whether a plane moved by less than a tenth of a millimetre as far as it is fitted to.
fn has_settled(last: [f64; 3], plane: [f64; 3], radius: f64) -> bool {
    let [a, b, c] = [0, 1, 2].map(|i| (plane[i] - last[i]).abs());
    a + radius * (b + c) < 1e-4
}

/// Returns a quantile of the heights of blocks of `side × side` cells, and the share of their cells
/// that have heights.
fn block_quantiles(surface: &Grid<f32>, side: usize, share: f64) -> (Grid<f32>, Grid<f32>) {
    let (width, height) = (surface.width().div_ceil(side), surface.height().div_ceil(side));
    let mut blocks = Grid::filled(width, height, f32::NAN);
    let mut shares = Grid::filled(width, height, 0.0);
    let mut values = Vec::with_capacity(side * side);
    for row in 0..height {
        for column in 0..width {
            values.clear();
            for y in row * side..((row + 1) * side).min(surface.height()) {
                let cells = &surface.row(y)[column * side..((column + 1) * side).min(surface.width())];
                values.extend(cells.iter().filter(|h| !h.is_nan()));
            }
            shares[(column, row)] = values.len() as f32 / (side * side) as f32;
            blocks[(column, row)] = quantile(&mut values, share).unwrap_or(f32::NAN);
        }
    }
    (blocks, shares)
}

/// Fits a plane around a block and returns its height there, NaN without blocks to fit it to. A
/// block counts by the share of its cells that have heights.
fn plane_at(blocks: (&Grid<f32>, &Grid<f32>), place: (usize, usize), radius: usize, is_lower: bool) -> f32 {
    let points = points_around(blocks, place, radius);
    let Some(base) = points.first().map(|(place, _)| place[2]) else { return f32::NAN };
    let mut plane = [0.0; 3];
    for round in 0..if is_lower { ROUNDS } else { 1 } {
        let weight = |([x, y, z], share): Point| {
            let above = z - base - (plane[0] + plane[1] * x + plane[2] * y);
            if round == 0 || above <= 0.0 { share } else { share / (1.0 + (above / HALF_WEIGHT_M).powi(2)) }
        };
        plane = fitted(points.iter().map(|point| (point.0, weight(*point))), base);
    }
    (base + plane[0]) as f32
}

/// Returns the blocks around a block that have heights.
fn points_around(
    (blocks, shares): (&Grid<f32>, &Grid<f32>),
    (column, row): (usize, usize),
    radius: usize,
) -> Vec<Point> {
    let mut points = Vec::with_capacity((2 * radius + 1).pow(2));
    for y in row.saturating_sub(radius)..(row + radius + 1).min(blocks.height()) {
        for x in column.saturating_sub(radius)..(column + radius + 1).min(blocks.width()) {
            if !blocks[(x, y)].is_nan() {
                let place = [x as f64 - column as f64, y as f64 - row as f64, f64::from(blocks[(x, y)])];
                points.push((place, f64::from(shares[(x, y)])));
            }
        }
    }
    points
}

/// Fits a plane `a + b·x + c·y` to weighted points by least squares. A little damping of the slopes
/// decides where the points lie on a line.
pub(crate) fn fitted(points: impl Iterator<Item = Point>, base: f64) -> [f64; 3] {
    let (mut n, mut sx, mut sy, mut sz) = (0.0, 0.0, 0.0, 0.0);
    let (mut xx, mut xy, mut yy, mut xz, mut yz) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ([x, y, z], weight) in points {
        let z = z - base;
        n += weight;
        sx += weight * x;
        sy += weight * y;
        sz += weight * z;
        xx += weight * x * x;
        xy += weight * x * y;
        yy += weight * y * y;
        xz += weight * x * z;
        yz += weight * y * z;
    }
    let damping = 1e-3 * n;
    let (xx, yy, xy) = (xx - sx * sx / n + damping, yy - sy * sy / n + damping, xy - sx * sy / n);
    let (xz, yz) = (xz - sx * sz / n, yz - sy * sz / n);
    let determinant = xx * yy - xy * xy;
    let (b, c) = ((xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant);
    [(sz - b * sx - c * sy) / n, b, c]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_its_own_trend_up_to_the_border() {
        let cells = (0..40_000).map(|at| 0.4 * (at % 200) as f32 - 0.3 * (at / 200) as f32);
        let plane = Grid::from_vec(200, 200, cells.collect()).unwrap();
        let config = TrendConfig { half_width_m: 60.0, quantile: 0.5, is_lower: true };
        let found = trend(&plane, 1.0, &config);
        let worst = found.data().iter().zip(plane.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 0.7, "{worst}");
    }

    /// A hall of 60 m on a slope of 40 %, whose roof is flush with the ground uphill and stands
    /// 24 m above it downhill.
    #[test]
    fn a_robust_trend_goes_on_under_a_flat_roof_that_fills_the_narrow_surroundings() {
        let slope = |column: usize| 0.4 * column as f32;
        let is_roof = |column: usize, row: usize| (70..130).contains(&column) && (70..130).contains(&row);
        let height = |column: usize, row: usize| slope(if is_roof(column, row) { 130 } else { column });
        let cells = (0..40_000).map(|at| height(at % 200, at / 200));
        let found = robust_trend(&Grid::from_vec(200, 200, cells.collect()).unwrap(), 1.0);
        let worst = (0..40_000).map(|at| (found.data()[at] - slope(at % 200)).abs()).fold(0.0, f32::max);
        assert!(worst < 3.0, "{worst}");
    }
}
