//! Value noise: smooth functions of the plane with a known bound on their slope.
//!
//! Values of a random lattice, interpolated with the quintic `6t⁵ − 15t⁴ + 10t³` (Perlin 2002), so that the function is
//! twice continuously differentiable: terrain has no creases for a matcher to lock on.

use crate::random::lattice;

/// Value noise in [−1, 1] with lattice cells of `cell_m` metres.
pub(crate) fn value_noise(seed: u64, cell_m: f64, x: f64, y: f64) -> f64 {
    let (u, v) = (x / cell_m, y / cell_m);
    let (i, j) = (u.floor(), v.floor());
    let (s, t) = (quintic(u - i), quintic(v - j));
    let (i, j) = (i as i64, j as i64);
    let row = |j: i64| {
        let (a, b) = (lattice(seed, i, j), lattice(seed, i + 1, j));
        a + s * (b - a)
    };
    let (low, high) = (row(j), row(j + 1));
    2.0 * (low + t * (high - low)) - 1.0
}

/// The largest slope that [`value_noise`] of this cell can have, per unit of amplitude.
pub(crate) fn slope_bound(cell_m: f64) -> f64 {
    // Each partial derivative is at most 2 (the range) times 15/8 (the quintic's steepest slope) over the cell.
    std::f64::consts::SQRT_2 * 2.0 * 1.875 / cell_m
}

/// Detail at every scale from half a metre to half a block, in about [−1, 1].
pub(crate) fn detail(seed: u64, x: f64, y: f64) -> f64 {
    const OCTAVES: [(f64, f64); 6] = [(0.6, 0.24), (1.4, 0.22), (3.2, 0.18), (7.7, 0.14), (19.0, 0.12), (47.0, 0.10)];
    OCTAVES.iter().zip(0u64..).map(|((cell, share), k)| share * value_noise(seed.wrapping_add(k), *cell, x, y)).sum()
}

fn quintic(t: f64) -> f64 {
    t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn noise_keeps_its_range_and_its_slope(seed in 0u64..1000, x in -500.0..500.0f64, y in -500.0..500.0f64) {
            let value = value_noise(seed, 20.0, x, y);
            prop_assert!((-1.0..=1.0).contains(&value));
            let step = 1e-3;
            let beside = value_noise(seed, 20.0, x + step, y + step);
            prop_assert!((beside - value).abs() <= slope_bound(20.0) * step * std::f64::consts::SQRT_2 + 1e-12);
        }
    }
}
