//! A building block: an upright prism over a rectangle, under a flat, gabled or hipped roof.
//!
//! The block is a convex solid. A ray meets it where the slabs of its planes overlap (Cyrus and
//! Beck 1978), without marching. It extends downwards without end, hidden by the ground. Stepped
//! buildings are several blocks.

use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use crate::SceneRay;

/// The roof of a block. Heights are metres above the ellipsoid.
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
    /// Four equal slopes. The ridge is as long as length minus width of the block.
    Hipped {
        /// Height of the lower edges.
        eaves_m: f64,
        /// Height of the ridge.
        ridge_m: f64,
    },
}

/// An upright prism over a rectangle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BuildingBlock {
    /// Centre of the rectangle, scene frame, metres.
    pub centre_m: [f64; 2],
    /// Half the length along the long axis and half the width across it, metres.
    pub half_size_m: [f64; 2],
    /// Direction of the long axis, degrees counter-clockwise from east.
    pub direction_deg: f64,
    /// Height of the base, metres above the ellipsoid: the lowest ground around the block, or the
    /// roof below it.
    pub base_m: f64,
    /// Form and heights of the roof.
    pub roof: Roof,
}

/// The side of a block that a ray met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Face {
    /// A wall across the long axis, at its end (true) or its start.
    End(bool),
    /// A wall along the long axis, on its left (true) or its right.
    Side(bool),
    /// A roof plane that falls along (true) or across the axis.
    Roof(bool),
}

/// A block with its planes, ready for ray casting.
#[derive(Debug, Clone)]
pub(crate) struct Prism {
    pub(crate) block: BuildingBlock,
    along: Vector2<f64>,
    planes: [Plane; 8],
    count: usize,
}

/// A half-space `normal · (x − centre) ≤ offset`. The centre has height 0.
#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: Vector3<f64>,
    offset: f64,
    face: Face,
}

impl BuildingBlock {
    /// Returns the highest point of the roof, metres above the ellipsoid.
    pub fn top_m(&self) -> f64 {
        match self.roof {
            Roof::Flat { height_m } => height_m,
            Roof::Gabled { ridge_m, .. } | Roof::Hipped { ridge_m, .. } => ridge_m,
        }
    }

    /// Returns the height of the eaves along the long sides, metres above the ellipsoid.
    pub fn eaves_m(&self) -> f64 {
        match self.roof {
            Roof::Flat { height_m } => height_m,
            Roof::Gabled { eaves_m, .. } | Roof::Hipped { eaves_m, .. } => eaves_m,
        }
    }

    /// Returns the scene position of a point given along and across the long axis from the centre.
    pub fn position(&self, u: f64, v: f64) -> [f64; 2] {
        let (sin, cos) = self.direction_deg.to_radians().sin_cos();
        [self.centre_m[0] + cos * u - sin * v, self.centre_m[1] + sin * u + cos * v]
    }

    /// Returns the corners of the rectangle, counter-clockwise seen from above.
    pub fn corners(&self) -> [[f64; 2]; 4] {
        let [u, v] = self.half_size_m;
        [self.position(-u, -v), self.position(u, -v), self.position(u, v), self.position(-u, v)]
    }

    /// Returns the slope of the roof, metres per metre.
    fn fall(&self) -> f64 {
        (self.top_m() - self.eaves_m()) / self.half_size_m[1]
    }
}

impl Prism {
    pub(crate) fn new(block: BuildingBlock) -> Self {
        let (sin, cos) = block.direction_deg.to_radians().sin_cos();
        let (u, v) = (Vector3::new(cos, sin, 0.0), Vector3::new(-sin, cos, 0.0));
        let [half_u, half_v] = block.half_size_m;
        let eaves = block.eaves_m();
        let wall = |normal, offset, face| Plane { normal, offset, face };
        let slope = |outward: Vector3<f64>, half: f64, along: bool| {
            let normal = (outward * block.fall() + Vector3::z()).normalize();
            Plane { normal, offset: normal.dot(&(outward * half + Vector3::z() * eaves)), face: Face::Roof(along) }
        };
        let mut planes = vec![
            wall(u, half_u, Face::End(true)),
            wall(-u, half_u, Face::End(false)),
            wall(v, half_v, Face::Side(true)),
            wall(-v, half_v, Face::Side(false)),
        ];
        match block.roof {
            Roof::Flat { .. } => planes.push(slope(v, half_v, false)),
            Roof::Gabled { .. } => planes.extend([slope(v, half_v, false), slope(-v, half_v, false)]),
            Roof::Hipped { .. } => planes.extend([
                slope(v, half_v, false),
                slope(-v, half_v, false),
                slope(u, half_u, true),
                slope(-u, half_u, true),
            ]),
        }
        let count = planes.len();
        let filler = planes[0];
        planes.resize(8, filler);
        let planes = std::array::from_fn(|k| planes[k]);
        Self { block, along: Vector2::new(cos, sin), planes, count }
    }

    /// Returns coordinates along and across the long axis, from the centre.
    pub(crate) fn local(&self, x: f64, y: f64) -> [f64; 2] {
        let (dx, dy) = (x - self.block.centre_m[0], y - self.block.centre_m[1]);
        [self.along.x * dx + self.along.y * dy, self.along.x * dy - self.along.y * dx]
    }

    /// Returns the height of the roof over a point, `None` outside the rectangle.
    pub(crate) fn roof_height(&self, x: f64, y: f64) -> Option<f64> {
        let [u, v] = self.local(x, y);
        let [to_end, to_side] = [self.block.half_size_m[0] - u.abs(), self.block.half_size_m[1] - v.abs()];
        let rise = match self.block.roof {
            Roof::Flat { .. } => 0.0,
            Roof::Gabled { .. } => to_side,
            Roof::Hipped { .. } => to_side.min(to_end),
        };
        (to_end >= 0.0 && to_side >= 0.0).then(|| self.block.eaves_m() + self.block.fall() * rise)
    }

    /// Returns half the sides of the axis-aligned bounding box.
    pub(crate) fn half_extent(&self) -> [f64; 2] {
        let [half_u, half_v] = self.block.half_size_m;
        let (c, s) = (self.along.x.abs(), self.along.y.abs());
        [c * half_u + s * half_v, s * half_u + c * half_v]
    }

    /// Returns where a ray enters the solid, the outward unit normal there, and the face.
    ///
    /// The place is the first parameter in (0, `t_max`). A ray that starts inside does not enter.
    pub(crate) fn enter(&self, ray: &SceneRay, t_max: f64) -> Option<(f64, Vector3<f64>, Face)> {
        let [x, y] = self.block.centre_m;
        let start = Vector3::new(ray.origin.x - x, ray.origin.y - y, ray.origin.z);
        let (mut enter, mut leave, mut through) = (0.0, t_max, None);
        for plane in &self.planes[..self.count] {
            let approach = plane.normal.dot(&ray.direction);
            let distance = plane.offset - plane.normal.dot(&start);
            let t = distance / approach;
            if approach < 0.0 && t > enter {
                (enter, through) = (t, Some(plane));
            } else if approach > 0.0 {
                leave = t.min(leave);
            } else if approach == 0.0 && distance < 0.0 {
                return None;
            }
            if enter >= leave {
                return None;
            }
        }
        through.map(|plane| (enter, plane.normal, plane.face))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{MARCH_STEP, is_below, march};

    fn house(direction_deg: f64, roof: Roof) -> Prism {
        Prism::new(BuildingBlock { centre_m: [3.0, -2.0], half_size_m: [9.0, 5.0], direction_deg, base_m: 0.0, roof })
    }

    const GABLED: Roof = Roof::Gabled { eaves_m: 6.0, ridge_m: 9.0 };
    const HIPPED: Roof = Roof::Hipped { eaves_m: 6.0, ridge_m: 9.0 };
    const FLAT: Roof = Roof::Flat { height_m: 8.0 };

    #[test]
    fn roofs_fall_from_ridge_to_eaves() {
        let gabled = house(0.0, GABLED);
        assert_eq!(gabled.roof_height(3.0, -2.0), Some(9.0));
        assert_eq!(gabled.roof_height(3.0, 3.0), Some(6.0));
        assert_eq!(gabled.roof_height(12.0, -2.0), Some(9.0));
        assert_eq!(gabled.roof_height(3.0, 3.1), None);
        let hipped = house(0.0, HIPPED);
        assert_eq!(hipped.roof_height(3.0, -2.0), Some(9.0));
        assert_eq!(hipped.roof_height(7.0, -2.0), Some(9.0));
        assert_eq!(hipped.roof_height(12.0, -2.0), Some(6.0));
    }

    proptest! {
        #[test]
        fn a_ray_enters_where_the_roof_or_a_wall_is(
            direction in 0.0..180.0f64, x in -15.0..20.0f64, y in -15.0..15.0f64, dx in -0.6..0.6f64, dy in -0.6..0.6f64,
            roof in 0usize..3,
        ) {
            let prism = house(direction, [FLAT, GABLED, HIPPED][roof]);
            let ray = SceneRay { origin: Vector3::new(x, y, 30.0), direction: Vector3::new(dx, dy, -1.0) };
            let inside = |t: f64| is_below(ray.at(t), |x, y| prism.roof_height(x, y));
            match (prism.enter(&ray, 30.0), march(inside, 30.0)) {
                (Some((t, normal, _)), Some(m)) => {
                    prop_assert!((t - m).abs() <= MARCH_STEP + 1e-9, "entered at {t}, marched to {m}");
                    prop_assert!(normal.dot(&ray.direction) < 0.0);
                }
                // A march misses corners that are cut within one step.
                (Some((t, _, _)), None) => prop_assert!(!inside(t + MARCH_STEP)),
                (None, m) => prop_assert!(m.is_none()),
            }
        }
    }
}
