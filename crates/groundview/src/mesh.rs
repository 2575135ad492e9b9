//! Triangles as the surface of ground views: rays go through the tree of the crate `bvh`.

use bvh::{Bvh, BvhError, Ray};

use super::{Ground, Met};
use numeric::vector::{cross, normalized};

/// Triangles, metres from the local origin.
#[derive(Debug)]
pub struct MeshGround {
    bvh: Bvh,
    normals: Vec<[f64; 3]>,
}

impl MeshGround {
    /// Arranges triangles. Their normals follow from the order of their corners.
    ///
    /// # Errors
    /// As [`Bvh::new`].
    pub fn new(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self, BvhError> {
        let bvh = Bvh::new(positions, triangles)?;
        let normal = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|corner| positions[corner as usize]);
            let side = |p: [f64; 3]| [0, 1, 2].map(|i| p[i] - a[i]);
            normalized(cross(side(b), side(c)))
        };
        Ok(Self { normals: triangles.iter().map(normal).collect(), bvh })
    }
}

impl Ground for MeshGround {
    fn meet(&self, ray: &Ray) -> Option<Met> {
        let hit = self.bvh.closest_hit(ray)?;
        Some(Met { t: hit.t, normal: self.normals[hit.triangle as usize] })
    }
}
