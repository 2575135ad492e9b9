//! The cells of a grid inside a polygon.

use crate::grid::Grid;

/// Marks the cells whose centres lie inside a polygon, by the even-odd rule: what an odd number of
/// rings encloses is inside, so that holes are rings like others.
///
/// Rings are in cells: the centre of the first cell is at (0, 0). They are closed from the last
/// corner to the first. Centres on a shared border belong to one of two neighbouring polygons.
///
/// ```
/// let mut inside = raster::Grid::filled(4, 3, false);
/// raster::mark_inside(&[vec![(0.5, -0.5), (2.5, -0.5), (2.5, 1.5), (0.5, 1.5)]], &mut inside);
/// assert_eq!(inside.row(1), [false, true, true, false]);
/// assert!(!inside.row(2).contains(&true));
/// ```
pub fn mark_inside(rings: &[Vec<(f64, f64)>], cells: &mut Grid<bool>) {
    let (width, height) = (cells.width(), cells.height());
    let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); height];
    let first_at = |v: f64, end: usize| v.ceil().clamp(0.0, end as f64) as usize;
    for ring in rings {
        let before = ring.iter().cycle().skip(ring.len().saturating_sub(1));
        for (&(x0, y0), &(x1, y1)) in before.zip(ring) {
            if !(x0.is_finite() && y0.is_finite() && x1.is_finite() && y1.is_finite()) {
                continue;
            }
            // Half-open: a row through a corner crosses one of the two edges there.
            let rows = first_at(y0.min(y1), height)..first_at(y0.max(y1), height);
            for (row, crossings) in rows.clone().zip(&mut crossings[rows]) {
                crossings.push(x0 + (row as f64 - y0) / (y1 - y0) * (x1 - x0));
            }
        }
    }
    for (row, crossings) in crossings.iter_mut().enumerate() {
        crossings.sort_unstable_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let (from, to) = (first_at(pair[0], width), first_at(pair[1], width));
            cells.row_mut(row)[from..to].fill(true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inside(rings: &[Vec<(f64, f64)>]) -> Vec<(usize, usize)> {
        let mut cells = Grid::filled(20, 20, false);
        mark_inside(rings, &mut cells);
        (0..400).map(|i| (i % 20, i / 20)).filter(|at| cells[*at]).collect()
    }

    fn square(low: f64, high: f64) -> Vec<(f64, f64)> {
        vec![(low, low), (high, low), (high, high), (low, high)]
    }

    #[test]
    fn a_hole_is_outside() {
        let found = inside(&[square(1.5, 10.5), square(3.5, 5.5)]);
        assert_eq!(found.len(), 81 - 4);
        assert!(found.contains(&(2, 2)) && !found.contains(&(4, 4)));
    }

    /// Corners and edges on the centres of cells.
    #[test]
    fn neighbours_share_no_cell() {
        let whole = inside(&[vec![(2.0, 2.0), (12.0, 2.0), (12.0, 12.0), (2.0, 12.0)]]);
        let below = inside(&[vec![(2.0, 2.0), (12.0, 12.0), (2.0, 12.0)]]);
        let above = inside(&[vec![(2.0, 2.0), (12.0, 2.0), (12.0, 12.0)]]);
        assert!(below.iter().all(|cell| !above.contains(cell)));
        assert_eq!((below.len() + above.len(), whole.len()), (100, 100));
    }

    #[test]
    fn what_reaches_outside_is_cut() {
        assert_eq!(inside(&[square(-1e9, 1e9)]).len(), 400);
        assert_eq!(inside(&[square(-50.0, -40.0)]), []);
        assert_eq!(inside(&[vec![(1.0, 1.0), (f64::NAN, 3.0)], vec![], vec![(1.0, 1.0)]]), []);
    }
}
