//! Interpolation between pixel centres: bilinear and bicubic.
//!
//! Bicubic is Keys' convolution with a = −1/2 (IEEE Trans. ASSP 29, 1981; Catmull–Rom), which is
//! exact for quadratics. No-data (NaN) never spreads: a bilinear value exists if every pixel with a
//! non-zero weight has a value, and is NaN otherwise. Bicubic falls back to bilinear where its 4 ×
//! 4 neighbourhood is not complete. Positions outside [0, width − 1] × [0, height − 1] have no
//! value: nothing is extrapolated.

use multiversion::multiversion;
use rayon::prelude::*;

use crate::Grid;

/// Interpolation between pixel centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Bilinear, from four pixels.
    Bilinear,
    /// Bicubic, from sixteen pixels. Bilinear if one of them is missing.
    #[default]
    Bicubic,
}

/// Returns the value at a position, or NaN if there is none.
pub fn sample(grid: &Grid<f32>, column: f64, row: f64, interpolation: Interpolation) -> f32 {
    match interpolation {
        Interpolation::Bilinear => bilinear(grid, column, row),
        Interpolation::Bicubic => bicubic(grid, column, row),
    }
}

/// Returns the bilinear value at a position, or NaN if there is none.
pub fn bilinear(grid: &Grid<f32>, column: f64, row: f64) -> f32 {
    let (Some((c, u)), Some((r, v))) = (split(column, grid.width()), split(row, grid.height())) else {
        return f32::NAN;
    };
    let top = along(grid.row(r), c, u);
    if v == 0.0 { top } else { mix(top, along(grid.row(r + 1), c, u), v) }
}

/// Returns the bicubic value at a position, the bilinear one if a pixel of the 4 × 4 around it is
/// missing, or NaN if there is neither.
pub fn bicubic(grid: &Grid<f32>, column: f64, row: f64) -> f32 {
    let (Some((c, u)), Some((r, v))) = (split(column, grid.width()), split(row, grid.height())) else {
        return f32::NAN;
    };
    if c < 1 || r < 1 || c + 2 >= grid.width() || r + 2 >= grid.height() {
        return bilinear(grid, column, row);
    }
    let (wu, wv) = (cubic_weights(u), cubic_weights(v));
    let mut value = 0.0;
    for (j, weight) in wv.iter().enumerate() {
        let pixels = &grid.row(r - 1 + j)[c - 1..c + 3];
        value += weight * (wu[0] * pixels[0] + wu[1] * pixels[1] + wu[2] * pixels[2] + wu[3] * pixels[3]);
    }
    if value.is_finite() { value } else { bilinear(grid, column, row) }
}

/// Number of positions that are processed together.
const LANES: usize = 8;

/// Computes [`bicubic`] at `from`, `from + step`, … (column, row), with another order of the sums.
#[multiversion(targets("x86_64+avx512vl", "x86_64+avx2"))]
pub fn bicubic_along(grid: &Grid<f32>, from: [f64; 2], step: [f64; 2], out: &mut [f32]) {
    for (k, values) in out.chunks_mut(LANES).enumerate() {
        let first = (k * LANES) as f64;
        let at = |axis: usize| std::array::from_fn(|i| from[axis] + step[axis] * (first + i as f64));
        let (columns, rows): ([f64; LANES], [f64; LANES]) = (at(0), at(1));
        // If the first and the last position have all their pixels, so have those between them. If
        // both lie beyond the same side, none of the positions has a value.
        if [0, LANES - 1].into_iter().all(|i| has_all_pixels(grid, [columns[i], rows[i]])) {
            let inside = bicubic_inside(grid, columns, rows);
            match <&mut [f32; LANES]>::try_from(&mut *values) {
                Ok(values) => *values = inside,
                Err(_) => values.iter_mut().zip(inside).for_each(|(value, inside)| *value = inside),
            }
            if inside.iter().fold(true, |all, v| all & v.is_finite()) {
                continue;
            }
        } else {
            values.fill(f32::NAN);
            if are_beyond(&columns, grid.width()) || are_beyond(&rows, grid.height()) {
                continue;
            }
        }
        for (i, value) in values.iter_mut().enumerate().filter(|(_, value)| !value.is_finite()) {
            *value = bicubic(grid, columns[i], rows[i]);
        }
    }
}

/// Returns whether positions along a line all lie before the first pixel, or all behind the last
/// one.
#[inline(always)]
fn are_beyond(positions: &[f64; LANES], length: usize) -> bool {
    let [first, .., last] = positions;
    (*first < 0.0 && *last < 0.0) || (*first > length as f64 - 1.0 && *last > length as f64 - 1.0)
}

#[inline(always)]
fn has_all_pixels(grid: &Grid<f32>, [column, row]: [f64; 2]) -> bool {
    column >= 1.0 && row >= 1.0 && column < grid.width() as f64 - 3.0 && row < grid.height() as f64 - 3.0
}

/// Returns the sum of four values with the weights of position `i`.
#[inline(always)]
fn weigh(weights: &[[f32; LANES]; 4], i: usize, [p, q, r, s]: [f32; 4]) -> f32 {
    weights[0][i] * p + weights[1][i] * q + weights[2][i] * r + weights[3][i] * s
}

/// Returns bicubic values at positions whose sixteen pixels all exist. The values are unspecified
/// where pixels are not finite.
#[inline(always)]
fn bicubic_inside(grid: &Grid<f32>, columns: [f64; LANES], rows: [f64; LANES]) -> [f32; LANES] {
    /// Added to a whole number, it leaves that number in the lowest bits of the sum. This
    /// vectorises; a cast does not.
    const TWO_52: f64 = 4_503_599_627_370_496.0;
    // With a width of 32 bits the compiler sees that three rows do not overflow, so one check of
    // bounds per pixel is enough.
    let Ok(width) = u32::try_from(grid.width()) else { return [f32::NAN; LANES] };
    let (c, r) = (columns.map(f64::floor), rows.map(f64::floor));
    let first: [u64; LANES] =
        std::array::from_fn(|i| ((r[i] - 1.0) * f64::from(width) + (c[i] - 1.0) + TWO_52).to_bits());
    let (mut wu, mut wv) = ([[0.0f32; LANES]; 4], [[0.0f32; LANES]; 4]);
    for i in 0..LANES {
        let (a, b) = (cubic_weights((columns[i] - c[i]) as f32), cubic_weights((rows[i] - r[i]) as f32));
        for k in 0..4 {
            (wu[k][i], wv[k][i]) = (a[k], b[k]);
        }
    }
    let width = width as usize;
    // Rows first. Neighbouring positions mostly lie between neighbouring pixels. Then eight pixels
    // are one vector; otherwise four are.
    if (1..LANES).fold(true, |all, i| all & (r[i] == r[0]) & (c[i] == c[0] + i as f64)) {
        let pixels = &grid.data()[(first[0] - TWO_52.to_bits()) as usize..][..3 * width + LANES + 3];
        let mut sums = [[0.0f32; LANES]; 4];
        for (k, sums) in sums.iter_mut().enumerate() {
            let row = |j: usize| &pixels[j * width + k..j * width + k + LANES];
            let (p, q, r, s) = (row(0), row(1), row(2), row(3));
            for i in 0..LANES {
                sums[i] = weigh(&wv, i, [p[i], q[i], r[i], s[i]]);
            }
        }
        let mut out = [0.0; LANES];
        for (i, out) in out.iter_mut().enumerate() {
            *out = weigh(&wu, i, [sums[0][i], sums[1][i], sums[2][i], sums[3][i]]);
        }
        return out;
    }
    let mut sums = [[0.0f32; 4]; LANES];
    for (i, sums) in sums.iter_mut().enumerate() {
        let pixels = &grid.data()[(first[i] - TWO_52.to_bits()) as usize..][..3 * width + 4];
        let row = |j: usize| &pixels[j * width..j * width + 4];
        let (p, q, r, s) = (row(0), row(1), row(2), row(3));
        for k in 0..4 {
            sums[k] = weigh(&wv, i, [p[k], q[k], r[k], s[k]]);
        }
    }
    std::array::from_fn(|i| weigh(&wu, i, sums[i]))
}

/// Fills a grid from another through a map of positions, rows in parallel.
///
/// `source_from_target` returns the (column, row) in `source` of a target cell. Cells without a
/// value become NaN.
pub fn resample(
    source: &Grid<f32>,
    width: usize,
    height: usize,
    interpolation: Interpolation,
    source_from_target: impl Fn(f64, f64) -> (f64, f64) + Sync,
) -> Grid<f32> {
    let mut target = Grid::filled(width, height, f32::NAN);
    if width > 0 {
        target.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, cells)| {
            for (column, cell) in cells.iter_mut().enumerate() {
                let (x, y) = source_from_target(column as f64, row as f64);
                *cell = sample(source, x, y, interpolation);
            }
        });
    }
    target
}

/// Splits a position in `[0, length − 1]` into its whole and fractional parts. Returns `None`
/// outside.
fn split(position: f64, length: usize) -> Option<(usize, f32)> {
    if length == 0 || !(position >= 0.0 && position <= (length - 1) as f64) {
        return None;
    }
    let whole = position as usize;
    let fraction = (position - whole as f64) as f32;
    // A fraction that rounds to 1 belongs to the next pixel.
    Some(if fraction == 1.0 { (whole + 1, 0.0) } else { (whole, fraction) })
}

fn along(row: &[f32], column: usize, fraction: f32) -> f32 {
    if fraction == 0.0 { row[column] } else { mix(row[column], row[column + 1], fraction) }
}

fn mix(a: f32, b: f32, fraction: f32) -> f32 {
    a + (b - a) * fraction
}

/// Returns the weights of the pixels at −1, 0, 1 and 2 for a fraction in [0, 1).
pub fn cubic_weights(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (-t3 + 2.0 * t2 - t), 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0), 0.5 * (-3.0 * t3 + 4.0 * t2 + t), 0.5 * (t3 - t2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn field(f: impl Fn(f64, f64) -> f64) -> Grid<f32> {
        let data = (0..12 * 9).map(|i| f((i % 12) as f64, (i / 12) as f64) as f32).collect();
        Grid::from_vec(12, 9, data).unwrap()
    }

    proptest! {
        #[test]
        fn planes_are_exact_for_bilinear_and_quadratics_for_bicubic(x in 0.0..=11.0f64, y in 0.0..=8.0f64) {
            let plane = |x: f64, y: f64| 3.0 - 0.5 * x + 0.25 * y;
            prop_assert!((f64::from(bilinear(&field(plane), x, y)) - plane(x, y)).abs() < 1e-5);
            let bowl = |x: f64, y: f64| 0.1 * x * x - 0.2 * x * y + 0.05 * y * y;
            if (1.0..10.0).contains(&x) && (1.0..7.0).contains(&y) {
                prop_assert!((f64::from(bicubic(&field(bowl), x, y)) - bowl(x, y)).abs() < 1e-4);
            }
        }

        #[test]
        fn a_hole_never_bleeds(x in -1.0..12.0f64, y in -1.0..9.0f64) {
            let mut grid = field(|_, _| 7.0);
            grid[(5, 4)] = f32::NAN;
            for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
                let value = sample(&grid, x, y, interpolation);
                let inside = (0.0..=11.0).contains(&x) && (0.0..=8.0).contains(&y);
                let near = (x - 5.0).abs() < 1.0 && (y - 4.0).abs() < 1.0;
                if inside && !near {
                    prop_assert!((value - 7.0).abs() < 1e-5);
                } else {
                    prop_assert!(value.is_nan());
                }
            }
        }
    }

    proptest! {
        #[test]
        fn values_follow_a_gain_and_an_offset(
            x in 0.0..=11.0f64, y in 0.0..=8.0f64, gain in -8.0..8.0f32, offset in -500.0..500.0f32,
        ) {
            let grid = field(|x, y| 40.0 * (1.3 * x).sin() + 25.0 * (0.7 * x - 1.9 * y).cos());
            let changed = grid.map(|v| gain * v + offset);
            for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
                let expected = gain * sample(&grid, x, y, interpolation) + offset;
                prop_assert!((sample(&changed, x, y, interpolation) - expected).abs() < 2e-3);
            }
        }

        /// Positions are sixteenths of a pixel, which a shift by whole pixels leaves exact.
        #[test]
        fn a_shift_by_whole_pixels_moves_the_values_and_nothing_else(
            x in 16..80u32, y in 16..64u32, dx in 0..5usize, dy in 0..4usize,
        ) {
            let f = |x: f64, y: f64| 40.0 * (1.3 * x).sin() + 25.0 * (0.7 * x - 1.9 * y).cos();
            let (grid, moved) = (field(f), field(|x, y| f(x + dx as f64, y + dy as f64)));
            let at = (f64::from(x) / 16.0, f64::from(y) / 16.0);
            let (there, inside) = ((at.0 + dx as f64, at.1 + dy as f64), |(x, y): (f64, f64)| x < 9.0 && y < 6.0);
            if inside(at) && inside(there) {
                for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
                    let a = sample(&moved, at.0, at.1, interpolation);
                    let b = sample(&grid, there.0, there.1, interpolation);
                    prop_assert_eq!(a.to_bits(), b.to_bits());
                }
            }
        }

        #[test]
        fn a_value_lies_within_its_neighbours_or_overshoots_by_an_eighth(
            values in prop::collection::vec(0.0..1.0f32, 108), x in 0.0..=11.0f64, y in 0.0..=8.0f64,
        ) {
            let grid = Grid::from_vec(12, 9, values).unwrap();
            prop_assert!((0.0..=1.0).contains(&bilinear(&grid, x, y)));
            // The negative weights of the Catmull–Rom cubic sum to at most an eighth along each
            // axis.
            prop_assert!((-0.3..=1.3).contains(&bicubic(&grid, x, y)));
        }
    }

    proptest! {
        /// The lines run into the grid and out of it, past a hole, with and without a remainder
        /// that fills no register.
        #[test]
        fn values_along_a_line_are_those_of_its_positions(
            from in (-3.0..9.0f64, -3.0..9.0f64), step in (-0.9..0.9f64, -0.9..0.9f64), count in 0..30usize,
        ) {
            let mut grid = field(|x, y| 40.0 * (1.3 * x).sin() + 25.0 * (0.7 * x - 1.9 * y).cos());
            grid[(6, 5)] = f32::NAN;
            let mut values = vec![0.0; count];
            bicubic_along(&grid, [from.0, from.1], [step.0, step.1], &mut values);
            for (i, value) in values.iter().enumerate() {
                let expected = bicubic(&grid, from.0 + step.0 * i as f64, from.1 + step.1 * i as f64);
                prop_assert!(value.is_nan() == expected.is_nan() && (value - expected).abs().max(0.0) < 1e-4);
            }
        }
    }

    /// As when an image is resampled to another of the same scale: eight pixels side by side, or
    /// with one left out or taken twice.
    #[test]
    fn values_along_a_row_are_those_of_its_positions() {
        let f = |i: usize| (40.0 * (1.3 * (i % 60) as f64).sin() + 25.0 * (0.9 * i as f64).cos()) as f32;
        let grid = Grid::from_vec(60, 9, (0..60 * 9).map(f).collect()).unwrap();
        for step in [[1.0, 0.0], [1.003, 0.0], [0.98, -0.004], [0.5, 0.01], [-1.0, 0.0]] {
            for from in [[2.25, 3.5], [5.95, 4.001], [58.0, 2.75]] {
                let mut values = [0.0; 43];
                bicubic_along(&grid, from, step, &mut values);
                for (i, value) in values.iter().enumerate() {
                    let expected = bicubic(&grid, from[0] + step[0] * i as f64, from[1] + step[1] * i as f64);
                    let is_near = value.is_nan() == expected.is_nan() && (value - expected).abs().max(0.0) < 1e-4;
                    assert!(is_near, "{value} for {expected}, the {i}th from {from:?} by {step:?}");
                }
            }
        }
    }

    #[test]
    fn pixels_and_edges_are_kept() {
        let grid = field(|x, y| x * 10.0 + y);
        for (c, r) in [(0, 0), (11, 0), (0, 8), (11, 8), (10, 7), (5, 4)] {
            assert_eq!(bicubic(&grid, c as f64, r as f64), grid[(c, r)]);
            assert_eq!(bilinear(&grid, c as f64, r as f64), grid[(c, r)]);
        }
        for (x, y) in [(-1e-9, 0.0), (11.0 + 1e-9, 0.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert!(bilinear(&grid, x, y).is_nan() && bicubic(&grid, x, y).is_nan());
        }
        assert!(bilinear(&Grid::filled(0, 0, 1.0), 0.0, 0.0).is_nan());
        let lone = Grid::filled(1, 1, 4.0);
        assert_eq!(bicubic(&lone, 0.0, 0.0), 4.0);
    }

    #[test]
    fn resampling_by_the_identity_copies() {
        let grid = field(|x, y| (x * 1.7 + y).sin());
        assert_eq!(resample(&grid, 12, 9, Interpolation::Bicubic, |x, y| (x, y)), grid);
        let shifted = resample(&grid, 12, 9, Interpolation::Bilinear, |x, y| (x + 1.0, y));
        assert_eq!(shifted[(3, 3)], grid[(4, 3)]);
        assert!(shifted[(11, 3)].is_nan());
        assert_eq!(resample(&grid, 0, 4, Interpolation::Bilinear, |x, y| (x, y)).data().len(), 0);
    }
}
