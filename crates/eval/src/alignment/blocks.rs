//! Shifts that differ from place to place: jitter, drifts and seams that one translation leaves.
//!
//! The surfaces are divided into blocks. Each quarter of a block finds its own shift from its slopes
//! (Nuth and Kääb 2011), which a few walls tell, and the mean of the quarters is that of the block. Their spread tells how well it is known. The variance of
//! the blocks' shifts beyond what this explains is that of true local shifts, τ². A shift with the
//! variance σ² counts by τ² / (τ² + σ²), the least expected error for normal deviations (James and
//! Stein 1961). So surfaces without local shifts stay as they are, whatever their noise.

use std::ops::Range;

use numeric::upper_median;
use raster::Grid;
use rayon::prelude::*;

use crate::alignment::align::MetresFromCells;
use crate::alignment::nuth_kaab::NuthKaab;
use crate::alignment::registration::{cut, differences};
use crate::alignment::resample::bilinear;
use crate::error::EvalError;

/// Quarters along each side of a block.
const QUARTERS: usize = 2;
/// Shortest side of a block, cells: its quarters still have slopes in several directions beside
/// the farthest shift.
const LEAST_SIDE: usize = 96;
/// Least number of quarters whose spread is used.
const LEAST_QUARTERS: usize = 3;
/// Farthest that a quarter is moved, cells: a few times what slopes of roof edges, blurred over two
/// cells, tell at once.
const FARTHEST_CELLS: f64 = 8.0;
/// Cells of the test that are kept around a quarter, so that every shift has the same cells of the
/// reference.
const RIM: usize = FARTHEST_CELLS as usize + 2;

/// A shift for each cell of a surface, to be added to it.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalShifts {
    /// Shift of each block: columns, rows, metres upwards.
    shifts: Grid<[f64; 3]>,
    /// Columns and rows of a block.
    side: (f64, f64),
    /// Number of blocks that found a shift of their own; the others take those beside them.
    pub found: usize,
    /// Standard deviations of the true local shifts along x, y and z, metres. 0 where noise
    /// explains all.
    pub deviation_m: [f64; 3],
    /// Largest shift sideways and largest shift up or down, metres.
    pub largest_m: (f64, f64),
}

impl LocalShifts {
    /// Finds the local shifts that bring `test` onto `reference`, two surfaces on the same cells
    /// that are aligned as a whole, in blocks of about `block_m` metres.
    ///
    /// # Errors
    /// [`EvalError::BlockTooSmall`]; [`EvalError::NoLocalShift`] where no block has relief that
    /// both surfaces share.
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
        let sideways = |bounds: &[Range<usize>; 2]| slope_shift(test, reference, metres, bounds);
        let (levelled, found, tau) = blocks.shifts(sideways);
        if found == 0 {
            return Err(EvalError::NoLocalShift { blocks: columns * rows });
        }
        let side = (reference.width() as f64 / columns as f64, reference.height() as f64 / rows as f64);
        let mut local = Self {
            shifts: levelled.map(|shift| [shift[0], shift[1], 0.0]),
            side,
            found,
            deviation_m: [0.0; 3],
            largest_m: (0.0, 0.0),
        };
        let errors = local.errors(test, reference);
        let upwards = |bounds: &[Range<usize>; 2]| {
            let [columns, rows] = bounds;
            let inside = rows.clone().flat_map(|row| &errors.row(row)[columns.clone()]);
            upper_median(&mut inside.filter(|e| e.is_finite()).map(|&e| f64::from(e)).collect::<Vec<f64>>())
                .map(|up| [-up])
        };
        let (up, _, tau_up) = blocks.shifts(upwards);
        for (shift, up) in local.shifts.data_mut().iter_mut().zip(up.data()) {
            shift[2] = up[0];
        }
        let (x, y) = metres.apply(tau[0], tau[1]);
        local.deviation_m = [x.abs(), y.abs(), tau_up[0]];
        for shift in local.shifts.data() {
            let (x, y) = metres.apply(shift[0], shift[1]);
            local.largest_m = (local.largest_m.0.max(x.hypot(y)), local.largest_m.1.max(shift[2].abs()));
        }
        Ok(local)
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

    /// Returns test − reference, the test moved sideways.
    fn errors(&self, test: &Grid<f32>, reference: &Grid<f32>) -> Grid<f32> {
        let mut out = Grid::filled(reference.width(), reference.height(), f32::NAN);
        let width = reference.width().max(1);
        out.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| {
            for ((column, out), height) in out.iter_mut().enumerate().zip(reference.row(row)) {
                let shift = self.at(column as f64, row as f64);
                let moved = bilinear(test, column as f64 - shift[0], row as f64 - shift[1]);
                *out = moved.map_or(f32::NAN, |moved| (moved - f64::from(*height)) as f32);
            }
        });
        out
    }
}

/// Finds the shift of a part of the test from the slopes of the reference, columns and rows. `None`
/// where they do not tell it.
fn slope_shift(
    test: &Grid<f32>,
    reference: &Grid<f32>,
    metres: MetresFromCells,
    bounds: &[Range<usize>; 2],
) -> Option<[f64; 2]> {
    let (along_columns, along_rows) = metres.cell_size_m();
    let reference = cut(reference, bounds, [0; 2], RIM);
    let wide = bounds.each_ref().map(|bound| bound.start..bound.end + 2 * RIM);
    let test = cut(test, &wide, [-(RIM as isize); 2], 0);
    let at = |(columns, rows): (f64, f64)| differences(&test, &reference, [columns, rows]);
    let found = NuthKaab { reference: &reference, metres_from_cells: metres, differences: &at };
    let (cells, summary) = found.run(FARTHEST_CELLS * along_columns.max(along_rows)).ok()?;
    let is_near = cells.0.hypot(cells.1) <= FARTHEST_CELLS;
    (summary.converged && is_near).then_some([cells.0, cells.1])
}

/// Blocks of a surface.
struct Blocks {
    /// Columns and rows of the surface.
    size: (usize, usize),
    columns: usize,
    rows: usize,
}

/// What a block found along each axis, and its variance.
type Found<const N: usize> = ([f64; N], [f64; N]);

impl Blocks {
    /// Returns the columns and the rows of a quarter of a block.
    fn quarter(&self, block: usize, quarter: usize) -> [Range<usize>; 2] {
        let range = |size: usize, count: usize, block: usize, quarter: usize| {
            let bound = |k: usize| k * size / (QUARTERS * count);
            bound(QUARTERS * block + quarter)..bound(QUARTERS * block + quarter + 1)
        };
        [
            range(self.size.0, self.columns, block % self.columns, quarter % QUARTERS),
            range(self.size.1, self.rows, block / self.columns, quarter / QUARTERS),
        ]
    }

    /// Returns the shift of every block from what its quarters find, the number of blocks that
    /// found one, and the standard deviation of the true shifts along each axis.
    fn shifts<const N: usize>(
        &self,
        of_quarter: impl Fn(&[Range<usize>; 2]) -> Option<[f64; N]> + Sync,
    ) -> (Grid<[f64; N]>, usize, [f64; N]) {
        let block = |block: usize| -> Option<Found<N>> {
            let quarters = (0..QUARTERS * QUARTERS).filter_map(|quarter| of_quarter(&self.quarter(block, quarter)));
            let quarters: Vec<[f64; N]> = quarters.collect();
            (quarters.len() >= LEAST_QUARTERS).then(|| mean_and_variance(&quarters))
        };
        let found: Vec<Option<Found<N>>> = (0..self.columns * self.rows).into_par_iter().map(block).collect();
        let known: Vec<&Found<N>> = found.iter().flatten().collect();
        let tau2 = true_variance(&known);
        let shrunk = |(mean, variance): &Found<N>| -> [f64; N] {
            std::array::from_fn(|axis| match tau2[axis] {
                tau2 if tau2 > 0.0 => mean[axis] * tau2 / (tau2 + variance[axis]),
                _ => 0.0,
            })
        };
        let shifts: Vec<Option<[f64; N]>> = found.iter().map(|found| found.as_ref().map(shrunk)).collect();
        (self.completed(shifts), known.len(), tau2.map(f64::sqrt))
    }

    /// Gives blocks without a shift the mean of those beside them, from the known ones outwards.
    fn completed<const N: usize>(&self, mut shifts: Vec<Option<[f64; N]>>) -> Grid<[f64; N]> {
        let (columns, rows) = (self.columns, self.rows);
        while shifts.iter().any(Option::is_none) && shifts.iter().any(Option::is_some) {
            let beside = |at: usize| {
                let (column, row) = (at % columns, at / columns);
                let near = |k: usize, count: usize| k.saturating_sub(1)..(k + 2).min(count);
                let known = near(row, rows).flat_map(|r| near(column, columns).map(move |c| r * columns + c));
                let known: Vec<[f64; N]> = known.filter_map(|at| shifts[at]).collect();
                (!known.is_empty()).then(|| mean_and_variance(&known).0)
            };
            shifts = (0..shifts.len()).map(|at| shifts[at].or_else(|| beside(at))).collect();
        }
        let shifts = shifts.into_iter().map(|shift| shift.unwrap_or([0.0; N])).collect();
        Grid::from_vec(columns, rows, shifts).unwrap_or_else(|| Grid::filled(columns, rows, [0.0; N]))
    }
}

/// Returns the mean of values along each axis, and its variance.
fn mean_and_variance<const N: usize>(values: &[[f64; N]]) -> Found<N> {
    let count = values.len() as f64;
    let mean: [f64; N] = std::array::from_fn(|axis| values.iter().map(|value| value[axis]).sum::<f64>() / count);
    let squares = |axis: usize| values.iter().map(|value| (value[axis] - mean[axis]).powi(2)).sum::<f64>();
    (mean, std::array::from_fn(|axis| squares(axis) / ((count - 1.0).max(1.0) * count)))
}

/// Returns the mean square of the shifts beyond what their variances explain, along each axis. The
/// surfaces are aligned as a whole, so the true shifts have no mean.
fn true_variance<const N: usize>(found: &[&Found<N>]) -> [f64; N] {
    let count = found.len().max(1) as f64;
    std::array::from_fn(|axis| {
        let excess = found.iter().map(|(mean, variance)| mean[axis].powi(2) - variance[axis]).sum::<f64>();
        (excess / count).max(0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use numeric::random::{hash64, unit_interval};
    use raster::GeoTransform;

    const SIZE: usize = 480;

    fn metres() -> MetresFromCells {
        MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, 0.5), (1.0, 1.0))
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

    #[test]
    fn noise_is_no_shift() {
        let still = |_: f64, _: f64| [0.0; 3];
        let (reference, test) = (hills(3, 2.0, still), hills(4, 2.0, still));
        let found = LocalShifts::find(&test, &reference, metres(), 60.0).unwrap();
        assert!(found.largest_m.0 < 0.02 && found.largest_m.1 < 0.05, "{:?}", found.largest_m);
    }

    #[test]
    fn blocks_without_relief_take_the_shift_beside_them_and_ground_without_any_is_refused() {
        let drift = |_: f64, row: f64| [if row < 240.0 { 1.5 } else { -1.5 }, 0.0, 0.0];
        let (mut reference, test) = (hills(5, 0.2, |_, _| [0.0; 3]), hills(6, 0.2, drift));
        for row in 0..120 {
            reference.row_mut(row)[..120].fill(f32::NAN);
        }
        let found = LocalShifts::find(&test, &reference, metres(), 60.0).unwrap();
        assert_eq!(found.found, 15);
        // Beside it lie a block that is moved as it is, and others that are moved the other way.
        let (beside, filled) = (found.at(180.0, 60.0)[0], found.at(20.0, 20.0)[0]);
        assert!((beside + 1.5).abs() < 0.1 && filled < -0.3, "{beside} {filled}");
        let void = reference.map(|_| f32::NAN);
        let refused = LocalShifts::find(&test, &void, metres(), 60.0);
        assert!(matches!(refused, Err(EvalError::NoLocalShift { blocks: 16 })), "{refused:?}");
        let refused = LocalShifts::find(&test, &reference, metres(), 20.0);
        assert!(matches!(refused, Err(EvalError::BlockTooSmall { .. })), "{refused:?}");
    }
}
