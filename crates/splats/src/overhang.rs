//! The overhang of a block: its Gaussian reaches beyond the block, and where the surface there is
//! lower, it hides it.
//!
//! The harm is Σ α² d² over the cells outside the block, with α the opacity of the Gaussian there
//! and d the height of its plane above the surface. This is the squared height error of the
//! overhang if nothing else were in front. Single cells overhang too, so a block is compared with
//! its own cells taken one by one; where walls are to be seen from below, each side with the cells
//! along it: else a long block reaches far beyond its end because many cells along it hang over a
//! little. Higher surfaces beside the block hide the overhang and do not
//! count.

use raster::Grid;
use rayon::prelude::*;

use super::block::{Plane, SplatBlock};
use super::{GaussianConfig, SplatSurface};

/// Distance up to which opacity counts, standard deviations.
const REACH: f64 = 3.0;
/// Samples per standard deviation along an axis of a large block.
const SAMPLES: f64 = 4.0;

/// Harm beyond each side of a block, m² · cells.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Overhang {
    /// Beyond the first column, the last column, the first row, the last row.
    pub(super) sides: [f64; 4],
}

impl Overhang {
    pub(super) fn total(&self) -> f64 {
        self.sides.iter().sum()
    }

    /// The side with the most harm.
    pub(super) fn worst(&self) -> usize {
        (1..4).fold(0, |worst, side| if self.sides[side] > self.sides[worst] { side } else { worst })
    }

    /// The side with the most harm beyond what is allowed there; `None` where all sides are within.
    pub(super) fn worst_beyond(&self, allowed: [f64; 4]) -> Option<usize> {
        let beyond = |side: usize| self.sides[side] - allowed[side];
        let worst = (1..4).fold(0, |worst, side| if beyond(side) > beyond(worst) { side } else { worst });
        (beyond(worst) > 0.0).then_some(worst)
    }

    /// Measures the overhang of a block. Depths below `tolerance_m` do no harm.
    pub(super) fn of(
        surface: &SplatSurface<'_>,
        block: &SplatBlock,
        gaussian: &GaussianConfig,
        tolerance_m: f64,
    ) -> Self {
        let [column, row] = block.middle();
        let sigma = [block.width, block.height].map(|side| gaussian.spread * side as f64);
        let step = sigma.map(|s| (s / SAMPLES).floor().max(1.0));
        let range = |middle: f64, sigma: f64, step: f64| {
            let reach = (REACH * sigma / step).ceil() as i64;
            (-reach..=reach).map(move |i| middle + i as f64 * step)
        };
        let weight = step[0] * step[1];
        let mut overhang = Self::default();
        for r in range(row, sigma[1], step[1]) {
            for c in range(column, sigma[0], step[0]) {
                // Middles of even blocks lie between cells: the nearer cell is used.
                let cell = [c.floor() as i64, r.floor() as i64];
                let Some(side) = side_of(block, cell) else { continue };
                let d = [cell[0] as f64 - column, cell[1] as f64 - row];
                let q = (d[0] / sigma[0]).powi(2) + (d[1] / sigma[1]).powi(2);
                let hang = block.height_at(cell[0] as f64, cell[1] as f64) - surface.local_height(cell[0], cell[1]);
                if q <= REACH * REACH && hang > tolerance_m {
                    overhang.sides[side] += weight * (-q).exp() * hang * hang;
                }
            }
        }
        overhang
    }
}

/// Returns whether a block hangs over nothing by more than a tolerance.
pub(super) fn is_free(
    surface: &SplatSurface<'_>,
    block: &SplatBlock,
    gaussian: &GaussianConfig,
    tolerance_m: f64,
) -> bool {
    Overhang::of(surface, block, gaussian, tolerance_m).worst_beyond([0.0; 4]).is_none()
}

/// Returns the side of the block that a cell is beyond; `None` inside the block.
fn side_of(block: &SplatBlock, [column, row]: [i64; 2]) -> Option<usize> {
    let beyond = [
        block.column as i64 - column,
        column - (block.column + block.width) as i64 + 1,
        block.row as i64 - row,
        row - (block.row + block.height) as i64 + 1,
    ];
    let relative = |side: usize| beyond[side] as f64 / if side < 2 { block.width } else { block.height } as f64;
    let side = (1..4).fold(0, |most, side| if relative(side) > relative(most) { side } else { most });
    (beyond[side] > 0).then_some(side)
}

/// Measures the overhang of every cell taken alone, by sides.
pub(super) fn of_cells(surface: &SplatSurface<'_>, gaussian: &GaussianConfig, tolerance_m: f64) -> Grid<[f32; 4]> {
    let heights = surface.heights();
    let mut harm = Grid::filled(heights.width(), heights.height(), [0.0; 4]);
    if heights.width() > 0 {
        harm.data_mut().par_chunks_mut(heights.width()).enumerate().for_each(|(row, cells)| {
            for (column, cell) in cells.iter_mut().enumerate() {
                let middle_m = surface.local_height(column as i64, row as i64);
                if middle_m.is_finite() {
                    let [by_column_m, by_row_m] = surface.slope(column, row);
                    let plane = Plane { middle_m, by_column_m, by_row_m };
                    let block = SplatBlock { column, row, width: 1, height: 1, plane };
                    *cell = Overhang::of(surface, &block, gaussian, tolerance_m).sides.map(|harm| harm as f32);
                }
            }
        });
    }
    harm
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::GeoTransform;

    #[test]
    fn a_roof_hangs_over_the_street_and_the_street_over_nothing() {
        // A roof of 4 columns beside a street of 4.
        let heights = Grid::from_vec(8, 4, (0..32).map(|i| if i % 8 < 4 { 10.0 } else { 0.0 }).collect()).unwrap();
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(0.0, 0.0, 1.0), [0.0; 3]);
        let gaussian = GaussianConfig::default();
        let block = |column, middle_m| SplatBlock {
            column,
            row: 0,
            width: 4,
            height: 4,
            plane: Plane { middle_m, ..Plane::default() },
        };
        let roof = Overhang::of(&surface, &block(0, 10.0), &gaussian, 0.1);
        assert!(roof.sides[1] > 50.0 && roof.worst_beyond([10.0; 4]) == Some(1), "{roof:?}");
        assert_eq!(roof.worst_beyond([1e3; 4]), None);
        assert_eq!((roof.sides[0], roof.sides[2], roof.sides[3]), (0.0, 0.0, 0.0));
        assert_eq!(Overhang::of(&surface, &block(4, 0.0), &gaussian, 0.1), Overhang::default());
        let alone = of_cells(&surface, &gaussian, 0.1);
        assert!(alone[(3, 1)][1] > 0.0 && alone[(3, 1)][1] < 20.0 && alone[(2, 1)][1] < 1e-3);
        assert_eq!(alone[(4, 1)], [0.0; 4]);
    }
}
