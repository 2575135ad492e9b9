//! The trend of the ground: a smooth surface under the known heights, which says how the ground
//! rises and falls over tens of metres.
//!
//! Voids are filled relative to it. On a slope of 20 % the lowest height within 40 m is 8 m below
//! the ground beside the void; relative to the trend it is the ground.
//!
//! In each block of cells a low height stands for the ground. Around each block a plane is fitted
//! to the low heights by asymmetric least squares (Newey and Powell 1987): what lies above the
//! plane, such as roofs in blocks that show no ground, counts little. The trend is the planes'
//! heights at the blocks, interpolated between them.

use raster::Grid;
use rayon::prelude::*;

/// Parameters of the trend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrendConfig {
    /// Side of a block, cells.
    pub block_cells: usize,
    /// Distance of the blocks that a plane is fitted to, blocks.
    pub reach_blocks: usize,
}

/// Share of a block's heights below its low height: a few may be wrong.
const LOW_SHARE: f64 = 0.1;
/// A block with a smaller share of known heights does not count: they may be an island of chance.
const KNOWN_SHARE: f64 = 0.1;
/// Weight of a low height above the plane, against 1 below it.
const ABOVE_WEIGHT: f64 = 0.03;
/// Low heights that lie a storey above the plane are those of roofs, metres: from there on their
/// weight falls with the square of the distance, so that towers do not lift the plane.
const STOREY_M: f64 = 3.0;
/// Rounds of reweighting, after which the plane moves by centimetres only.
const ROUNDS: usize = 12;
/// A slope needs this many blocks. With fewer the trend is level.
const BLOCKS_MIN: usize = 12;

/// Returns the trend of the ground, metres like `height_m`, in every cell. Only heights that are
/// `trusted` count. Without any the trend is 0.
///
/// ```
/// use raster::Grid;
/// use sweep::fusion::{TrendConfig, ground_trend};
///
/// // A slope with a house on it.
/// let mut height_m = Grid::from_vec(120, 80, (0..9600).map(|i| 0.2 * (i % 120) as f32).collect()).unwrap();
/// (30..60).for_each(|y| height_m.row_mut(y)[40..70].iter_mut().for_each(|h| *h += 12.0));
/// let trend = ground_trend(&height_m, &Grid::filled(120, 80, true), &TrendConfig { block_cells: 10, reach_blocks: 4 });
/// assert!((trend[(55, 45)] - trend[(15, 45)] - 8.0).abs() < 1.0);
/// ```
#[must_use]
pub fn ground_trend(height_m: &Grid<f32>, trusted: &Grid<bool>, config: &TrendConfig) -> Grid<f32> {
    let (width, height) = (height_m.width(), height_m.height());
    let block = config.block_cells.max(1);
    let (columns, rows) = (width.div_ceil(block), height.div_ceil(block));
    let low: Vec<Option<f64>> = (0..columns * rows)
        .into_par_iter()
        .map(|i| low_height(height_m, trusted, block, (i % columns, i / columns)))
        .collect();
    let nodes: Vec<Option<f64>> = (0..columns * rows)
        .into_par_iter()
        .map(|i| plane_at(&low, columns, (i % columns, i / columns), config.reach_blocks))
        .collect();
    let nodes = completed(nodes, columns);
    let mut out = Grid::filled(width, height, 0.0);
    for y in 0..height {
        let (r, v) = between(y, block, rows);
        for (x, out) in out.row_mut(y).iter_mut().enumerate() {
            let (c, u) = between(x, block, columns);
            let at = |c: usize, r: usize| nodes[r.min(rows - 1) * columns + c.min(columns - 1)];
            let upper = at(c, r) * (1.0 - u) + at(c + 1, r) * u;
            let lower = at(c, r + 1) * (1.0 - u) + at(c + 1, r + 1) * u;
            *out = (upper * (1.0 - v) + lower * v) as f32;
        }
    }
    out
}

/// Returns the block before a cell's centre, and how far it lies towards the next, 0 to 1.
fn between(cell: usize, block: usize, blocks: usize) -> (usize, f64) {
    let at = ((cell as f64 + 0.5) / block as f64 - 0.5).clamp(0.0, (blocks - 1) as f64);
    (at as usize, at - at.floor())
}

/// Returns the low height of a block; `None` where too little of it is known.
fn low_height(height_m: &Grid<f32>, trusted: &Grid<bool>, block: usize, (column, row): (usize, usize)) -> Option<f64> {
    let columns = column * block..((column + 1) * block).min(height_m.width());
    let mut known = Vec::new();
    for y in row * block..((row + 1) * block).min(height_m.height()) {
        let cells = height_m.row(y)[columns.clone()].iter().zip(&trusted.row(y)[columns.clone()]);
        known.extend(cells.filter(|(h, trusted)| **trusted && !h.is_nan()).map(|(h, _)| *h));
    }
    let rank = (LOW_SHARE * known.len() as f64) as usize;
    if (known.len() as f64) < KNOWN_SHARE * (block * block) as f64 {
        return None;
    }
    numeric::order_statistic(&mut known, rank).map(f64::from)
}

/// Returns the height that the plane under the low heights around a block has there; `None` without
/// any.
fn plane_at(low: &[Option<f64>], columns: usize, (column, row): (usize, usize), reach: usize) -> Option<f64> {
    let rows = low.len() / columns;
    let mut around = Vec::new();
    for r in row.saturating_sub(reach)..(row + reach + 1).min(rows) {
        for c in column.saturating_sub(reach)..(column + reach + 1).min(columns) {
            if let Some(h) = low[r * columns + c] {
                let (x, y) = (c as f64 - column as f64, r as f64 - row as f64);
                let near = 1.0 - (x * x + y * y) / ((reach + 1) * (reach + 1)) as f64;
                if near > 0.0 {
                    around.push([x, y, h, near]);
                }
            }
        }
    }
    let least = around.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
    if around.len() < BLOCKS_MIN {
        return (!around.is_empty()).then_some(least);
    }
    let mut terms = [f64::INFINITY, 0.0, 0.0];
    for round in 0..ROUNDS {
        let mut sums = nalgebra::Matrix3::zeros();
        let mut right = nalgebra::Vector3::zeros();
        for [x, y, h, near] in &around {
            let off = h - (terms[0] + terms[1] * x + terms[2] * y);
            let apart = if round >= ROUNDS / 2 { off / STOREY_M } else { 0.0 };
            let weight = near * if off > 0.0 { ABOVE_WEIGHT / (1.0 + apart * apart) } else { 1.0 };
            let row = nalgebra::Vector3::new(1.0, *x, *y);
            sums += weight * row * row.transpose();
            right += weight * (h - least) * row;
        }
        let Some(solved) = sums.cholesky().map(|c| c.solve(&right)) else { return Some(least) };
        terms = [solved[0] + least, solved[1], solved[2]];
    }
    Some(terms[0])
}

/// Gives blocks without a height that of the nearest one in their row, or else of the nearest row.
fn completed(nodes: Vec<Option<f64>>, columns: usize) -> Vec<f64> {
    let rows: Vec<Vec<Option<f64>>> = nodes.chunks(columns.max(1)).map(nearest_known).collect();
    let known: Vec<Option<usize>> = rows.iter().enumerate().map(|(r, row)| row[0].map(|_| r)).collect();
    let from = nearest_known(&known);
    from.iter()
        .flat_map(|row| row.map_or(vec![0.0; columns], |r| rows[r].iter().map(|h| h.unwrap_or(0.0)).collect()))
        .collect()
}

/// Replaces missing values by the nearest known ones, the earlier of two.
fn nearest_known<T: Copy>(values: &[Option<T>]) -> Vec<Option<T>> {
    if values.iter().all(Option::is_none) {
        return values.to_vec();
    }
    let nearest = |i: usize| {
        (0..values.len()).find_map(|d| {
            let before = i.checked_sub(d).and_then(|at| values[at]);
            before.or_else(|| values.get(i + d).copied().flatten())
        })
    };
    (0..values.len()).map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: TrendConfig = TrendConfig { block_cells: 5, reach_blocks: 6 };

    fn grid(of: impl Fn(usize, usize) -> f32) -> Grid<f32> {
        Grid::from_vec(200, 150, (0..200 * 150).map(|i| of(i % 200, i / 200)).collect()).unwrap()
    }

    fn trend(height_m: &Grid<f32>) -> Grid<f32> {
        ground_trend(height_m, &height_m.map(|h| !h.is_nan()), &CONFIG)
    }

    /// Towers of 20 cells on a level ground, streets of 10 cells that are known at crossings only.
    #[test]
    fn towers_do_not_lift_the_ground_between_them() {
        let is_tower = |x: usize, y: usize| x % 30 < 20 && y % 30 < 20;
        let is_crossing = |x: usize, y: usize| x % 30 >= 20 && y % 30 >= 20;
        let height_m = grid(|x, y| match (is_tower(x, y), is_crossing(x, y)) {
            (true, _) => 80.0,
            (_, true) => 7.0,
            _ => f32::NAN,
        });
        let out = trend(&height_m);
        // At a corner of the grid a single crossing does not tell a slope.
        assert!((60..90).all(|y| out.row(y)[60..140].iter().all(|h| (h - 7.0).abs() < 0.5)), "{:?}", out.row(75));
    }

    #[test]
    fn a_slope_is_followed_under_houses_and_past_voids() {
        let ground = |x: usize, y: usize| 30.0 + 0.15 * x as f32 - 0.1 * y as f32;
        let height_m = grid(|x, y| match (x, y) {
            (60..130, 40..70) => f32::NAN,
            _ if x % 25 < 12 && y % 25 < 12 => ground(x, y) + 9.0,
            _ => ground(x, y),
        });
        let out = trend(&height_m);
        // A low height lies half a block downhill of the block's centre, wherever it is.
        let off: Vec<f32> = (0..150 * 200).map(|i| out.data()[i] - ground(i % 200, i / 200)).collect();
        let mean = off.iter().sum::<f32>() / off.len() as f32;
        let inner = (0..off.len()).filter(|i| (20..180).contains(&(i % 200)) && (20..130).contains(&(i / 200)));
        assert!(mean.abs() < 1.0 && inner.map(|i| (off[i] - mean).abs()).fold(0.0, f32::max) < 1.0);
    }

    #[test]
    fn what_is_not_trusted_does_not_count_and_nothing_gives_nothing() {
        let height_m = grid(|x, _| if x < 100 { 5.0 } else { -40.0 });
        let out = ground_trend(&height_m, &height_m.map(|h| *h > 0.0), &CONFIG);
        assert!(out.data().iter().all(|h| (h - 5.0).abs() < 1e-3));
        assert!(trend(&grid(|_, _| f32::NAN)).data().iter().all(|h| *h == 0.0));
    }
}
