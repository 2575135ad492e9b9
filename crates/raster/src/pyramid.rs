//! Image pyramids by factors of two, with an explicit geometry.
//!
//! A pixel p of level l is centred at `(p + 0.5) · 2^l − 0.5` of level 0. One reduction convolves
//! with the binomial (1, 3, 3, 1) / 8 along rows and columns. It is centred between the two pixels
//! that become one, and suppresses frequencies that the coarser grid cannot represent. Averages are
//! taken over valid pixels only (normalised convolution). A pixel is valid if at least half of the
//! filter's weight falls on valid pixels inside the image. Odd sizes round up.

use rayon::prelude::*;

use crate::Grid;

/// Weights of the pixels 2p − 1 to 2p + 2, centred at 2p + 0.5.
const TAPS: [f32; 4] = [0.125, 0.375, 0.375, 0.125];
/// Share of the filter's weight that must fall on valid pixels.
const VALID_WEIGHT: f32 = 0.5;

/// Grid and its reductions, finest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Pyramid {
    levels: Vec<Grid<f32>>,
}

impl Pyramid {
    /// Reduces the grid until there are `levels` levels, or until the shorter side of the next
    /// level would fall below `min_side` pixels. Level 0 always exists.
    pub fn new(level0: Grid<f32>, levels: usize, min_side: usize) -> Self {
        let mut all = vec![level0];
        while all.len() < levels {
            let last = &all[all.len() - 1];
            if last.width().min(last.height()).div_ceil(2) < min_side.max(1) {
                break;
            }
            let next = reduce(last);
            all.push(next);
        }
        Self { levels: all }
    }

    /// Returns all levels, finest first.
    pub fn levels(&self) -> &[Grid<f32>] {
        &self.levels
    }

    /// Returns the levels, finest first, and drops the pyramid.
    pub fn into_levels(self) -> Vec<Grid<f32>> {
        self.levels
    }

    /// Returns a level by number; 0 is the finest.
    pub fn level(&self, level: usize) -> Option<&Grid<f32>> {
        self.levels.get(level)
    }
}

/// Converts a position (column or row) in a level to level 0.
pub fn level0_from_level(position: f64, level: u32) -> f64 {
    (position + 0.5) * scale(level) - 0.5
}

/// Converts a position (column or row) in level 0 to a level.
///
/// ```
/// assert_eq!(raster::level_from_level0(0.5, 1), 0.0);
/// assert_eq!(raster::level0_from_level(0.0, 1), 0.5);
/// ```
pub fn level_from_level0(position: f64, level: u32) -> f64 {
    (position + 0.5) / scale(level) - 0.5
}

fn scale(level: u32) -> f64 {
    f64::from(level).exp2()
}

/// Reduces a grid by two. NaN is no-data. The result is the same for any number of threads.
pub fn reduce(grid: &Grid<f32>) -> Grid<f32> {
    let (width, height) = (grid.width().div_ceil(2), grid.height().div_ceil(2));
    let mut sums = Grid::filled(width, grid.height(), [0.0_f32; 2]);
    let mut reduced = Grid::filled(width, height, f32::NAN);
    if width == 0 {
        return reduced;
    }
    sums.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| reduce_along(grid.row(row), out));
    reduced.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| reduce_across(&sums, row, out));
    reduced
}

/// Computes the weighted sum and the weight of the valid pixels along one row.
fn reduce_along(pixels: &[f32], out: &mut [[f32; 2]]) {
    let term = |value: f32, tap: f32| if value.is_finite() { [tap * value, tap] } else { [0.0; 2] };
    let n = pixels.len();
    for (p, sum) in out.iter_mut().enumerate() {
        let first = 2 * p;
        if first >= 1 && first + 3 <= n {
            let window = &pixels[first - 1..first + 3];
            *sum = add(
                add(term(window[0], TAPS[0]), term(window[1], TAPS[1])),
                add(term(window[2], TAPS[2]), term(window[3], TAPS[3])),
            );
        } else {
            let at = |k: usize| (first + k).checked_sub(1).and_then(|i| pixels.get(i)).copied().unwrap_or(f32::NAN);
            *sum =
                add(add(term(at(0), TAPS[0]), term(at(1), TAPS[1])), add(term(at(2), TAPS[2]), term(at(3), TAPS[3])));
        }
    }
}

/// Computes the values of one reduced row from the sums along the four rows under it.
fn reduce_across(sums: &Grid<[f32; 2]>, row: usize, out: &mut [f32]) {
    let nothing = vec![[0.0_f32; 2]; if row == 0 || 2 * row + 2 >= sums.height() { out.len() } else { 0 }];
    let at = |k: usize| match (2 * row + k).checked_sub(1) {
        Some(r) if r < sums.height() => sums.row(r),
        _ => nothing.as_slice(),
    };
    let rows = [at(0), at(1), at(2), at(3)];
    for (p, value) in out.iter_mut().enumerate() {
        let scaled = |k: usize| [TAPS[k] * rows[k][p][0], TAPS[k] * rows[k][p][1]];
        let [sum, weight] = add(add(scaled(0), scaled(1)), add(scaled(2), scaled(3)));
        *value = if weight >= VALID_WEIGHT { sum / weight } else { f32::NAN };
    }
}

fn add(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn field(width: usize, height: usize, f: impl Fn(f64, f64) -> f64) -> Grid<f32> {
        let data = (0..width * height).map(|i| f((i % width) as f64, (i / width) as f64) as f32).collect();
        Grid::from_vec(width, height, data).unwrap()
    }

    #[test]
    fn a_plane_keeps_its_place_on_every_level() {
        let plane = |x: f64, y: f64| 100.0 + 0.5 * x - 0.25 * y;
        let pyramid = Pyramid::new(field(96, 80, plane), 4, 4);
        assert_eq!(pyramid.levels().len(), 4);
        for (l, level) in pyramid.levels().iter().enumerate() {
            for row in 2..level.height() - 2 {
                for column in 2..level.width() - 2 {
                    let at = |p: usize| level0_from_level(p as f64, l as u32);
                    let expected = plane(at(column), at(row)) as f32;
                    assert!((level[(column, row)] - expected).abs() < 1e-3, "level {l} {column} {row}");
                }
            }
        }
    }

    #[test]
    fn the_finest_pattern_does_not_alias() {
        let checker = reduce(&field(64, 64, |x, y| if (x + y) % 2.0 == 0.0 { 1.0 } else { -1.0 }));
        let stripes = reduce(&field(64, 64, |x, _| if x % 2.0 == 0.0 { 1.0 } else { -1.0 }));
        for level in [&checker, &stripes] {
            for row in 1..31 {
                assert!(level.row(row)[1..31].iter().all(|v| v.abs() < 1e-6));
            }
        }
    }

    #[test]
    fn no_data_is_left_out_and_half_a_footprint_is_enough() {
        let mut grid = Grid::filled(16, 16, 5.0_f32);
        for row in 0..16 {
            for column in 8..16 {
                grid[(column, row)] = f32::NAN;
            }
        }
        let reduced = reduce(&grid);
        assert!(reduced.data().iter().all(|v| v.is_nan() || (v - 5.0).abs() < 1e-6));
        assert!(!reduced[(3, 4)].is_nan() && reduced[(4, 4)].is_nan());
        grid[(3, 3)] = f32::NAN;
        assert_eq!(reduce(&grid)[(1, 1)], 5.0);
    }

    #[test]
    fn sizes_round_up_and_small_grids_stop() {
        let reduced = reduce(&Grid::filled(7, 5, 1.0));
        assert_eq!((reduced.width(), reduced.height()), (4, 3));
        assert_eq!(Pyramid::new(Grid::filled(7, 5, 1.0), 9, 3).levels().len(), 2);
        assert_eq!(reduce(&Grid::filled(0, 0, 1.0)).data().len(), 0);
        assert_eq!(reduce(&Grid::filled(1, 1, 1.0)).width(), 1);
    }

    proptest! {
        #[test]
        fn positions_go_there_and_back(p in -10.0..1e5f64, level in 0..8u32) {
            prop_assert!((level_from_level0(level0_from_level(p, level), level) - p).abs() < 1e-9);
        }

        #[test]
        fn values_stay_within_those_below(values in prop::collection::vec(-100.0..100.0f32, 63)) {
            let grid = Grid::from_vec(9, 7, values.clone()).unwrap();
            let (lo, hi) = values.iter().fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
            let ok = reduce(&grid).data().iter().all(|v| v.is_nan() || (*v >= lo - 1e-3 && *v <= hi + 1e-3));
            prop_assert!(ok);
        }
    }
}
