//! Slope and aspect by Horn's derivative (Proc. IEEE 69, 1981): differences over the eight
//! neighbours with weights 1, 2, 1.
//!
//! Gradients are in metres per metre along the map's x and y axes. They are NaN if the 3 × 3
//! neighbourhood is not complete.

use crate::alignment::align::MetresFromCells;
use raster::Grid;
use rayon::prelude::*;

/// Returns the gradient of every cell along x and y. It is NaN if a neighbour is void or outside.
pub(crate) fn gradients(heights: &Grid<f32>, metres_from_cells: MetresFromCells) -> Grid<[f32; 2]> {
    let (width, height) = (heights.width(), heights.height());
    let mut found = Grid::filled(width, height, [f32::NAN; 2]);
    if width < 3 || height < 3 {
        return found;
    }
    found.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        if row == 0 || row + 1 == height {
            return;
        }
        let rows = [heights.row(row - 1), heights.row(row), heights.row(row + 1)];
        for (column, out) in out.iter_mut().enumerate().take(width - 1).skip(1) {
            let h = |r: usize, c: usize| f64::from(rows[r][column + c - 1]);
            if h(1, 1).is_finite() {
                let across = |c: usize| h(0, c) + 2.0 * h(1, c) + h(2, c);
                let along = |r: usize| h(r, 0) + 2.0 * h(r, 1) + h(r, 2);
                let (x, y) = metres_from_cells.gradient((across(2) - across(0)) / 8.0, (along(2) - along(0)) / 8.0);
                *out = [x as f32, y as f32];
            }
        }
    });
    found
}

/// Returns the tangent of the slope.
pub(crate) fn steepness(gradient: [f32; 2]) -> f64 {
    f64::from(gradient[0]).hypot(f64::from(gradient[1]))
}

/// Returns the slope of every cell, degrees. It is NaN if the 3 × 3 neighbourhood is not complete.
pub fn slope_deg(heights: &Grid<f32>, metres_from_cells: MetresFromCells) -> Grid<f32> {
    gradients(heights, metres_from_cells).map(|&g| steepness(g).atan().to_degrees() as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use raster::GeoTransform;

    proptest! {
        #[test]
        fn a_plane_has_its_slope_everywhere_inside(gx in -3.0..3.0f64, gy in -3.0..3.0f64, cell in 0.3..5.0f64) {
            let grid = GeoTransform::north_up(0.0, 0.0, cell);
            let at = |i: usize| {
                let (x, y) = grid.map_from_cell((i % 7) as f64, (i / 7) as f64);
                (gx * x + gy * y) as f32
            };
            let plane = Grid::from_vec(7, 6, (0..42).map(at).collect()).unwrap();
            let slopes = slope_deg(&plane, MetresFromCells::new(&grid, (1.0, 1.0)));
            let expected = gx.hypot(gy).atan().to_degrees();
            prop_assert!((f64::from(slopes[(3, 3)]) - expected).abs() < 1e-2);
            prop_assert!(slopes[(0, 3)].is_nan() && slopes[(3, 5)].is_nan());
        }
    }

    #[test]
    fn a_void_takes_the_slope_of_its_neighbours() {
        let mut flat = Grid::filled(7, 7, 3.0f32);
        flat[(3, 3)] = f32::NAN;
        let metres = MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, 1.0), (1.0, 1.0));
        let slopes = slope_deg(&flat, metres);
        assert!(slopes[(3, 3)].is_nan() && slopes[(2, 4)].is_nan());
        assert_eq!(slopes[(5, 5)], 0.0);
        assert!(slope_deg(&Grid::filled(2, 9, 0.0), metres).data().iter().all(|s| s.is_nan()));
    }
}
