//! A building block: an upright prism over a rectangle, under a flat or a gabled roof.
//!
//! A convex solid, so that a ray meets it where the slabs of its planes overlap (Cyrus and Beck 1978): analytic, no marching.
//! It reaches down without end; the ground hides what is below. Buildings with steps are several blocks.

use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use crate::Ray;

/// The roof of a block; heights are metres above the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "form", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Roof {
    /// Horizontal.
    Flat {
        /// Height of the roof.
        height_m: f64,
    },
    /// Two slopes that meet in a ridge along the block's long axis.
    Gabled {
        /// Height of the lower edges.
        eaves_m: f64,
        /// Height of the ridge.
        ridge_m: f64,
    },
}

/// An upright prism over a rectangle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Block {
    /// Centre of the rectangle, scene frame, metres.
    pub centre_m: [f64; 2],
    /// Half the length along the long axis and half the width across it, metres.
    pub half_size_m: [f64; 2],
    /// Direction of the long axis, degrees counter-clockwise from east.
    pub direction_deg: f64,
    /// Height of the ground at the centre, metres above the ellipsoid.
    pub ground_m: f64,
    /// What covers it.
    pub roof: Roof,
}

/// Which side of a block a ray met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Face {
    /// The roof, on one side (−1 or 1 across) of the ridge; a flat one is met on side 1.
    Roof(i8),
    /// A wall whose outward normal is along (±1) the long axis.
    End(i8),
    /// A wall whose outward normal is across (±1) the long axis.
    Side(i8),
}

/// A block with its trigonometry done: the form that rays meet.
#[derive(Debug, Clone)]
pub(crate) struct Solid {
    pub(crate) block: Block,
    along: Vector2<f64>,
    /// Height of the roof over the axis and its fall per metre across.
    crest_m: f64,
    fall: f64,
}

impl Block {
    /// Highest point of the roof, metres above the ellipsoid.
    pub fn top_m(&self) -> f64 {
        match self.roof {
            Roof::Flat { height_m } => height_m,
            Roof::Gabled { ridge_m, .. } => ridge_m,
        }
    }
}

impl Solid {
    pub(crate) fn new(block: Block) -> Self {
        let (sin, cos) = block.direction_deg.to_radians().sin_cos();
        let fall = match block.roof {
            Roof::Flat { .. } => 0.0,
            Roof::Gabled { eaves_m, ridge_m } => (ridge_m - eaves_m) / block.half_size_m[1],
        };
        Self { block, along: Vector2::new(cos, sin), crest_m: block.top_m(), fall }
    }

    /// Coordinates along and across the long axis, from the centre.
    pub(crate) fn local(&self, x: f64, y: f64) -> [f64; 2] {
        let (dx, dy) = (x - self.block.centre_m[0], y - self.block.centre_m[1]);
        self.rotated(dx, dy)
    }

    fn rotated(&self, dx: f64, dy: f64) -> [f64; 2] {
        [self.along.x * dx + self.along.y * dy, self.along.x * dy - self.along.y * dx]
    }

    /// Height of the roof over a point; `None` outside the rectangle.
    pub(crate) fn roof_height(&self, x: f64, y: f64) -> Option<f64> {
        let [u, v] = self.local(x, y);
        let [half_u, half_v] = self.block.half_size_m;
        (u.abs() <= half_u && v.abs() <= half_v).then(|| self.crest_m - self.fall * v.abs())
    }

    /// Half the sides of the axis-parallel box around the rectangle.
    pub(crate) fn half_extent(&self) -> [f64; 2] {
        let [half_u, half_v] = self.block.half_size_m;
        let (c, s) = (self.along.x.abs(), self.along.y.abs());
        [c * half_u + s * half_v, s * half_u + c * half_v]
    }

    /// Outward unit normal of a face, scene frame.
    pub(crate) fn normal(&self, face: Face) -> Vector3<f64> {
        let (u, v, z) = match face {
            Face::Roof(side) => (0.0, self.fall * f64::from(side), 1.0),
            Face::End(side) => (f64::from(side), 0.0, 0.0),
            Face::Side(side) => (0.0, f64::from(side), 0.0),
        };
        let (c, s) = (self.along.x, self.along.y);
        Vector3::new(c * u - s * v, s * u + c * v, z).normalize()
    }

    /// Where a ray enters the solid, and through which face: the first parameter in (0, `t_max`).
    /// A ray that starts inside does not enter.
    pub(crate) fn enter(&self, ray: &Ray, t_max: f64) -> Option<(f64, Face)> {
        let [u, v] = self.local(ray.origin.x, ray.origin.y);
        let [du, dv] = self.rotated(ray.direction.x, ray.direction.y);
        let (z, dz) = (ray.origin.z, ray.direction.z);
        let [half_u, half_v] = self.block.half_size_m;
        // Each plane as (distance from the origin to it along its normal, approach per unit of t, face).
        let planes = [
            (half_u - u, du, Face::End(1)),
            (half_u + u, -du, Face::End(-1)),
            (half_v - v, dv, Face::Side(1)),
            (half_v + v, -dv, Face::Side(-1)),
            (self.crest_m - z - self.fall * v, dz + self.fall * dv, Face::Roof(1)),
            (self.crest_m - z + self.fall * v, dz - self.fall * dv, Face::Roof(-1)),
        ];
        let (mut enter, mut leave, mut through) = (0.0, t_max, None);
        for (distance, approach, face) in planes {
            let t = distance / approach;
            if approach < 0.0 && t > enter {
                (enter, through) = (t, Some(face));
            } else if approach > 0.0 {
                leave = t.min(leave);
            } else if approach == 0.0 && distance < 0.0 {
                return None;
            }
        }
        through.filter(|_| enter < leave).map(|face| (enter, face))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn house(direction_deg: f64) -> Solid {
        Solid::new(Block {
            centre_m: [3.0, -2.0],
            half_size_m: [9.0, 5.0],
            direction_deg,
            ground_m: 0.0,
            roof: Roof::Gabled { eaves_m: 6.0, ridge_m: 9.0 },
        })
    }

    #[test]
    fn the_roof_falls_from_ridge_to_eaves() {
        let solid = house(0.0);
        assert_eq!(solid.roof_height(3.0, -2.0), Some(9.0));
        assert_eq!(solid.roof_height(3.0, 3.0), Some(6.0));
        assert_eq!(solid.roof_height(3.0, 3.1), None);
    }

    proptest! {
        #[test]
        fn a_ray_enters_where_the_roof_or_a_wall_is(
            direction in 0.0..180.0f64, x in -15.0..20.0f64, y in -15.0..15.0f64, dx in -0.6..0.6f64, dy in -0.6..0.6f64,
        ) {
            let solid = house(direction);
            let ray = Ray { origin: Vector3::new(x, y, 30.0), direction: Vector3::new(dx, dy, -1.0) };
            let inside = |t: f64| {
                let p = ray.at(t);
                solid.roof_height(p.x, p.y).is_some_and(|z| p.z < z)
            };
            let step = 1e-3;
            let marched = (0..30_000).map(|i| f64::from(i) * step).find(|t| inside(*t));
            match (solid.enter(&ray, 30.0), marched) {
                (Some((t, face)), Some(m)) => {
                    prop_assert!((t - m).abs() <= step + 1e-9, "entered at {t}, marched to {m}");
                    prop_assert!(solid.normal(face).dot(&ray.direction) < 0.0);
                }
                // A march misses corners that are cut within one step.
                (Some((t, _)), None) => prop_assert!(!inside(t + step)),
                (None, m) => prop_assert!(m.is_none()),
            }
        }
    }
}
