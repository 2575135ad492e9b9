//! Search for nearest points and triangles, by R-trees (`rstar`).

use rstar::primitives::GeomWithData;
use rstar::{AABB, PointDistance, RTree, RTreeObject};

use super::model::LocalSurface;
use numeric::vector::{cross, dot, norm, sub, unit};

/// Point with its index.
pub(super) type Indexed = GeomWithData<[f64; 3], u32>;

/// Spatial index of points.
pub(super) struct PointIndex(RTree<Indexed>);

/// Spatial index of a surface.
pub(super) enum SurfaceIndex {
    Points(PointIndex),
    Triangles(RTree<Triangle>),
}

/// Triangle with an area.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triangle {
    corners: [[f64; 3]; 3],
    pub(super) normal: [f64; 3],
}

/// Nearest place of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    pub(super) distance_m: f64,
    /// Index of the point, for clouds.
    pub(super) point: Option<u32>,
    /// Normal of the triangle, for meshes.
    pub(super) normal: Option<[f64; 3]>,
}

impl PointIndex {
    pub(super) fn new(points: &[[f64; 3]]) -> Self {
        let indexed = points.iter().zip(0u32..).map(|(&point, index)| Indexed::new(point, index));
        Self(RTree::bulk_load(indexed.collect()))
    }

    /// Returns the points within a distance, in an unspecified order.
    pub(super) fn within(&self, centre: [f64; 3], radius_m: f64) -> impl Iterator<Item = ([f64; 3], u32)> {
        self.0.locate_within_distance(centre, radius_m * radius_m).map(|found| (*found.geom(), found.data))
    }

    /// Returns the points in a box, in an unspecified order.
    pub(super) fn in_box(&self, low: [f64; 3], high: [f64; 3]) -> impl Iterator<Item = ([f64; 3], u32)> {
        let envelope = AABB::from_corners(low, high);
        self.0.locate_in_envelope(&envelope).map(|found| (*found.geom(), found.data))
    }
}

impl SurfaceIndex {
    pub(super) fn new(surface: &LocalSurface) -> Self {
        match surface {
            LocalSurface::Points(points) => Self::Points(PointIndex::new(points)),
            LocalSurface::Mesh { .. } => Self::Triangles(RTree::bulk_load(triangles(surface))),
        }
    }

    /// Returns the nearest place of the surface, or `None` if the surface is empty.
    pub(super) fn nearest(&self, from: [f64; 3]) -> Option<Nearest> {
        match self {
            Self::Points(PointIndex(tree)) => tree.nearest_neighbor(&from).map(|found| {
                let distance_m = norm(sub(*found.geom(), from));
                Nearest { distance_m, point: Some(found.data), normal: None }
            }),
            Self::Triangles(tree) => tree.nearest_neighbor(&from).map(|found| Nearest {
                distance_m: found.distance_2(&from).sqrt(),
                point: None,
                normal: Some(found.normal),
            }),
        }
    }
}

/// Returns the triangles of a mesh that have an area.
pub(super) fn triangles(surface: &LocalSurface) -> Vec<Triangle> {
    let LocalSurface::Mesh { positions, triangles } = surface else { return Vec::new() };
    triangles.iter().filter_map(|corners| Triangle::new(corners.map(|corner| positions[corner as usize]))).collect()
}

impl Triangle {
    fn new(corners: [[f64; 3]; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        Some(Self { corners, normal: unit(cross(sub(b, a), sub(c, a)))? })
    }

    pub(super) fn area_m2(&self) -> f64 {
        let [a, b, c] = self.corners;
        0.5 * norm(cross(sub(b, a), sub(c, a)))
    }

    /// Returns the point with these weights of the second and third corner.
    pub(super) fn point(&self, u: f64, v: f64) -> [f64; 3] {
        let [a, b, c] = self.corners;
        [0, 1, 2].map(|i| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]))
    }

    /// Returns the nearest point of the triangle, by the regions of its corners, edges and inside
    /// (Ericson 2005, 5.1.5).
    fn closest(&self, p: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = self.corners;
        let (ab, ac) = (sub(b, a), sub(c, a));
        let along = |q: [f64; 3]| (dot(ab, sub(p, q)), dot(ac, sub(p, q)));
        let (d1, d2) = along(a);
        if d1 <= 0.0 && d2 <= 0.0 {
            return a;
        }
        let (d3, d4) = along(b);
        if d3 >= 0.0 && d4 <= d3 {
            return b;
        }
        let (d5, d6) = along(c);
        if d6 >= 0.0 && d5 <= d6 {
            return c;
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return self.point(d1 / (d1 - d3), 0.0);
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return self.point(0.0, d2 / (d2 - d6));
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 >= d3 && d5 >= d6 {
            let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
            return self.point(1.0 - w, w);
        }
        let sum = va + vb + vc;
        self.point(vb / sum, vc / sum)
    }
}

impl RTreeObject for Triangle {
    type Envelope = AABB<[f64; 3]>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_points(&self.corners)
    }
}

impl PointDistance for Triangle {
    fn distance_2(&self, point: &[f64; 3]) -> f64 {
        let to = sub(self.closest(*point), *point);
        dot(to, to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn corner() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3(-5.0..5.0f64)
    }

    proptest! {
        #[test]
        fn no_point_of_the_triangle_is_nearer(corners in prop::array::uniform3(corner()), p in corner()) {
            let Some(triangle) = Triangle::new(corners) else { return Ok(()) };
            let found = triangle.distance_2(&p).sqrt();
            let mut least = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    least = least.min(norm(sub(triangle.point(f64::from(i) / 60.0, f64::from(j) / 60.0), p)));
                }
            }
            // The grid's points are on the triangle, at most a fraction of an edge apart.
            prop_assert!(found <= least + 1e-9 && least - found < 0.3, "{found} {least}");
        }

        #[test]
        fn the_nearest_triangle_is_that_of_a_search_through_all(
            soup in prop::collection::vec(prop::array::uniform3(corner()), 1..40), p in corner(),
        ) {
            let positions: Vec<[f64; 3]> = soup.iter().flatten().copied().collect();
            let triangles = (0..soup.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            let surface = LocalSurface::Mesh { positions, triangles };
            let least = super::triangles(&surface).iter().map(|t| t.distance_2(&p)).fold(f64::INFINITY, f64::min);
            let found = SurfaceIndex::new(&surface).nearest(p).unwrap();
            prop_assert!((found.distance_m - least.sqrt()).abs() < 1e-12);
        }
    }
}
