//! The length of a region's border, without the bias of stairs that cells make of slanted walls.

use raster::Grid;

/// Cells around a region that the smoothing and the gradient reach.
const MARGIN: usize = 3;

/// Returns the length of the border of a set of cells, in cells.
///
/// It is the sum of the gradient of the set's indicator, smoothed over three by three cells: each
/// piece of border contributes its length, whatever its direction.
pub(crate) fn perimeter(cells: &[usize], width: usize) -> f64 {
    let place = |at: &usize| (at % width, at / width);
    let Some(first) = cells.first().map(place) else { return 0.0 };
    let bounds = cells
        .iter()
        .map(place)
        .fold((first, first), |(low, high), (x, y)| ((low.0.min(x), low.1.min(y)), (high.0.max(x), high.1.max(y))));
    let ((left, top), (right, bottom)) = bounds;
    let mut inside = Grid::filled(right - left + 1 + 2 * MARGIN, bottom - top + 1 + 2 * MARGIN, 0.0);
    cells.iter().map(place).for_each(|(x, y)| inside[(x - left + MARGIN, y - top + MARGIN)] = 1.0);
    let mut smooth = Grid::filled(inside.width(), inside.height(), 0.0);
    for y in 1..inside.height() - 1 {
        for x in 1..inside.width() - 1 {
            let sum: f64 = (0..9).map(|k| inside[(x + k % 3 - 1, y + k / 3 - 1)]).sum();
            smooth[(x, y)] = sum / 9.0;
        }
    }
    let mut length = 0.0;
    for y in 1..inside.height() - 1 {
        for x in 1..inside.width() - 1 {
            let across = smooth[(x + 1, y)] - smooth[(x - 1, y)];
            let along = smooth[(x, y + 1)] - smooth[(x, y - 1)];
            length += 0.5 * f64::hypot(across, along);
        }
    }
    length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turned_squares_have_the_perimeter_of_squares() {
        for angle in [0.0f64, 0.3, 0.785] {
            let (sin, cos) = angle.sin_cos();
            let is_in = |at: &usize| {
                let (x, y) = ((at % 80) as f64 - 39.7, (at / 80) as f64 - 39.2);
                (x * cos + y * sin).abs() < 15.0 && (y * cos - x * sin).abs() < 15.0
            };
            let cells: Vec<usize> = (0..6400).filter(is_in).collect();
            let found = perimeter(&cells, 80);
            assert!((found / 120.0 - 1.0).abs() < 0.04, "{angle}: {found}");
        }
    }
}
