//! Smooth noise for the surfaces of synthetic scenes.

/// Returns a smooth function of a position: `value` at the points of the unit lattice, and between
/// them the eight nearest values weighted by smoothsteps along the axes.
///
/// ```
/// let parity = |at: [i64; 3]| at.iter().sum::<i64>().rem_euclid(2) as f64;
/// assert_eq!(testing::lattice_noise([1.0, 2.0, 4.0], parity), 1.0);
/// assert_eq!(testing::lattice_noise([0.5, 0.0, 0.0], parity), 0.5);
/// ```
pub fn lattice_noise(p: [f64; 3], value: impl Fn([i64; 3]) -> f64) -> f64 {
    let floor = p.map(f64::floor);
    let t: [f64; 3] = std::array::from_fn(|i| {
        let f = p[i] - floor[i];
        f * f * (3.0 - 2.0 * f)
    });
    let corner = |k: usize| {
        let weight: f64 = (0..3).map(|i| if k >> i & 1 == 1 { t[i] } else { 1.0 - t[i] }).product();
        weight * value(std::array::from_fn(|i| floor[i] as i64 + (k >> i & 1) as i64))
    };
    (0..8).map(corner).sum()
}
