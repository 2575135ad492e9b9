//! An index of solids by square buckets of the plane, which a ray visits in order (Amanatides and
//! Woo 1987).
//!
//! Each bucket stores its highest point, so that a ray skips most of them.

use crate::SceneRay;

/// Side of a bucket, metres. It holds a few trees or a part of a house.
pub(crate) const BUCKET_M: f64 = 8.0;

/// The bounding rectangle of an object and its highest point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    pub(crate) low: [f64; 2],
    pub(crate) high: [f64; 2],
    pub(crate) top_m: f64,
}

/// The part of a ray over one bucket.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stretch {
    pub(crate) bucket: usize,
    pub(crate) t_in: f64,
    pub(crate) t_out: f64,
}

/// The buckets of a square around the origin.
#[derive(Debug, Clone)]
pub(crate) struct Buckets {
    corner_m: f64,
    side: usize,
    tops: Vec<f64>,
    ground_tops: Vec<f64>,
    members: Vec<Vec<u32>>,
}

impl Buckets {
    /// Makes buckets out to `reach_m` along both axes. `ground_top` gives the highest ground of a
    /// rectangle.
    pub(crate) fn new(reach_m: f64, ground_top: impl Fn([f64; 2], [f64; 2]) -> f64, extents: &[Extent]) -> Self {
        let half = (reach_m / BUCKET_M).ceil();
        let (side, corner_m) = (2 * half as usize, -half * BUCKET_M);
        let low = |k: usize| [k % side, k / side].map(|c| corner_m + c as f64 * BUCKET_M);
        let ground_tops: Vec<f64> =
            (0..side * side).map(|k| ground_top(low(k), low(k).map(|c| c + BUCKET_M))).collect();
        let (tops, members) = (ground_tops.clone(), vec![Vec::new(); side * side]);
        let mut buckets = Self { corner_m, side, tops, ground_tops, members };
        for (object, extent) in (0u32..).zip(extents) {
            buckets.insert(object, extent);
        }
        buckets
    }

    pub(crate) fn insert(&mut self, object: u32, extent: &Extent) {
        let [columns, rows] = [0, 1].map(|axis| self.along(extent.low[axis])..=self.along(extent.high[axis]));
        for row in rows {
            for column in columns.clone() {
                let bucket = row * self.side + column;
                self.members[bucket].push(object);
                self.tops[bucket] = self.tops[bucket].max(extent.top_m);
            }
        }
    }

    /// Returns the objects whose rectangle touches a bucket.
    pub(crate) fn members(&self, bucket: usize) -> &[u32] {
        &self.members[bucket]
    }

    /// Returns the part of a stretch in which the ray is not above all ground of the bucket.
    pub(crate) fn near_ground(&self, ray: &SceneRay, stretch: Stretch) -> Option<(f64, f64)> {
        let (z, dz) = (ray.origin.z, ray.direction.z);
        let crossing = (self.ground_tops[stretch.bucket] - z) / dz;
        let (t_in, t_out) = match dz {
            dz if dz < 0.0 => (stretch.t_in.max(crossing), stretch.t_out),
            dz if dz > 0.0 => (stretch.t_in, stretch.t_out.min(crossing)),
            _ => (stretch.t_in, stretch.t_out),
        };
        (t_in <= t_out).then_some((t_in, t_out))
    }

    /// Returns the bucket of a position, or the nearest one for a position outside.
    pub(crate) fn at(&self, x: f64, y: f64) -> usize {
        self.along(y) * self.side + self.along(x)
    }

    /// Visits the buckets in which a ray is low enough to meet something, until `visit` returns a
    /// value.
    pub(crate) fn walk<T>(&self, ray: &SceneRay, t_max: f64, mut visit: impl FnMut(Stretch) -> Option<T>) -> Option<T> {
        let (mut t, end) = self.clipped(ray, t_max)?;
        let start = ray.at(t);
        let mut at = [self.along(start.x), self.along(start.y)];
        let origin = [ray.origin.x, ray.origin.y];
        let direction = [ray.direction.x, ray.direction.y];
        let mut next: [f64; 2] = std::array::from_fn(|axis| {
            let edge = self.corner_m + (at[axis] + usize::from(direction[axis] > 0.0)) as f64 * BUCKET_M;
            if direction[axis] == 0.0 { f64::INFINITY } else { (edge - origin[axis]) / direction[axis] }
        });
        let stride = direction.map(|d| BUCKET_M / d.abs());
        loop {
            let axis = usize::from(next[1] < next[0]);
            let t_out = next[axis].min(end);
            let bucket = at[1] * self.side + at[0];
            let lowest = (ray.origin.z + ray.direction.z * t).min(ray.origin.z + ray.direction.z * t_out);
            if lowest <= self.tops[bucket] {
                let found = visit(Stretch { bucket, t_in: t, t_out });
                if found.is_some() {
                    return found;
                }
            }
            if next[axis] >= end {
                return None;
            }
            t = t_out.max(t);
            next[axis] += stride[axis];
            at[axis] = match direction[axis] > 0.0 {
                true if at[axis] + 1 < self.side => at[axis] + 1,
                false if at[axis] > 0 => at[axis] - 1,
                _ => return None,
            };
        }
    }

    /// Returns the part of [0, `t_max`] in which a ray is over the buckets.
    fn clipped(&self, ray: &SceneRay, t_max: f64) -> Option<(f64, f64)> {
        let (low, high) = (self.corner_m, -self.corner_m);
        let (mut enter, mut leave) = (0.0_f64, t_max);
        for (origin, direction) in [(ray.origin.x, ray.direction.x), (ray.origin.y, ray.direction.y)] {
            if direction == 0.0 {
                if !(low..=high).contains(&origin) {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - origin) / direction, (high - origin) / direction);
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        }
        (enter < leave).then_some((enter, leave))
    }

    fn along(&self, coordinate: f64) -> usize {
        // The cast saturates, so positions before the first bucket fall into it.
        (((coordinate - self.corner_m) / BUCKET_M) as usize).min(self.side - 1)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    fn posts() -> (Vec<Extent>, Buckets) {
        let post = |k: i32| {
            let (x, y) = (f64::from(k % 9) * 11.0 - 44.0, f64::from(k / 9) * 11.0 - 44.0);
            Extent { low: [x - 2.0, y - 1.0], high: [x + 2.0, y + 1.0], top_m: 5.0 + f64::from(k % 7) }
        };
        let extents: Vec<Extent> = (0..81).map(post).collect();
        let buckets = Buckets::new(60.0, |_, _| 0.0, &extents);
        (extents, buckets)
    }

    proptest! {
        #[test]
        fn a_walk_visits_every_box_that_the_ray_goes_through(
            x in -70.0..70.0f64, y in -70.0..70.0f64, dx in -3.0..3.0f64, dy in -3.0..3.0f64,
        ) {
            let (extents, buckets) = posts();
            let ray = SceneRay { origin: Vector3::new(x, y, 20.0), direction: Vector3::new(dx, dy, -1.0) };
            let mut visited = std::collections::BTreeSet::new();
            let mut last = 0.0;
            buckets.walk(&ray, 20.0, |stretch| {
                visited.extend(buckets.members(stretch.bucket).iter().copied());
                assert!(stretch.t_in >= last && stretch.t_out >= stretch.t_in);
                last = stretch.t_out;
                None::<()>
            });
            for (k, extent) in extents.iter().enumerate() {
                let through = (0..4000).map(|i| ray.at(f64::from(i) * 0.005)).any(|p| {
                    p.z < extent.top_m && p.x > extent.low[0] && p.x < extent.high[0] && p.y > extent.low[1] && p.y < extent.high[1]
                });
                prop_assert!(!through || visited.contains(&(k as u32)), "box {k} is missed");
            }
        }
    }
}
