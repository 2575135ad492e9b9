//! The ground without the noise of its heights.
//!
//! The noise of a surface made from images is alike in neighbouring cells, so it looks like bumps
//! of the ground. The surface says how large it is: every height comes with its standard error. The
//! ground is the thin plate of [`crate::plate`] through all heights, which counts each by its
//! standard error, so bumps vanish that are lower than the noise. Areas that stand out of the plate
//! by more than the noise, as beside a retaining wall, keep their heights.

use raster::Grid;

use crate::coarse::{spread, weighted_blocks};
use crate::config::NOISE_DEVIATIONS;
use crate::error::TerrainError;
use crate::ground::{BareGround, GROUND, NOISE_MIN_M, work_side};
use crate::plate::{CURVATURE, smooth_plate};
use crate::regions::Regions;

/// Standard error of heights that were interpolated, metres: about the error of the ground under
/// objects of places seen in images (`benches/results/terrain_outside.md`). They hold the plate
/// where nothing else does, under forests. Half and twice of it hardly matter.
const INTERPOLATED_M: f32 = 0.5;
/// Smallest area of heights that stand out of the plate and are a step of the ground, square
/// metres: two metres on both sides of a wall of some metres. Smaller ones are wrong matches.
const LEAST_STEP_M2: f64 = 10.0;

/// Smooths the ground as far as its heights are uncertain. `sigma_m` holds the standard error of
/// each height of the surface, metres, and NaN where it has none.
///
/// # Errors
/// [`TerrainError::Layer`] for standard errors of another number of cells.
///
/// ```
/// use numeric::Silent;
/// use raster::Grid;
/// use terrain::{GroundConfig, bare_ground, without_noise};
///
/// let bumps = (0..60 * 60).map(|i| if (i % 60 / 3 + i / 180) % 2 == 0 { 9.9 } else { 10.1 });
/// let surface = Grid::from_vec(60, 60, bumps.collect()).expect("60 by 60 cells");
/// let found = bare_ground(&surface, 1.0, &GroundConfig::default(), &Silent)?;
/// let ground = without_noise(found, &Grid::filled(60, 60, 0.2), 1.0)?;
/// assert!((ground.heights[(30, 30)] - 10.0).abs() < 0.03);
/// # Ok::<(), terrain::TerrainError>(())
/// ```
pub fn without_noise(ground: BareGround, sigma_m: &Grid<f32>, cell_m: f64) -> Result<BareGround, TerrainError> {
    let BareGround { mut heights, states } = ground;
    let (found, expected) = ((sigma_m.width(), sigma_m.height()), (heights.width(), heights.height()));
    if found != expected {
        return Err(TerrainError::Layer { found, expected });
    }
    let sigma_of = |at: usize| match (states.data()[at], sigma_m.data()[at]) {
        (GROUND, sigma) if sigma.is_finite() => sigma.max(NOISE_MIN_M as f32),
        _ => INTERPOLATED_M,
    };
    let side = work_side(cell_m);
    // The standard errors count as if those of neighbours were independent.
    let (means, weights) = weighted_blocks(&heights, side, |at| ((CURVATURE / cell_m) as f32 / sigma_of(at)).powi(2));
    let smooth = spread(&smooth_plate(&means, &weights, cell_m * side as f64), side, expected);
    let mut stands_out = heights.map(|_| false);
    for (at, stands_out) in stands_out.data_mut().iter_mut().enumerate() {
        let limit_m = NOISE_DEVIATIONS as f32 * sigma_of(at);
        *stands_out = states.data()[at] == GROUND && (heights.data()[at] - smooth.data()[at]).abs() > limit_m;
    }
    let regions = Regions::of(&stands_out);
    let least = LEAST_STEP_M2 / (cell_m * cell_m);
    let is_step = regions.mask(|region| regions.cells(region).len() as f64 >= least);
    for (at, height) in heights.data_mut().iter_mut().enumerate().filter(|(_, height)| !height.is_nan()) {
        if !is_step.data()[at] {
            *height = smooth.data()[at];
        }
    }
    Ok(BareGround { heights, states })
}

#[cfg(test)]
mod tests {
    use super::*;
    use numeric::random::{hash64, unit_interval};

    const CELL_M: f64 = 0.5;
    const SIDE: usize = 160;

    /// Noise of up to `2·amplitude` that is alike within 4 × 4 cells.
    fn noise(column: usize, row: usize, amplitude: f32) -> f32 {
        let patch = (column / 4 * SIDE + row / 4) as u64;
        amplitude * (2.0 * unit_interval(hash64(patch)) as f32 - 1.0)
    }

    fn ground_of(z: impl Fn(usize, usize) -> f32) -> BareGround {
        let cells = (0..SIDE * SIDE).map(|at| z(at % SIDE, at / SIDE)).collect();
        let heights = Grid::from_vec(SIDE, SIDE, cells).unwrap();
        let states = heights.map(|_| GROUND);
        BareGround { heights, states }
    }

    fn rms(found: &Grid<f32>, truth: impl Fn(usize, usize) -> f32) -> f32 {
        let squares = (0..SIDE * SIDE).map(|at| (found.data()[at] - truth(at % SIDE, at / SIDE)).powi(2));
        (squares.sum::<f32>() / (SIDE * SIDE) as f32).sqrt()
    }

    #[test]
    fn noise_of_a_slope_becomes_a_fraction() {
        let slope = |column: usize, row: usize| 200.0 + 0.1 * column as f32 - 0.05 * row as f32;
        let noisy = ground_of(|column, row| slope(column, row) + noise(column, row, 0.5));
        let before = rms(&noisy.heights, slope);
        let after = rms(&without_noise(noisy, &Grid::filled(SIDE, SIDE, 0.3), CELL_M).unwrap().heights, slope);
        assert!(after < 0.5 * before, "{before} to {after}");
    }

    #[test]
    fn a_retaining_wall_stays_where_it_is_higher_than_the_noise() {
        let terrace = |column: usize, _: usize| if column < SIDE / 2 { 100.0 } else { 103.0 };
        let found = without_noise(ground_of(terrace), &Grid::filled(SIDE, SIDE, 0.1), CELL_M).unwrap();
        let worst = |columns: std::ops::Range<usize>| {
            let errors = columns.map(|column| (found.heights[(column, 80)] - terrace(column, 80)).abs());
            errors.fold(0.0, f32::max)
        };
        assert!(worst(0..SIDE) <= 0.3, "{}", worst(0..SIDE));
        assert!(worst(0..SIDE / 2 - 20) < 0.1, "{}", worst(0..SIDE / 2 - 20));
    }

    #[test]
    fn a_speck_goes() {
        let flat = |column: usize, row: usize| if (40..43).contains(&column) && row == 70 { 12.0 } else { 10.0 };
        let found = without_noise(ground_of(flat), &Grid::filled(SIDE, SIDE, 0.1), CELL_M).unwrap();
        assert!((found.heights[(41, 70)] - 10.0).abs() < 0.1, "{}", found.heights[(41, 70)]);
    }

    #[test]
    fn voids_stay_and_exact_heights_hardly_move() {
        let hill =
            |column: usize, row: usize| 50.0 - 0.001 * ((column as f32 - 80.0).powi(2) + (row as f32 - 80.0).powi(2));
        let mut ground = ground_of(hill);
        ground.heights[(3, 4)] = f32::NAN;
        let found = without_noise(ground, &Grid::filled(SIDE, SIDE, 0.01), CELL_M).unwrap();
        assert!(found.heights[(3, 4)].is_nan());
        let moved = (0..SIDE).map(|column| (found.heights[(column, 80)] - hill(column, 80)).abs()).fold(0.0, f32::max);
        assert!(moved < 0.01, "{moved}");
    }

    #[test]
    fn other_sizes_are_refused() {
        let error = without_noise(ground_of(|_, _| 1.0), &Grid::filled(3, 2, 0.1), CELL_M).unwrap_err();
        assert!(matches!(error, TerrainError::Layer { found: (3, 2), expected: (SIDE, SIDE) }), "{error}");
    }
}
