//! Removal of small isolated patches of heights.

use raster::Grid;

/// Sets every connected patch of fewer than `min_cells` cells to NaN, and returns the number of
/// cells removed.
///
/// Cells are connected to their four neighbours where heights differ by at most `same_surface_m`.
///
/// ```
/// use raster::Grid;
///
/// let mut height_m = Grid::filled(9, 9, 10.0f32);
/// height_m[(4, 4)] = 50.0;
/// assert_eq!(sweep::fusion::remove_speckle(&mut height_m, 1.0, 4), 1);
/// ```
pub fn remove_speckle(height_m: &mut Grid<f32>, same_surface_m: f32, min_cells: usize) -> usize {
    let (w, h) = (height_m.width(), height_m.height());
    let mut seen = vec![false; w * h];
    let (mut patch, mut removed) = (Vec::new(), 0);
    for seed in 0..w * h {
        if seen[seed] || height_m.data()[seed].is_nan() {
            continue;
        }
        patch.clear();
        patch.push(seed);
        seen[seed] = true;
        let mut next = 0;
        while let Some(&p) = patch.get(next) {
            next += 1;
            let own = height_m.data()[p];
            for q in neighbours(p, w, h) {
                if !seen[q] && (height_m.data()[q] - own).abs() <= same_surface_m {
                    seen[q] = true;
                    patch.push(q);
                }
            }
        }
        if patch.len() < min_cells {
            removed += patch.len();
            patch.iter().for_each(|&p| height_m.data_mut()[p] = f32::NAN);
        }
    }
    removed
}

/// Returns the up to four neighbours of a cell.
fn neighbours(p: usize, w: usize, h: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (p % w, p / w);
    let left = (x > 0).then(|| p - 1);
    let right = (x + 1 < w).then(|| p + 1);
    let up = (y > 0).then(|| p - w);
    let down = (y + 1 < h).then(|| p + w);
    [left, right, up, down].into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_patch_goes_and_a_large_one_stays() {
        let mut g = Grid::filled(10, 10, 5.0f32);
        g[(4, 4)] = 50.0;
        assert_eq!(remove_speckle(&mut g, 1.0, 4), 1);
        assert!(g[(4, 4)].is_nan());
        assert_eq!(g.data().iter().filter(|v| v.is_nan()).count(), 1);
    }
}
