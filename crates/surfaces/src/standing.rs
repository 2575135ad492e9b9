//! The ground under a camera on a surface model, where the surface there may be a roof or a tree.
//!
//! A low opening decides whether something may stand there: the greatest of the minima of all
//! squares that hold the camera. On a slope it is the surface, under an object narrower than the
//! squares it is the ground, and on a hill it is lower than the surface. So where it is lower, the
//! bare ground of the tile is found as for a terrain model, and has the last word.

use heightmap::ground_height;
use numeric::Silent;
use raster::Grid;
use terrain::{BareGround, GroundConfig, UNDER_OBJECT, bare_ground};

/// Half the side of the squares, metres: those of a block of houses, and a quarter of a tile at
/// most, so that squares do not reach beyond it.
const REACH_M: f64 = 50.0;
/// Height above the opening up to which the surface is the ground, metres: less than a storey, and
/// more than the noise of satellite models and the height of vehicles.
pub(crate) const LEAST_OBJECT_M: f64 = 2.0;

/// Returns the ground in the middle of a tile, in the unit of its heights; `None` if there is no
/// height near.
pub(crate) fn ground_under(heights: &Grid<f32>, resolution_px_per_m: f64) -> Option<f64> {
    let surface = ground_height(heights, resolution_px_per_m)?;
    let low = low_opening(heights, resolution_px_per_m).unwrap_or(surface);
    if surface - low <= LEAST_OBJECT_M {
        return Some(surface);
    }
    let config = GroundConfig::default();
    let bare = bare_ground(heights, 1.0 / resolution_px_per_m, &config, &Silent).ok();
    let under = bare.filter(stands_in_the_middle).and_then(|bare| ground_height(&bare.heights, resolution_px_per_m));
    Some(under.filter(|under| *under < surface).unwrap_or(surface))
}

/// Returns whether an object stands in the middle of a tile.
fn stands_in_the_middle(bare: &BareGround) -> bool {
    let (column, row) = (bare.states.width() / 2, bare.states.height() / 2);
    bare.states[(column, row)] == UNDER_OBJECT
}

/// Returns the greatest of the minima of the squares that hold the middle; `None` without heights.
fn low_opening(heights: &Grid<f32>, resolution_px_per_m: f64) -> Option<f64> {
    // Squares of pixels of about a metre become one, at their lowest.
    let factor = (resolution_px_per_m.round() as usize).max(1);
    let (width, height) = (heights.width() / factor, heights.height() / factor);
    let reach = ((REACH_M * resolution_px_per_m) as usize / factor).min(width.min(height) / 4);
    if reach == 0 {
        return None;
    }
    let lowest_of = |x: usize, y: usize| {
        let rows = y * factor..(y + 1) * factor;
        rows.flat_map(|row| heights.row(row)[x * factor..(x + 1) * factor].iter()).copied().fold(f32::NAN, f32::min)
    };
    let (left, top) = (width / 2 - 2 * reach, height / 2 - 2 * reach);
    let side = (4 * reach + 1).min(width - left).min(height - top);
    let near = |i: usize, j: usize| lowest_of(left + i, top + j);
    let cells: Vec<f32> = (0..side * side).map(|at| near(at % side, at / side)).collect();
    let squares = 2 * reach + 1;
    // Minima along rows, then along columns.
    let along = |at: usize, step: usize| (0..squares).map(|k| cells[at + k * step]).fold(f32::NAN, f32::min);
    let count = side + 1 - squares.min(side);
    let mut rows = vec![f32::NAN; count * side];
    for y in 0..side {
        for x in 0..count {
            rows[y * count + x] = along(y * side + x, 1);
        }
    }
    let minima = (0..count * count).map(|at| {
        let (x, y) = (at % count, at / count);
        (0..squares).map(|k| rows[(y + k) * count + x]).fold(f32::NAN, f32::min)
    });
    let opened = minima.fold(f32::NAN, f32::max);
    opened.is_finite().then(|| f64::from(opened))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 256;

    fn tile(height: impl Fn(f64, f64) -> f64) -> Grid<f32> {
        let at = |i: usize| (i as f64 + 0.5 - SIDE as f64 / 2.0) / 2.0;
        let cells = (0..SIDE * SIDE).map(|i| height(at(i % SIDE), at(i / SIDE)) as f32);
        Grid::from_vec(SIDE, SIDE, cells.collect()).unwrap()
    }

    fn is_house(x: f64, y: f64) -> bool {
        x.abs() < 8.0 && y.abs() < 6.0
    }

    #[test]
    fn the_ground_under_a_roof_is_that_beside_it() {
        let found = ground_under(&tile(|x, y| if is_house(x, y) { 9.0 } else { 0.0 }), 2.0).unwrap();
        assert!(found.abs() < 0.3, "{found}");
        let slope = |x: f64, y: f64| 0.1 * x + if is_house(x, y) { 9.0 } else { 0.0 };
        let found = ground_under(&tile(slope), 2.0).unwrap();
        assert!(found.abs() < 0.8, "{found}");
    }

    #[test]
    fn a_slope_a_hill_and_the_street_beside_a_house_are_ground() {
        let found = |height: &dyn Fn(f64, f64) -> f64| ground_under(&tile(height), 2.0).unwrap();
        assert!(found(&|x, y| 0.3 * x - 0.2 * y).abs() < 1e-3);
        let hill = |x: f64, y: f64| 12.0 * (-(x * x + y * y) / (2.0 * 40.0 * 40.0)).exp();
        assert!((found(&hill) - 12.0).abs() < 0.1, "{}", found(&hill));
        assert_eq!(found(&|x, _| if x > 3.0 { 9.0 } else { 0.0 }), 0.0);
    }

    #[test]
    fn small_and_empty_tiles_have_what_they_have() {
        assert_eq!(ground_under(&Grid::filled(3, 3, 5.0), 2.0), Some(5.0));
        assert_eq!(ground_under(&Grid::filled(64, 64, f32::NAN), 2.0), None);
    }
}
