//! Shifts that differ from place to place: jitter, drifts and seams that one translation leaves.
//!
//! The surfaces are divided into blocks. Each block is divided into tiles like a chessboard, and
//! the tiles of either colour find a shift for themselves: the one with the least mean of the
//! clipped differences, which a few walls on much flat ground tell. The block's shift is their
//! mean, and how far they differ tells how well it is known. A flat block tells less than a steep
//! one, so the variance of a block is taken as inverse to the sum of its squared slopes, with one
//! factor that the differences of all blocks give.
//!
//! Shifts that noise explains are not applied. The variance τ² of the true shifts between blocks
//! follows from the scatter of the found ones beyond their own variances (DerSimonian and Laird
//! 1986, Controlled Clinical Trials 7, 177-188). A shift with the variance σ² counts by
//! τ² / (τ² + σ²) against the mean of all blocks, the least expected error (James and Stein 1961).

use std::ops::Range;

use numeric::{upper_median, upper_nmad};
use raster::Grid;
use rayon::prelude::*;

use crate::alignment::align::MetresFromCells;
use crate::alignment::registration::{cut, differences, finite, grown, own_shift};
use crate::alignment::search::Measure;
use crate::error::EvalError;

/// Tiles along each side of a block: eight of each colour, so that both colours cover the block.
const TILES: usize = 4;
/// Shortest side of a block, cells: its tiles still hold whole walls and slopes.
const LEAST_SIDE: usize = 96;
/// Farthest that a block is searched, cells: jitter of some pixels, beside the shift of the whole.
const FARTHEST_CELLS: usize = 8;
/// Cells of the test that are kept around a block, so that every shift has the same cells of the
/// reference.
const RIM: usize = FARTHEST_CELLS + 2;
/// Magnitude at which differences are clipped, NMADs of all: noise is kept whole.
const CLIP_NMADS: f64 = 3.0;
/// Least magnitude at which differences are clipped, metres for each metre of a cell's side:
/// surfaces without noise still show how steep a wall is.
const LEAST_CLIP: f64 = 0.2;
/// Median of the square of a normal deviate.
const MEDIAN_SQUARE: f64 = 0.454_936;

/// Returns the standard deviations along x and y, metres, of independent shifts along columns and
/// rows, whose deviations are given in cells.
fn deviations_on_map(metres: MetresFromCells, columns: f64, rows: f64) -> [f64; 2] {
    let ((x_columns, y_columns), (x_rows, y_rows)) = (metres.apply(columns, 0.0), metres.apply(0.0, rows));
    [x_columns.hypot(x_rows), y_columns.hypot(y_rows)]
}

/// A shift for each cell of a surface, to be added to it.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalShifts {
    /// Shift of each block: columns, rows, metres upwards.
    shifts: Grid<[f64; 3]>,
    /// Columns and rows of a block.
    side: (f64, f64),
    /// Number of blocks that found a shift of their own; the others take the mean of all.
    pub found: usize,
    /// Standard deviations of the true shifts between blocks along x, y and z, metres; shifts
    /// along columns and rows count as independent. 0 where noise explains what was found.
    pub deviation_m: [f64; 3],
    /// Largest shift sideways and largest shift up or down, metres.
    pub largest_m: (f64, f64),
}

impl LocalShifts {
    /// Finds the local shifts that bring `test` onto `reference`, two surfaces on the same cells
    /// that are aligned as a whole, in blocks of about `block_m` metres.
    ///
    /// # Errors
    /// [`EvalError::BlockTooSmall`]; [`EvalError::NoLocalShift`] where no block has heights of both
    /// surfaces.
    pub fn find(
        test: &Grid<f32>,
        reference: &Grid<f32>,
        metres: MetresFromCells,
        block_m: f64,
    ) -> Result<Self, EvalError> {
        let (along_columns, along_rows) = metres.cell_size_m();
        let least_m = LEAST_SIDE as f64 * along_columns.max(along_rows);
        if block_m.is_nan() || block_m < least_m {
            return Err(EvalError::BlockTooSmall { block_m, least_m });
        }
        let count = |cells: usize, cell_m: f64| ((cells as f64 * cell_m / block_m).round() as usize).max(1);
        let (columns, rows) = (count(reference.width(), along_columns), count(reference.height(), along_rows));
        let blocks = Blocks { size: (reference.width(), reference.height()), columns, rows };

        let mut all = finite(&differences(test, reference, |_, _| [0.0; 2]));
        let noise_m = CLIP_NMADS * upper_nmad(&mut all).unwrap_or(0.0);
        let measure = Measure::ClippedMean(noise_m.max(LEAST_CLIP * along_columns.max(along_rows)));
        let around =
            |start: [isize; 2]| blocks.each(|bounds| sideways(test, reference, metres, bounds, start, measure));
        let mut sideways = around([0; 2]);
        // Where the shift of the whole is off by cells, blocks are searched around their median.
        let start = [0, 1].map(|axis| {
            let mut shifts: Vec<f64> = sideways.iter().flatten().map(|found| found[axis].mean()).collect();
            upper_median(&mut shifts).unwrap_or(0.0).round() as isize
        });
        if start != [0; 2] {
            sideways = around(start);
        }
        let found = sideways.iter().flatten().count();
        if found == 0 {
            return Err(EvalError::NoLocalShift { blocks: columns * rows });
        }
        let (columns_moved, deviation_columns) = shrunk(&axis(&sideways, 0));
        let (rows_moved, deviation_rows) = shrunk(&axis(&sideways, 1));
        let shifts = columns_moved.into_iter().zip(rows_moved).map(|(columns, rows)| [columns, rows, 0.0]).collect();
        let mut local = Self {
            shifts: Grid::from_vec(columns, rows, shifts).unwrap_or_else(|| Grid::filled(columns, rows, [0.0; 3])),
            side: (reference.width() as f64 / columns as f64, reference.height() as f64 / rows as f64),
            found,
            deviation_m: [0.0; 3],
            largest_m: (0.0, 0.0),
        };
        let errors = differences(test, reference, |column, row| {
            let [columns, rows, _] = local.at(column, row);
            [columns, rows]
        });
        let (upwards, deviation_z) = shrunk(&axis(&blocks.each(|bounds| upwards(&errors, bounds)), 0));
        for (shift, up) in local.shifts.data_mut().iter_mut().zip(upwards) {
            shift[2] = up;
        }
        let [x, y] = deviations_on_map(metres, deviation_columns, deviation_rows);
        local.deviation_m = [x, y, deviation_z];
        local.measure(metres);
        Ok(local)
    }

    /// Takes the mean of all blocks out, and returns it: metres along x, y and z.
    pub fn take_mean(&mut self, metres: MetresFromCells) -> [f64; 3] {
        let count = self.blocks() as f64;
        let mean = [0, 1, 2].map(|axis| self.shifts.data().iter().map(|shift| shift[axis]).sum::<f64>() / count);
        for shift in self.shifts.data_mut() {
            (0..3).for_each(|axis| shift[axis] -= mean[axis]);
        }
        self.measure(metres);
        let (x, y) = metres.apply(mean[0], mean[1]);
        [x, y, mean[2]]
    }

    fn measure(&mut self, metres: MetresFromCells) {
        self.largest_m = (0.0, 0.0);
        for shift in self.shifts.data() {
            let (x, y) = metres.apply(shift[0], shift[1]);
            self.largest_m = (self.largest_m.0.max(x.hypot(y)), self.largest_m.1.max(shift[2].abs()));
        }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.shifts.data().len()
    }

    /// Returns the shift at a cell: columns, rows, metres upwards. It is linear between the centres
    /// of the blocks.
    pub fn at(&self, column: f64, row: f64) -> [f64; 3] {
        let place = |at: f64, side: f64, count: usize| {
            let at = ((at + 0.5) / side - 0.5).clamp(0.0, (count - 1) as f64);
            let low = at.floor();
            (low as usize, ((low as usize) + 1).min(count - 1), at - low)
        };
        let (left, right, u) = place(column, self.side.0, self.shifts.width());
        let (top, bottom, v) = place(row, self.side.1, self.shifts.height());
        let shift = |column: usize, row: usize| self.shifts.data()[row * self.shifts.width() + column];
        let mixed = |a: [f64; 3], b: [f64; 3], t: f64| [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]));
        mixed(mixed(shift(left, top), shift(right, top), u), mixed(shift(left, bottom), shift(right, bottom), u), v)
    }
}

/// What the tiles of the two colours of a block find along an axis, and how much the block tells.
#[derive(Debug, Clone, Copy)]
struct Found {
    halves: [f64; 2],
    /// Inverse to the variance but for a factor.
    information: f64,
}

impl Found {
    fn mean(&self) -> f64 {
        0.5 * (self.halves[0] + self.halves[1])
    }

    /// Square of the standard error of the mean, as the two halves show it.
    fn own_variance(&self) -> f64 {
        0.25 * (self.halves[0] - self.halves[1]).powi(2)
    }
}

fn axis<const N: usize>(blocks: &[Option<[Found; N]>], axis: usize) -> Vec<Option<Found>> {
    blocks.iter().map(|block| block.map(|found| found[axis])).collect()
}

/// Returns the shifts of all blocks along an axis, and the standard deviation of the true ones.
fn shrunk(blocks: &[Option<Found>]) -> (Vec<f64>, f64) {
    let mut scaled: Vec<f64> = blocks.iter().flatten().map(|found| found.own_variance() * found.information).collect();
    let factor = upper_median(&mut scaled).unwrap_or(0.0) / MEDIAN_SQUARE;
    // A block whose halves differ by more than its slopes explain is known as its halves say.
    let variance = |found: &Found| (factor / found.information).max(found.own_variance()).max(f64::MIN_POSITIVE);
    let known: Vec<(f64, f64)> = blocks.iter().flatten().map(|found| (found.mean(), variance(found))).collect();
    let between = true_variance(&known);
    let mean = weighted_mean(&known, between);
    let shift = |found: &Option<Found>| {
        let Some(found) = found else { return mean };
        mean + (found.mean() - mean) * between / (between + variance(found))
    };
    (blocks.iter().map(shift).collect(), between.sqrt())
}

/// Returns the mean of values, each with its variance, whose true values have a variance of their
/// own.
fn weighted_mean(known: &[(f64, f64)], between: f64) -> f64 {
    let (sum, weights) = known.iter().fold((0.0, 0.0), |(sum, weights), (value, variance)| {
        let weight = 1.0 / (variance + between);
        (sum + weight * value, weights + weight)
    });
    sum / weights
}

/// Returns the variance of the true values beyond the variance of each (DerSimonian and Laird
/// 1986).
fn true_variance(known: &[(f64, f64)]) -> f64 {
    let mean = weighted_mean(known, 0.0);
    let sum = |power: i32| known.iter().map(|(_, variance)| variance.recip().powi(power)).sum::<f64>();
    let spread: f64 = known.iter().map(|(value, variance)| (value - mean).powi(2) / variance).sum();
    let excess = (spread - (known.len() as f64 - 1.0)) / (sum(1) - sum(2) / sum(1));
    if excess.is_finite() { excess.max(0.0) } else { 0.0 }
}

/// Finds the shift of a block along columns and rows, around a start.
fn sideways(
    test: &Grid<f32>,
    reference: &Grid<f32>,
    metres: MetresFromCells,
    bounds: &[Range<usize>; 2],
    start: [isize; 2],
    measure: Measure,
) -> Option<[Found; 2]> {
    let test = cut(test, &grown(bounds, RIM), start.map(|cells| -cells - RIM as isize), 0);
    let whole = cut(reference, bounds, [0; 2], RIM);
    let half = |colour: usize| {
        let cell = |at: usize| [at % whole.width(), at / whole.width()];
        let kept = whole.without(|at| colour_of(bounds, cell(at).map(|at| at.saturating_sub(RIM))) != colour);
        own_shift(&test, &kept, metres, FARTHEST_CELLS, measure)
            .map(|found| [0, 1].map(|axis| found[axis] + start[axis] as f64))
    };
    let halves = [half(0)?, half(1)?];
    let mut slopes = [0.0; 2];
    for next in 1..whole.height() {
        let row = whole.row(next - 1);
        let pairs = row.iter().zip(&row[1..]).zip(whole.row(next));
        for ((height, right), below) in pairs {
            let steps = [right - height, below - height].map(f64::from);
            if steps.iter().all(|step| step.is_finite()) {
                (0..2).for_each(|axis| slopes[axis] += steps[axis] * steps[axis]);
            }
        }
    }
    let known = slopes.iter().all(|slope| *slope > 0.0);
    known.then(|| [0, 1].map(|axis| Found { halves: halves.map(|half| half[axis]), information: slopes[axis] }))
}

/// Finds the shift of a block upwards, from errors that no shift sideways is left in.
fn upwards(errors: &Grid<f32>, bounds: &[Range<usize>; 2]) -> Option<[Found; 1]> {
    let mut halves: [Vec<f64>; 2] = Default::default();
    for row in bounds[1].clone() {
        for (column, error) in errors.row(row)[bounds[0].clone()].iter().enumerate().filter(|(_, e)| e.is_finite()) {
            halves[colour_of(bounds, [column, row - bounds[1].start])].push(-f64::from(*error));
        }
    }
    let information = (halves[0].len() + halves[1].len()) as f64;
    let [first, second] = &mut halves;
    Some([Found { halves: [upper_median(first)?, upper_median(second)?], information }])
}

/// Returns the colour, 0 or 1, of the tile of a cell, counted from the corner of its block.
fn colour_of(bounds: &[Range<usize>; 2], cell: [usize; 2]) -> usize {
    let tile = |axis: usize| cell[axis] * TILES / bounds[axis].len().max(1);
    (tile(0) + tile(1)) % 2
}

/// Blocks of a surface.
struct Blocks {
    /// Columns and rows of the surface.
    size: (usize, usize),
    columns: usize,
    rows: usize,
}

impl Blocks {
    /// Calls `of_block` with the columns and the rows of every block.
    fn each<T: Send>(&self, of_block: impl Fn(&[Range<usize>; 2]) -> Option<T> + Sync) -> Vec<Option<T>> {
        let range = |size: usize, count: usize, k: usize| k * size / count..(k + 1) * size / count;
        let bounds = |block: usize| {
            [
                range(self.size.0, self.columns, block % self.columns),
                range(self.size.1, self.rows, block / self.columns),
            ]
        };
        (0..self.columns * self.rows).into_par_iter().map(|block| of_block(&bounds(block))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alignment::resample::bilinear;
    use numeric::random::{hash64, unit_interval};
    use raster::GeoTransform;

    const SIZE: usize = 480;

    fn metres() -> MetresFromCells {
        MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, 0.5), (1.0, 1.0))
    }

    /// Columns lead to the south-east and rows to the north-east, half a metre a cell.
    #[test]
    fn deviations_of_turned_cells_do_not_cancel() {
        let half = 0.5 * 0.5f64.sqrt();
        let turned = MetresFromCells::new(&GeoTransform([0.0, half, half, 0.0, -half, half]), (1.0, 1.0));
        let [x, y] = deviations_on_map(turned, 2.0, 2.0);
        assert!((x - 1.0).abs() < 1e-12 && (y - 1.0).abs() < 1e-12, "{x} {y}");
        let [x, y] = deviations_on_map(turned, 2.0, 0.0);
        assert!((x - 2.0 * half).abs() < 1e-12 && (y - 2.0 * half).abs() < 1e-12, "{x} {y}");
    }

    /// Hills between random heights on a lattice of 15 cells, with noise, moved by a shift that
    /// differs from cell to cell.
    fn hills(noise: u64, noise_m: f64, shift: impl Fn(f64, f64) -> [f64; 3]) -> Grid<f32> {
        let lattice =
            Grid::from_vec(40, 40, (0..1600).map(|i| 12.0 * unit_interval(hash64(i)) as f32).collect()).unwrap();
        let height = |i: usize| {
            let (column, row) = ((i % SIZE) as f64, (i / SIZE) as f64);
            let [dx, dy, dz] = shift(column, row);
            let hill = bilinear(&lattice, 2.0 + (column - dx) / 15.0, 2.0 + (row - dy) / 15.0).unwrap();
            let error = unit_interval(hash64((i as u64) << 8 ^ noise)) - 0.5;
            (hill + noise_m * error + dz) as f32
        };
        Grid::from_vec(SIZE, SIZE, (0..SIZE * SIZE).map(height).collect()).unwrap()
    }

    #[test]
    fn shifts_that_vary_are_found() {
        // A wave along the rows, as jitter of the attitude makes it, and a tilt.
        let wave = |_: f64, row: f64| [2.0 * (row / 120.0).sin(), 0.0, 0.004 * (row - 240.0)];
        let (reference, test) = (hills(1, 0.6, |_, _| [0.0; 3]), hills(2, 0.6, wave));
        let found = LocalShifts::find(&test, &reference, metres(), 48.0).unwrap();
        assert_eq!((found.blocks(), found.found), (25, 25));
        let mut errors = [0.0, 0.0, 0.0];
        for i in 0..48 * 48 {
            let (column, row) = ((i % 48) as f64 * 10.0, (i / 48) as f64 * 10.0);
            let (true_shift, local) = (wave(column, row), found.at(column, row));
            (0..3).for_each(|k| errors[k] += (true_shift[k] + local[k]).powi(2));
        }
        let rms = errors.map(|sum: f64| (sum / 2304.0).sqrt());
        // Without the blocks: 1.4 cells and 0.55 m. A block has the mean of its 96 rows.
        assert!(rms[0] < 0.35 && rms[1] < 0.05 && rms[2] < 0.15, "{rms:?}");
        assert!(found.deviation_m[0] > 0.5 && found.deviation_m[1] < 0.02, "{:?}", found.deviation_m);
        assert!((0.7..1.1).contains(&found.largest_m.0) && found.largest_m.1 > 0.5, "{:?}", found.largest_m);
    }

    /// Few houses on flat ground, with noise, moved by a shift that differs from row to row.
    fn houses(noise: u64, shift: impl Fn(f64) -> f64) -> Grid<f32> {
        let height = |i: usize| {
            let (column, row) = ((i % SIZE) as f64, (i / SIZE) as f64);
            let (x, y) = (column - shift(row), row);
            let plot = ((x / 60.0).floor() as i64 * 97 + (y / 60.0).floor() as i64) as u64;
            let is_house = hash64(plot).is_multiple_of(5) && x.rem_euclid(60.0) < 24.0 && y.rem_euclid(60.0) < 30.0;
            let error = unit_interval(hash64((i as u64) << 8 ^ noise)) - 0.5;
            (if is_house { 7.0 } else { 0.0 } + 0.1 * error) as f32
        };
        Grid::from_vec(SIZE, SIZE, (0..SIZE * SIZE).map(height).collect()).unwrap()
    }

    #[test]
    fn flat_blocks_take_no_part() {
        let wave = |row: f64| 3.0 * (row / 100.0).sin();
        let (reference, test) = (houses(7, |_| 0.0), houses(8, wave));
        let found = LocalShifts::find(&test, &reference, metres(), 60.0).unwrap();
        let worst = (0..48 * 48).map(|i| {
            let (column, row) = ((i % 48) as f64 * 10.0, (i / 48) as f64 * 10.0);
            let at = found.at(column, row);
            at[0].hypot(at[1])
        });
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 3.5 && found.deviation_m[1] < 0.1, "{worst} {:?} {:?}", found.deviation_m, found.shifts);
    }

    #[test]
    fn a_shift_of_the_whole_that_is_cells_off_is_made_good() {
        let wave = |_: f64, row: f64| [7.0 + 2.0 * (row / 120.0).sin(), 0.0, 0.0];
        let (reference, test) = (hills(1, 0.6, |_, _| [0.0; 3]), hills(2, 0.6, wave));
        let mut found = LocalShifts::find(&test, &reference, metres(), 48.0).unwrap();
        // The mean of the wave over all rows is 7.83 cells of half a metre.
        let mean = found.take_mean(metres());
        assert!((-3.95..-3.88).contains(&mean[0]) && mean[1].abs() < 0.05 && mean[2].abs() < 0.1, "{mean:?}");
        assert!(found.largest_m.0 < 1.5, "{:?}", found.largest_m);
    }

    #[test]
    fn noise_is_no_shift() {
        let still = |_: f64, _: f64| [0.0; 3];
        let (reference, test) = (hills(3, 2.0, still), hills(4, 2.0, still));
        let found = LocalShifts::find(&test, &reference, metres(), 60.0).unwrap();
        assert!(found.largest_m.0 < 0.02 && found.largest_m.1 < 0.05, "{:?}", found.largest_m);
    }

    #[test]
    fn blocks_without_heights_take_the_mean_and_surfaces_without_any_are_refused() {
        let drift = |_: f64, row: f64| [if row < 240.0 { 1.5 } else { -1.5 }, 0.0, 0.0];
        let (mut reference, test) = (hills(5, 0.2, |_, _| [0.0; 3]), hills(6, 0.2, drift));
        for row in 0..120 {
            reference.row_mut(row)[..120].fill(f32::NAN);
        }
        let found = LocalShifts::find(&test, &reference, metres(), 60.0).unwrap();
        assert_eq!(found.found, 15);
        let (beside, filled) = (found.at(180.0, 60.0)[0], found.at(20.0, 20.0)[0]);
        assert!((beside + 1.5).abs() < 0.1 && filled.abs() < 0.2, "{beside} {filled}");
        let void = reference.map(|_| f32::NAN);
        let refused = LocalShifts::find(&test, &void, metres(), 60.0);
        assert!(matches!(refused, Err(EvalError::NoLocalShift { blocks: 16 })), "{refused:?}");
        let refused = LocalShifts::find(&test, &reference, metres(), 20.0);
        assert!(matches!(refused, Err(EvalError::BlockTooSmall { .. })), "{refused:?}");
    }
}
