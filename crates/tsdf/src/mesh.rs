//! The mesh that a fusion gives, and its parts.

/// A mesh with a colour at every corner.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FusedMesh {
    /// Position that the corners are counted from, in the frame of the cameras.
    pub origin: [f64; 3],
    /// Corners, metres from the origin.
    pub positions: Vec<[f32; 3]>,
    /// Colours of the corners, 0 to 1; grey where the views have none.
    pub colours: Vec<[f32; 3]>,
    /// Corners of the triangles, counter-clockwise seen from the side of the cameras.
    pub triangles: Vec<[u32; 3]>,
}

impl FusedMesh {
    /// Returns the area of a triangle, square metres.
    fn area_m2(&self, triangle: [u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|corner| self.positions[corner as usize].map(f64::from));
        let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        0.5 * n.iter().map(|c| c * c).sum::<f64>().sqrt()
    }

    /// Returns the mesh without its connected parts of a smaller area, and the number of parts that
    /// were left out.
    #[must_use]
    pub fn without_small_parts(&self, least_area_m2: f64) -> (Self, usize) {
        let mut parts = Parts::new(self.positions.len());
        for &[a, b, c] in &self.triangles {
            parts.join(a, b);
            parts.join(b, c);
        }
        let roots: Vec<u32> = (0..self.positions.len() as u32).map(|corner| parts.root(corner)).collect();
        let mut area = vec![0.0f64; self.positions.len()];
        for &triangle in &self.triangles {
            area[roots[triangle[0] as usize] as usize] += self.area_m2(triangle);
        }
        let is_kept = |corner: usize| area[roots[corner] as usize] >= least_area_m2;
        let mut kept = Self { origin: self.origin, ..Self::default() };
        let mut number = vec![u32::MAX; self.positions.len()];
        for corner in (0..self.positions.len()).filter(|&corner| is_kept(corner)) {
            number[corner] = kept.positions.len() as u32;
            kept.positions.push(self.positions[corner]);
            kept.colours.push(self.colours[corner]);
        }
        let triangles = self.triangles.iter().filter(|t| is_kept(t[0] as usize));
        kept.triangles = triangles.map(|t| t.map(|corner| number[corner as usize])).collect();
        let dropped = (0..self.positions.len()).filter(|&c| roots[c] as usize == c && !is_kept(c)).count();
        (kept, dropped)
    }
}

/// Sets of corners that are joined.
struct Parts(Vec<u32>);

impl Parts {
    fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    fn root(&mut self, mut corner: u32) -> u32 {
        while self.0[corner as usize] != corner {
            let parent = self.0[corner as usize];
            self.0[corner as usize] = self.0[parent as usize];
            corner = parent;
        }
        corner
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // The smaller number is the root, so that the result has one order.
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_parts_are_left_out() {
        let triangle = |x: f32, side: f32| [[x, 0.0, 0.0], [x + side, 0.0, 0.0], [x, side, 0.0]];
        let mesh = FusedMesh {
            positions: [triangle(0.0, 0.1), triangle(5.0, 2.0)].concat(),
            colours: vec![[0.5; 3]; 6],
            triangles: vec![[0, 1, 2], [3, 4, 5]],
            ..FusedMesh::default()
        };
        let (kept, dropped) = mesh.without_small_parts(1.0);
        assert_eq!((kept.positions, kept.triangles, dropped), (triangle(5.0, 2.0).to_vec(), vec![[0, 1, 2]], 1));
        assert_eq!(mesh.without_small_parts(0.0), (mesh.clone(), 0));
    }
}
