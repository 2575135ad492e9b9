//! Value noise: smooth functions of the plane with a known bound on their slope.
//!
//! Values of a random lattice, interpolated with the quintic `6t⁵ − 15t⁴ + 10t³` (Perlin 2002), so
//! that the function is twice continuously differentiable: terrain has no creases for a matcher to
//! lock on.

use crate::random::lattice;

/// Returns value noise in [−1, 1] with lattice cells of `cell_m` metres.
pub(crate) fn value_noise(seed: u64, cell_m: f64, x: f64, y: f64) -> f64 {
    value_and_slope(seed, cell_m, x, y).0
}

/// Returns [`value_noise`] and its derivatives with respect to x and y.
#[inline]
pub(crate) fn value_and_slope(seed: u64, cell_m: f64, x: f64, y: f64) -> (f64, [f64; 2]) {
    let (u, v) = (x / cell_m, y / cell_m);
    let (i, j) = (floor(u), floor(v));
    let (fraction_u, fraction_v) = (u - i as f64, v - j as f64);
    let (s, t) = (quintic(fraction_u), quintic(fraction_v));
    let corner = |di, dj| 2.0 * lattice(seed, i + di, j + dj) - 1.0;
    let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1));
    let (low, high) = (a + s * (b - a), c + s * (d - c));
    let by_u = quintic_slope(fraction_u) * (b - a + t * (a - b - c + d));
    let by_v = quintic_slope(fraction_v) * (high - low);
    (low + t * (high - low), [by_u / cell_m, by_v / cell_m])
}

/// Returns noise with detail at every scale from half a metre to half a block, in about [−1, 1].
pub(crate) fn detail(seed: u64, x: f64, y: f64) -> f64 {
    const OCTAVES: [(f64, f64); 6] = [(0.6, 0.24), (1.4, 0.22), (3.2, 0.18), (7.7, 0.14), (19.0, 0.12), (47.0, 0.10)];
    OCTAVES.iter().zip(0u64..).map(|((cell, share), k)| share * value_noise(seed.wrapping_add(k), *cell, x, y)).sum()
}

/// Returns the largest integer not above a value. `f64::floor` is a library call on baseline x86-64
/// and was the bottleneck.
fn floor(x: f64) -> i64 {
    let towards_zero = x as i64;
    towards_zero - i64::from(x < towards_zero as f64)
}

fn quintic(t: f64) -> f64 {
    t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

fn quintic_slope(t: f64) -> f64 {
    30.0 * t * t * (t * (t - 2.0) + 1.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn noise_keeps_its_range_and_its_slope(seed in 0u64..1000, x in -500.0..500.0f64, y in -500.0..500.0f64) {
            let (value, [by_x, by_y]) = value_and_slope(seed, 20.0, x, y);
            prop_assert!((-1.0..=1.0).contains(&value));
            // Each partial derivative is at most 2 (the range) times 15/8 (the quintic's steepest
            // slope) over the cell.
            prop_assert!(by_x.hypot(by_y) <= std::f64::consts::SQRT_2 * 2.0 * 1.875 / 20.0);
            let step = 1e-5;
            let difference = |dx: f64, dy: f64| {
                (value_noise(seed, 20.0, x + dx, y + dy) - value_noise(seed, 20.0, x - dx, y - dy)) / (2.0 * step)
            };
            prop_assert!((difference(step, 0.0) - by_x).abs() < 1e-7 && (difference(0.0, step) - by_y).abs() < 1e-7);
        }
    }
}
