//! A membrane through known heights: Laplace's equation on the unknown cells, solved from coarse to
//! fine cells. Borders of the raster are free (no slope across them).

use raster::Grid;

/// Sweeps over the unknown cells of each level. The coarser level has done the rest.
const SWEEPS: usize = 24;
/// Over-relaxation of a sweep, which carries heights faster into wide gaps.
const RELAXATION: f32 = 1.6;

/// Fills the NaN cells of a surface. A surface without any height stays as it is.
pub(crate) fn filled(known: &Grid<f32>) -> Grid<f32> {
    if !known.data().iter().any(|h| h.is_nan()) || known.data().iter().all(|h| h.is_nan()) {
        return known.clone();
    }
    let (width, height) = (known.width(), known.height());
    let coarse = filled(&halved(known));
    let mut out = known.clone();
    let mut unknown = Vec::new();
    for row in 0..height {
        for column in 0..width {
            if out[(column, row)].is_nan() {
                out[(column, row)] = doubled_at(&coarse, column, row);
                unknown.push((row * width + column) as u32);
            }
        }
    }
    for _ in 0..SWEEPS {
        sweep(&mut out, &unknown);
    }
    out
}

/// Moves every unknown cell towards the mean of its neighbours.
fn sweep(out: &mut Grid<f32>, unknown: &[u32]) {
    let (width, height) = (out.width(), out.height());
    let cells = out.data_mut();
    for &cell in unknown {
        let at = cell as usize;
        let (column, row) = (at % width, at / width);
        // A neighbour beyond the border has the height of the cell itself.
        let own = cells[at];
        let left = if column > 0 { cells[at - 1] } else { own };
        let right = if column + 1 < width { cells[at + 1] } else { own };
        let above = if row > 0 { cells[at - width] } else { own };
        let below = if row + 1 < height { cells[at + width] } else { own };
        cells[at] = own + RELAXATION * (0.25 * (left + right + above + below) - own);
    }
}

/// Means of the known heights of 2 × 2 cells.
pub(crate) fn halved(fine: &Grid<f32>) -> Grid<f32> {
    let (width, height) = (fine.width().div_ceil(2), fine.height().div_ceil(2));
    let mut coarse = Grid::filled(width, height, f32::NAN);
    for row in 0..height {
        for column in 0..width {
            let (mut sum, mut count) = (0.0_f64, 0);
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                if let Some(h) = fine.get(2 * column + dx, 2 * row + dy).filter(|h| !h.is_nan()) {
                    sum += f64::from(*h);
                    count += 1;
                }
            }
            if count > 0 {
                coarse[(column, row)] = (sum / f64::from(count)) as f32;
            }
        }
    }
    coarse
}

/// Interpolates a coarse level at a cell of the level that is twice as fine.
pub(crate) fn doubled_at(coarse: &Grid<f32>, column: usize, row: usize) -> f32 {
    let place = |at: usize, count: usize| {
        let near = at / 2;
        let far = if at % 2 == 1 { (near + 1).min(count - 1) } else { near.saturating_sub(1) };
        (near, far)
    };
    let ((x, x_far), (y, y_far)) = (place(column, coarse.width()), place(row, coarse.height()));
    let line = |y: usize| 0.75 * coarse[(x, y)] + 0.25 * coarse[(x_far, y)];
    0.75 * line(y) + 0.25 * line(y_far)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_goes_on_under_a_wide_gap() {
        let plane = |x: usize, y: usize| 0.2 * x as f32 - 0.1 * y as f32;
        let mut surface = Grid::filled(301, 200, 0.0);
        for y in 0..200 {
            for x in 0..301 {
                let is_gap = (60..210).contains(&x) && (40..160).contains(&y);
                surface[(x, y)] = if is_gap { f32::NAN } else { plane(x, y) };
            }
        }
        let found = filled(&surface);
        let worst = (0..60_200).map(|at| (found.data()[at] - plane(at % 301, at / 301)).abs()).fold(0.0, f32::max);
        assert!(worst < 0.25, "{worst}");
    }

    #[test]
    fn one_height_fills_everything_and_none_fills_nothing() {
        let mut surface = Grid::filled(7, 5, f32::NAN);
        assert!(filled(&surface).data().iter().all(|h| h.is_nan()));
        surface[(3, 1)] = 4.0;
        assert!(filled(&surface).data().iter().all(|h| (h - 4.0).abs() < 1e-4));
    }
}
