//! Rough crowns of single trees: broad ellipsoids and cones that begin above the ground.
//!
//! A crown is the solid `|(x, y) − stem| < R(w) · radius · (1 − ROUGH + ROUGH · bumps)`, where w is
//! the height between the foot of the crown (0) and its top (1). R is the profile of the crown:
//! `√(1 − (2w − 1)²)` for a broad one, a cone with a rounded foot for a conical one. Bumps of
//! foliage are noise in [−1, 1] of the position. Noise also lowers the top. Views see the ground
//! under the overhang of a crown.
//!
//! A ray is marched through the cylinder around the crown in steps of [`STEP_M`], and the crossing
//! is bisected. The height over a point is where a vertical ray enters, so that both agree.

use nalgebra::Vector3;

use crate::SceneRay;
use crate::surface::noise::value_noise;

/// Depth of the bumps as a share of the radius, on either side of their mean.
const ROUGH: f64 = 0.16;
/// Largest share of the crown's height by which bumps lower its top.
const TOP_ROUGH: f64 = 0.12;
/// Step of the march along a ray, metres.
const STEP_M: f64 = 0.2;
/// Halvings of a step: the crossing is known to a tenth of a millimetre.
const HALVINGS: usize = 11;
/// Distance of the positions between which the normal is taken, metres.
const NORMAL_M: f64 = 0.06;
/// Height of the widest part of a conical crown, as a share of the crown's height.
const CONE_FOOT: f64 = 0.12;

/// The outline of a crown, seen from the side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CrownProfile {
    Broad,
    Conical,
}

/// A rough crown. Lengths are metres, heights are above the ellipsoid of the Earth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NaturalCrown {
    /// Position of the stem, scene frame.
    pub(crate) centre_m: [f64; 2],
    /// Largest radius that the bumps reach.
    pub(crate) radius_m: f64,
    /// Height of the foot of the crown.
    pub(crate) foot_m: f64,
    /// Highest possible height of the top.
    pub(crate) top_m: f64,
    pub(crate) profile: CrownProfile,
    /// Seed of the bumps.
    pub(crate) seed: u64,
}

impl NaturalCrown {
    /// Returns the height of the upper side over a point, `None` beside the crown.
    pub(crate) fn height(&self, x: f64, y: f64) -> Option<f64> {
        let down = SceneRay { origin: Vector3::new(x, y, self.top_m + STEP_M), direction: -Vector3::z() };
        self.first(&down, self.top_m - self.foot_m + 2.0 * STEP_M).map(|t| down.at(t).z)
    }

    /// Returns where a ray from outside enters, as the first parameter in (0, `t_max`), and the
    /// outward unit normal there.
    pub(crate) fn enter(&self, ray: &SceneRay, t_max: f64) -> Option<(f64, Vector3<f64>)> {
        let t = self.first(ray, t_max)?;
        let p = ray.at(t);
        let along = |step: Vector3<f64>| self.outside_m(&(p + step)) - self.outside_m(&(p - step));
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| along(axis * NORMAL_M));
        let gradient = Vector3::new(x, y, z);
        let against = -ray.direction.normalize();
        // At a crease the difference may point away from the viewer, who sees another side of it.
        let normal = gradient.try_normalize(1e-12).filter(|normal| normal.dot(&against) > 0.0);
        Some((t, normal.unwrap_or(against)))
    }

    fn first(&self, ray: &SceneRay, t_max: f64) -> Option<f64> {
        let (from, to) = self.clipped(ray, t_max)?;
        let length = (to - from) * ray.direction.norm();
        let count = (length / STEP_M).ceil().max(1.0) as usize;
        let step = (to - from) / count as f64;
        let mut was_outside = self.outside_m(&ray.at(from)) > 0.0;
        for k in 1..=count {
            let t = from + k as f64 * step;
            let is_outside = self.outside_m(&ray.at(t)) > 0.0;
            if was_outside && !is_outside {
                return Some(self.crossing(ray, t - step, t));
            }
            was_outside = is_outside;
        }
        None
    }

    fn crossing(&self, ray: &SceneRay, mut outside: f64, mut inside: f64) -> f64 {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (outside + inside);
            if self.outside_m(&ray.at(middle)) > 0.0 { outside = middle } else { inside = middle }
        }
        inside
    }

    /// Returns the part of (0, `t_max`) in which a ray is inside the cylinder around the crown.
    fn clipped(&self, ray: &SceneRay, t_max: f64) -> Option<(f64, f64)> {
        let (mut enter, mut leave) = (0.0_f64, t_max);
        let (z, dz) = (ray.origin.z, ray.direction.z);
        if dz != 0.0 {
            let (a, b) = ((self.foot_m - z) / dz, (self.top_m - z) / dz);
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        } else if !(self.foot_m..=self.top_m).contains(&z) {
            return None;
        }
        let (ox, oy) = (ray.origin.x - self.centre_m[0], ray.origin.y - self.centre_m[1]);
        let (dx, dy) = (ray.direction.x, ray.direction.y);
        let (a, b, c) = (dx * dx + dy * dy, ox * dx + oy * dy, ox * ox + oy * oy - self.radius_m * self.radius_m);
        if a > 0.0 {
            let discriminant = b * b - a * c;
            if discriminant <= 0.0 {
                return None;
            }
            let root = discriminant.sqrt();
            (enter, leave) = (enter.max((-b - root) / a), leave.min((root - b) / a));
        } else if c >= 0.0 {
            return None;
        }
        (enter < leave).then_some((enter, leave))
    }

    /// Returns the horizontal distance of a point from the surface, metres, positive outside.
    fn outside_m(&self, p: &Vector3<f64>) -> f64 {
        let (dx, dy) = (p.x - self.centre_m[0], p.y - self.centre_m[1]);
        let lowered = 0.5 * TOP_ROUGH * (1.0 + value_noise(self.seed ^ 2, 1.5, p.x, p.y));
        let w = (1.0 + lowered) * (p.z - self.foot_m) / (self.top_m - self.foot_m);
        if !(0.0..=1.0).contains(&w) {
            return self.radius_m;
        }
        let profile = match self.profile {
            CrownProfile::Broad => (1.0 - (2.0 * w - 1.0).powi(2)).max(0.0).sqrt(),
            CrownProfile::Conical => ((1.0 - w) / (1.0 - CONE_FOOT)).min((w / CONE_FOOT).sqrt()),
        };
        // Two skew planes of noise, so that the bumps differ in all three directions.
        let bumps = 0.6 * value_noise(self.seed, 1.7, p.x + 0.5 * p.z, p.y - 0.6 * p.z)
            + 0.4 * value_noise(self.seed ^ 1, 0.8, p.x - 0.7 * p.z, p.y + 0.4 * p.z);
        dx.hypot(dy) - self.radius_m * profile * (1.0 - ROUGH + ROUGH * bumps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crown(profile: CrownProfile) -> NaturalCrown {
        NaturalCrown { centre_m: [1.0, -0.5], radius_m: 3.0, foot_m: 102.0, top_m: 110.0, profile, seed: 9 }
    }

    fn profile_of(crown: &NaturalCrown) -> Vec<Option<f64>> {
        (0..=30).map(|k| crown.height(1.0 + 0.1 * f64::from(k), -0.5)).collect()
    }

    #[test]
    fn crowns_fall_from_their_top_and_are_rough() {
        for (profile, falls_m) in [(CrownProfile::Broad, 0.5), (CrownProfile::Conical, 2.5)] {
            let crown = crown(profile);
            let heights = profile_of(&crown);
            let top = heights[0].unwrap();
            assert!((108.0..=110.0).contains(&top), "{profile:?}: {top}");
            // Half-way to the rim the crown is already lower: there are no upright sides.
            let half = heights[14].unwrap();
            assert!(top - half > falls_m, "{profile:?}: {top} to {half}");
            assert_eq!(*heights.last().unwrap(), None);
            // Neighbouring heights do not lie on a smooth profile.
            let bends = heights.windows(3).filter_map(|w| Some((w[0]? - 2.0 * w[1]? + w[2]?).abs()));
            assert!(bends.fold(0.0, f64::max) > 0.03, "{profile:?}");
        }
    }

    #[test]
    fn a_flat_ray_passes_under_the_crown_and_meets_its_side() {
        let crown = crown(CrownProfile::Broad);
        let at = |z: f64| SceneRay { origin: Vector3::new(-9.0, -0.5, z), direction: Vector3::x() };
        assert!(crown.enter(&at(101.5), 30.0).is_none() && crown.enter(&at(110.5), 30.0).is_none());
        let (t, normal) = crown.enter(&at(106.0), 30.0).unwrap();
        assert!((6.8..8.2).contains(&t) && normal.x < -0.3, "{t} {normal:?}");
        assert!(crown.enter(&at(106.0), 5.0).is_none());
    }

    #[test]
    fn slanted_rays_enter_where_a_fine_march_does() {
        for profile in [CrownProfile::Broad, CrownProfile::Conical] {
            let crown = crown(profile);
            let mut met = 0;
            for k in 0..400 {
                let (x, y) = (f64::from(k % 20) * 0.5 - 4.0, f64::from(k / 20) * 0.5 - 5.0);
                let ray = SceneRay { origin: Vector3::new(x, y, 112.0), direction: Vector3::new(0.4, -0.3, -1.0) };
                let fine = (0..12_000).map(|i| f64::from(i) * 1e-3).find(|t| crown.outside_m(&ray.at(*t)) <= 0.0);
                let Some((t, normal)) = crown.enter(&ray, 12.0) else {
                    // The march of the crown steps over thin bumps.
                    assert!(fine.is_none_or(|t| crown.outside_m(&ray.at(t + 0.25)) > 0.0));
                    continue;
                };
                met += 1;
                let fine = fine.unwrap();
                assert!(
                    t > fine - 2e-3 && (t - fine < 0.01 || crown.outside_m(&ray.at(fine + 0.2)) > 0.0),
                    "{t} {fine}"
                );
                assert!((normal.norm() - 1.0).abs() < 1e-9 && normal.dot(&ray.direction) < 0.0);
            }
            assert!(met > 60, "{profile:?}: {met}");
        }
    }
}
