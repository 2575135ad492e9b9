//! The bare ground: a sum of value noises, smooth and with a bounded slope.
//!
//! Scene frame: x east, y north (grid metres from the scene's centre), z metres above the ellipsoid.

use nalgebra::Vector3;

use crate::Ray;
use crate::noise::{slope_bound, value_and_slope, value_noise};
use crate::random::derived;

/// (lattice cell, amplitude) of each octave, metres: hills, banks, bumps.
const OCTAVES: [(f64, f64); 3] = [(150.0, 6.5), (52.0, 1.6), (19.0, 0.25)];
/// A ray has met the ground when it is this close to it, metres.
const TOLERANCE_M: f64 = 1e-4;
/// Steps of a ray before it is given up; a steep one needs about five.
const MAX_STEPS: u32 = 400;

/// Ground whose height is known everywhere.
#[derive(Debug, Clone)]
pub struct Terrain {
    mean_height_m: f64,
    seed: u64,
}

impl Terrain {
    /// The ground of a seed, around a mean ellipsoidal height.
    pub(crate) fn new(seed: u64, mean_height_m: f64) -> Self {
        Self { mean_height_m, seed: derived(seed, 1) }
    }

    /// Height above the ellipsoid, metres.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let octave = |((cell, amplitude), k): (&(f64, f64), u64)| amplitude * value_noise(self.seed ^ k, *cell, x, y);
        self.mean_height_m + OCTAVES.iter().zip(0u64..).map(octave).sum::<f64>()
    }

    /// The lowest and the highest value that [`Self::height`] can take.
    pub fn height_range_m(&self) -> (f64, f64) {
        let amplitude: f64 = OCTAVES.iter().map(|(_, a)| a).sum();
        (self.mean_height_m - amplitude, self.mean_height_m + amplitude)
    }

    /// The steepest slope that the ground can have, metres per metre.
    pub fn slope_bound() -> f64 {
        OCTAVES.iter().map(|(cell, amplitude)| amplitude * slope_bound(*cell)).sum()
    }

    /// Upward unit normal.
    pub(crate) fn normal(&self, x: f64, y: f64) -> Vector3<f64> {
        let mut normal = Vector3::z();
        for ((cell, amplitude), k) in OCTAVES.iter().zip(0u64..) {
            let (_, [by_x, by_y]) = value_and_slope(self.seed ^ k, *cell, x, y);
            normal.x -= amplitude * by_x;
            normal.y -= amplitude * by_y;
        }
        normal.normalize()
    }

    /// The parameter at which a descending ray meets the ground. `None` for a ray that starts below the ground or does not
    /// come down to it before `t_max`.
    ///
    /// A ray that is steeper than the ground can be crosses it once, and stepping by the height above the ground over the
    /// ray's own descent converges to the crossing. A flatter one steps by what the slope bound keeps above the ground, so
    /// that the first crossing is the one found.
    pub(crate) fn intersect(&self, ray: &Ray, t_max: f64) -> Option<f64> {
        let descent = -ray.direction.z;
        let rise = Self::slope_bound() * ray.direction.x.hypot(ray.direction.y);
        let closing = if rise < descent { descent } else { descent + rise };
        let start = ray.origin.z - self.height(ray.origin.x, ray.origin.y);
        if start < 0.0 || closing <= 0.0 {
            return None;
        }
        let mut t = start / closing;
        for _ in 0..MAX_STEPS {
            let p = ray.at(t);
            let above = p.z - self.height(p.x, p.y);
            if above.abs() < TOLERANCE_M {
                return (t <= t_max).then_some(t);
            }
            t += above / closing;
            if rise >= descent && t > t_max {
                return None;
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_the_ground_where_a_fine_march_does() {
        let terrain = Terrain::new(5, 100.0);
        for k in 0..50 {
            let start = Vector3::new(f64::from(k) * 7.3 - 180.0, f64::from(k) * -3.1, 130.0);
            // Every other ray is flatter than the slope bound.
            let reach = if k % 2 == 0 { 0.5 } else { 4.0 };
            let ray = Ray { origin: start, direction: Vector3::new(0.8 * reach, -0.6 * reach, -1.0) };
            let found = terrain.intersect(&ray, 100.0).expect("the ray descends 100 m");
            let step = 1e-3;
            let marched = (0..100_000)
                .map(|i| f64::from(i) * step)
                .find(|t| {
                    let p = ray.at(*t);
                    p.z < terrain.height(p.x, p.y)
                })
                .expect("the march ends below the ground");
            assert!((found - marched).abs() < 2.0 * step, "found {found}, marched {marched}");
        }
    }

    #[test]
    fn heights_stay_in_the_stated_range() {
        let terrain = Terrain::new(9, 50.0);
        let (low, high) = terrain.height_range_m();
        for k in 0..2000 {
            let z = terrain.height(f64::from(k) * 1.7, f64::from(k) * 0.9);
            assert!((low..=high).contains(&z));
        }
    }
}
