//! How far a surface is from a plane around each cell.
//!
//! The plane of a window is the least-squares plane; on a full square window its coefficients are
//! sums over the window. Windows with voids or with cells that do not count have none.

use raster::{Grid, lowest};

/// Returns, for each cell, the least root-mean-square residual of the planes of all windows of
/// (2 `reach` + 1)² cells that hold the cell, metres. Only windows whose cells all `count` are
/// looked at; cells in none of them are infinitely rough.
pub(crate) fn least_residual(surface: &Grid<f32>, counts: &Grid<bool>, reach: usize) -> Grid<f32> {
    let least = lowest(&residuals(surface, counts, reach), reach);
    least.map(|residual| if residual.is_nan() { f32::INFINITY } else { *residual })
}

/// Returns the root-mean-square residual of the plane of the window around each cell, metres;
/// infinite where a cell of the window does not count.
pub(crate) fn residuals(surface: &Grid<f32>, counts: &Grid<bool>, reach: usize) -> Grid<f32> {
    let (width, height) = (surface.width(), surface.height());
    let mut residuals = Grid::filled(width, height, f32::INFINITY);
    for row in reach..height.saturating_sub(reach) {
        for column in reach..width.saturating_sub(reach) {
            if counts[(column, row)] {
                residuals[(column, row)] = residual(surface, counts, reach, (column, row));
            }
        }
    }
    residuals
}

/// Returns the median of the residuals of windows whose cells all `count`, metres; `None` for fewer
/// than `windows_min` windows. Windows that overlap by more than half tell nothing new, and are
/// left out.
pub(crate) fn median_residual(
    surface: &Grid<f32>,
    counts: &Grid<bool>,
    reach: usize,
    windows_min: usize,
) -> Option<f64> {
    let (width, height) = (surface.width(), surface.height());
    let middles = |size: usize| (reach..size.saturating_sub(reach)).step_by(reach + 1);
    let cells = middles(height).flat_map(|row| middles(width).map(move |column| (column, row)));
    let found = cells.filter(|cell| counts[*cell]).map(|cell| residual(surface, counts, reach, cell));
    let mut found: Vec<f32> = found.filter(|r| r.is_finite()).collect();
    if found.len() < windows_min { None } else { numeric::upper_median(&mut found).map(f64::from) }
}

/// Returns the root-mean-square residual of the plane around a cell; infinite where a cell of the
/// window does not count.
fn residual(surface: &Grid<f32>, counts: &Grid<bool>, reach: usize, (column, row): (usize, usize)) -> f32 {
    let middle = f64::from(surface[(column, row)]);
    let (mut sum, mut along, mut across, mut squares, mut of_steps) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for y in row - reach..=row + reach {
        for x in column - reach..=column + reach {
            if !counts[(x, y)] {
                return f32::INFINITY;
            }
            let h = f64::from(surface[(x, y)]) - middle;
            let (dx, dy) = (x as f64 - column as f64, y as f64 - row as f64);
            sum += h;
            along += h * dx;
            across += h * dy;
            squares += h * h;
            of_steps += dx * dx;
        }
    }
    let count = ((2 * reach + 1) * (2 * reach + 1)) as f64;
    let explained = sum * sum / count + (along * along + across * across) / of_steps.max(1.0);
    ((squares - explained).max(0.0) / count).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gable_is_smooth_up_to_its_ridge_and_a_dome_is_not() {
        let shape = |of: fn(f32, f32) -> f32| {
            Grid::from_vec(24, 24, (0..576).map(|i| of((i % 24) as f32, (i / 24) as f32)).collect()).unwrap()
        };
        let all = Grid::filled(24, 24, true);
        let gable = least_residual(&shape(|x, y| 9.0 - 0.4 * (x - 11.5).abs() + 0.1 * y), &all, 3);
        assert!(gable.data().iter().all(|r| *r < 1e-3));
        let dome = least_residual(&shape(|x, y| 5.0 - 0.05 * ((x - 12.0).powi(2) + (y - 12.0).powi(2))), &all, 3);
        assert!(dome.data().iter().all(|r| *r > 0.2));
    }

    #[test]
    fn the_median_residual_is_the_noise_of_level_ground() {
        let noisy: Vec<f32> = (0..10_000).map(|i| if (i * 7919) % 2 == 0 { 0.1 } else { -0.1 }).collect();
        let surface = Grid::from_vec(100, 100, noisy).unwrap();
        let all = Grid::filled(100, 100, true);
        let found = median_residual(&surface, &all, 3, 100).unwrap();
        assert!((found - 0.1).abs() < 0.02, "{found}");
        assert_eq!(median_residual(&surface, &all, 3, 1000), None, "too few windows");
    }

    #[test]
    fn windows_with_cells_that_do_not_count_have_no_plane() {
        let (surface, mut counts) = (Grid::filled(15, 15, 1.0f32), Grid::filled(15, 15, true));
        counts[(7, 7)] = false;
        let found = least_residual(&surface, &counts, 3);
        assert!(found[(7, 7)].is_infinite() || found[(7, 7)] == 0.0);
        assert_eq!(found[(0, 0)], 0.0);
    }
}
