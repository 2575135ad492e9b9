//! Euclidean distance of every cell to the nearest marked cell, in metres (Felzenszwalb and
//! Huttenlocher 2012, Theory of Computing 8, 415-428). It is exact, takes linear time and allows
//! any side lengths.

use raster::Grid;
use rayon::prelude::*;

/// Returns the distances between cell centres. They are infinite if no cell is marked.
pub(crate) fn distances_m(marked: &Grid<bool>, cell_size_m: (f64, f64)) -> Grid<f32> {
    let (width, height) = (marked.width(), marked.height());
    let columns = marked.map(|&m| if m { 0.0 } else { f64::INFINITY }).transposed();
    let along_columns = squared(columns, cell_size_m.1);
    let both = squared(along_columns.transposed(), cell_size_m.0);
    debug_assert_eq!((both.width(), both.height()), (width, height));
    both.map(|d| d.sqrt() as f32)
}

/// One parabola of a lower envelope.
struct Parabola {
    /// Cell of its vertex.
    foot: usize,
    /// Squared distance at its vertex, square metres.
    base: f64,
    /// Position from which it is the lowest, in cells.
    from: f64,
}

/// Replaces every row by the lower envelope of the parabolas that stand on its cells.
fn squared(mut grid: Grid<f64>, spacing_m: f64) -> Grid<f64> {
    let width = grid.width().max(1);
    grid.data_mut().par_chunks_mut(width).for_each(|row| {
        // Parabolas of the envelope, from left to right.
        let mut envelope: Vec<Parabola> = Vec::new();
        let square = spacing_m * spacing_m;
        for (foot, &base) in row.iter().enumerate().filter(|(_, base)| base.is_finite()) {
            let mut from = f64::NEG_INFINITY;
            while let Some(other) = envelope.last() {
                let (q, p) = (foot as f64, other.foot as f64);
                from = ((base / square + q * q) - (other.base / square + p * p)) / (2.0 * (q - p));
                if from > other.from {
                    break;
                }
                envelope.pop();
                from = f64::NEG_INFINITY;
            }
            envelope.push(Parabola { foot, base, from });
        }
        let mut next = 0;
        for (cell, value) in row.iter_mut().enumerate() {
            while envelope.get(next + 1).is_some_and(|parabola| parabola.from < cell as f64) {
                next += 1;
            }
            if let Some(parabola) = envelope.get(next) {
                *value = parabola.base + square * (cell as f64 - parabola.foot as f64).powi(2);
            }
        }
    });
    grid
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_the_distance_to_the_nearest_of_all_marked_cells(
            marks in prop::collection::vec((0usize..9, 0usize..7), 0..6), sides in (0.2..3.0f64, 0.2..3.0f64),
        ) {
            let mut marked = Grid::filled(9, 7, false);
            marks.iter().for_each(|&place| marked[place] = true);
            let found = distances_m(&marked, sides);
            for row in 0..7 {
                for column in 0..9 {
                    let to = |&(c, r): &(usize, usize)| {
                        ((column as f64 - c as f64) * sides.0).hypot((row as f64 - r as f64) * sides.1)
                    };
                    let nearest = marks.iter().map(to).fold(f64::INFINITY, f64::min) as f32;
                    let error = (found[(column, row)] - nearest).abs();
                    prop_assert!(found[(column, row)] == nearest || error < 1e-5);
                }
            }
        }
    }

    #[test]
    fn an_empty_grid_has_no_distances() {
        assert_eq!(distances_m(&Grid::filled(0, 3, true), (1.0, 1.0)).data().len(), 0);
    }
}
