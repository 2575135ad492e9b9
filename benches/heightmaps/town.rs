//! A surface by formula: gentle hills, and on a lattice of 40 m houses with gabled roofs, each
//! turned its own way.
//!
//! Metres east and north of the upper left corner; heights above the ellipsoid.

use numeric::random::{hash64, unit_interval};

/// Spacing of the houses, metres.
const BLOCK_M: f64 = 40.0;
/// Mean height of the hills, metres.
const GROUND_M: f64 = 200.0;

/// Returns the height at a place, metres.
pub(crate) fn height(x: f64, y: f64) -> f64 {
    ground(x, y) + house(x, y).unwrap_or(0.0)
}

/// Returns whether the surface jumps within a distance, that is, whether only some places are in a
/// house.
pub(crate) fn jumps(x: f64, y: f64, within_m: f64) -> bool {
    let inside = house(x, y).is_some();
    let around = (0..16).map(|k| std::f64::consts::TAU * f64::from(k) / 16.0);
    around
        .flat_map(|a| [(a, 0.5), (a, 1.0)])
        .any(|(a, share)| house(x + share * within_m * a.cos(), y + share * within_m * a.sin()).is_some() != inside)
}

fn ground(x: f64, y: f64) -> f64 {
    let wave = |length: f64, x: f64| (std::f64::consts::TAU * x / length).sin();
    GROUND_M + 6.0 * wave(410.0, x + 0.3 * y) + 4.0 * wave(290.0, y - 0.2 * x) + 0.3 * wave(23.0, x) * wave(19.0, y)
}

/// Returns the height of the roof above the ground, or `None` outside of houses.
fn house(x: f64, y: f64) -> Option<f64> {
    let (i, j) = ((x / BLOCK_M).floor(), (y / BLOCK_M).floor());
    let key = |k: u64| uniform([k, i as i64 as u64, j as i64 as u64]);
    let (dx, dy) = (x - (i + 0.5) * BLOCK_M, y - (j + 0.5) * BLOCK_M);
    let (sin, cos) = (std::f64::consts::PI * key(0)).sin_cos();
    let (along, across) = (cos * dx + sin * dy, cos * dy - sin * dx);
    let (length, width) = (6.0 + 8.0 * key(1), 4.0 + 4.0 * key(2));
    let is_inside = key(3) > 0.2 && along.abs() < length && across.abs() < width;
    is_inside.then(|| 4.0 + 6.0 * key(4) + 0.7 * (width - across.abs()))
}

/// Returns a number in [0, 1) that depends on the key alone.
pub(crate) fn uniform(key: [u64; 3]) -> f64 {
    unit_interval(key.into_iter().fold(0u64, |state, part| hash64(state.wrapping_add(part))))
}
