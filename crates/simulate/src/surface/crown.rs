//! The opaque crown of a tree: half an ellipsoid on an upright cylinder that reaches the ground.
//!
//! A crown is a convex solid and a height function at once, so that no ray sees anything under it.
//! A ray meets the cylinder and the ellipsoid at roots of quadratic equations.

use nalgebra::Vector3;

use crate::SceneRay;

/// A crown. Lengths are metres, heights are above the ellipsoid of the Earth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crown {
    /// Position of the stem, scene frame.
    pub(crate) centre_m: [f64; 2],
    /// Radius of the cylinder and of the ellipsoid.
    pub(crate) radius_m: f64,
    /// Height at which the cylinder ends and the ellipsoid begins.
    pub(crate) shoulder_m: f64,
    /// Height of the dome above that level.
    pub(crate) dome_m: f64,
}

impl Crown {
    pub(crate) fn top_m(&self) -> f64 {
        self.shoulder_m + self.dome_m
    }

    /// Returns the height of the dome over a point, `None` beside it.
    pub(crate) fn height(&self, x: f64, y: f64) -> Option<f64> {
        let (dx, dy) = ((x - self.centre_m[0]) / self.radius_m, (y - self.centre_m[1]) / self.radius_m);
        let inside = 1.0 - dx * dx - dy * dy;
        (inside >= 0.0).then(|| self.shoulder_m + self.dome_m * inside.sqrt())
    }

    /// Returns where a ray from outside enters, as the first parameter in (0, `t_max`), and the
    /// outward unit normal there.
    pub(crate) fn enter(&self, ray: &SceneRay, t_max: f64) -> Option<(f64, Vector3<f64>)> {
        let (r, h) = (self.radius_m, self.dome_m);
        // Coordinates are scaled so that the cylinder and the ellipsoid have radius 1.
        let o = Vector3::new(
            (ray.origin.x - self.centre_m[0]) / r,
            (ray.origin.y - self.centre_m[1]) / r,
            (ray.origin.z - self.shoulder_m) / h,
        );
        let d = Vector3::new(ray.direction.x / r, ray.direction.y / r, ray.direction.z / h);
        let (round, across) = (d.xy().norm_squared(), o.xy().dot(&d.xy()));
        let beside = o.xy().norm_squared() - 1.0;
        let at_side = if beside > 0.0 { first_root(round, across, beside)? } else { 0.0 };
        let at_side_z = o.z + d.z * at_side;
        if beside > 0.0 && at_side_z <= 0.0 {
            let p = o + d * at_side;
            return (at_side > 0.0 && at_side < t_max).then(|| (at_side, Vector3::new(p.x, p.y, 0.0).normalize()));
        }
        let t = first_root(d.norm_squared(), o.dot(&d), o.norm_squared() - 1.0)?;
        let p = o + d * t;
        (t > 0.0 && t < t_max && p.z >= 0.0).then(|| (t, Vector3::new(p.x / r, p.y / r, p.z / h).normalize()))
    }
}

/// Returns the smaller root of a t² + 2 b t + c.
fn first_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let discriminant = b * b - a * c;
    (discriminant >= 0.0 && a > 0.0).then(|| (-b - discriminant.sqrt()) / a)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{MARCH_STEP, is_below, march};

    proptest! {
        #[test]
        fn a_ray_enters_where_the_height_function_is(
            x in -9.0..9.0f64, y in -9.0..9.0f64, dx in -1.2..1.2f64, dy in -1.2..1.2f64,
        ) {
            let crown = Crown { centre_m: [1.0, -0.5], radius_m: 3.0, shoulder_m: 4.0, dome_m: 5.0 };
            let ray = SceneRay { origin: Vector3::new(x, y, 12.0), direction: Vector3::new(dx, dy, -1.0) };
            let inside = |t: f64| is_below(ray.at(t), |x, y| crown.height(x, y));
            match (crown.enter(&ray, 12.0), march(inside, 12.0)) {
                (Some((t, normal)), Some(m)) => {
                    prop_assert!((t - m).abs() <= MARCH_STEP + 1e-9, "entered at {t}, marched to {m}");
                    prop_assert!(normal.dot(&ray.direction) <= 0.0);
                }
                (Some((t, _)), None) => prop_assert!(!inside(t + MARCH_STEP)),
                (None, m) => prop_assert!(m.is_none(), "missed what a march meets at {m:?}"),
            }
        }
    }
}
