//! A satellite image whose projection is known at the nodes of a lattice in space.
//!
//! Between the nodes, column and row are trilinear. Over the few tens of metres of a cell an RPC
//! differs from that by less than a thousandth of a pixel, so that every surfel is seen through the
//! affine part of its own place, wherever it moves. [`LatticeView::pixel`] is what the exact camera
//! is compared with.

use crate::view::{LocalView, SurfelCamera};

/// The nodes of a lattice: a box in the local frame, cut evenly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatticeBox {
    low: [f64; 3],
    step: [f64; 3],
    counts: [usize; 3],
}

impl LatticeBox {
    /// Makes a lattice over a box whose nodes are at most `spacing_m` apart.
    pub fn new(low: [f64; 3], high: [f64; 3], spacing_m: f64) -> Self {
        let cells = [0, 1, 2].map(|i| ((high[i] - low[i]) / spacing_m).ceil().max(1.0));
        let step = [0, 1, 2].map(|i| ((high[i] - low[i]) / cells[i]).max(1e-6));
        Self { low, step, counts: cells.map(|c| c as usize + 1) }
    }

    /// Returns the positions of the nodes.
    pub fn nodes(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let [nx, ny, nz] = self.counts;
        (0..nx * ny * nz).map(move |k| {
            let at = [k % nx, k / nx % ny, k / (nx * ny)];
            [0, 1, 2].map(|i| self.low[i] + at[i] as f64 * self.step[i])
        })
    }
}

/// A satellite image by its pixels at the nodes of a lattice.
#[derive(Debug, Clone, PartialEq)]
pub struct LatticeView {
    size: [usize; 2],
    lattice: LatticeBox,
    /// Column and row of each node.
    pixels: Vec<[f64; 2]>,
    /// Unit vector along the line of sight, downwards.
    sight: [f64; 3],
    /// The middle of the lattice, its pixel and depth, and the inverse of the derivatives there.
    middle: [f64; 3],
    at_middle: [f64; 3],
    inverse: [[f64; 3]; 3],
}

impl LatticeView {
    /// Makes the view of an image from the pixels of the nodes of a lattice and the line of sight,
    /// a unit vector that points down. Returns `None` where a node has no pixel or the line of
    /// sight does not fit the pixels.
    ///
    /// # Panics
    /// If the number of pixels is not that of the nodes.
    pub fn new(lattice: LatticeBox, pixels: Vec<[f64; 2]>, sight: [f64; 3], size: [usize; 2]) -> Option<Self> {
        assert_eq!(pixels.len(), lattice.counts.iter().product::<usize>(), "every node has a pixel");
        if !pixels.as_flattened().iter().all(|p| p.is_finite()) {
            return None;
        }
        let middle = [0, 1, 2].map(|i| lattice.low[i] + 0.5 * lattice.step[i] * (lattice.counts[i] - 1) as f64);
        let mut view = Self { size, lattice, pixels, sight, middle, at_middle: [0.0; 3], inverse: [[0.0; 3]; 3] };
        let (pixel, [a, b]) = view.seen(middle);
        view.at_middle = [pixel[0], pixel[1], dot(middle, sight)];
        // Columns of the inverse are cross products of the rows a, b and the line of sight.
        let columns = [cross(b, sight), cross(sight, a), cross(a, b)];
        let determinant = dot(a, columns[0]);
        if !(determinant.abs() > 1e-9 && determinant.is_finite()) {
            return None;
        }
        view.inverse = [0, 1, 2].map(|row| [0, 1, 2].map(|column| columns[column][row] / determinant));
        Some(view)
    }

    /// Returns column and row of a local position. Beyond the lattice the outermost cell is
    /// continued.
    pub fn pixel(&self, position: [f64; 3]) -> [f64; 2] {
        self.seen(position).0
    }

    /// Returns the unit vector along the line of sight, downwards.
    pub fn sight(&self) -> [f64; 3] {
        self.sight
    }

    /// Returns column and row of a position, and their derivatives.
    fn seen(&self, position: [f64; 3]) -> ([f64; 2], [[f64; 3]; 2]) {
        let LatticeBox { low, step, counts } = self.lattice;
        let place = [0, 1, 2].map(|i| (position[i] - low[i]) / step[i]);
        let cell = [0, 1, 2].map(|i| (place[i].max(0.0) as usize).min(counts[i] - 2));
        let share = [0, 1, 2].map(|i| place[i] - cell[i] as f64);
        let (mut pixel, mut slopes) = ([0.0; 2], [[0.0; 3]; 2]);
        for corner in 0..8usize {
            let bit = |axis: usize| corner >> axis & 1;
            let at = [0, 1, 2].map(|i| cell[i] + bit(i));
            let node = self.pixels[at[0] + counts[0] * (at[1] + counts[1] * at[2])];
            let weight = |axis: usize| if bit(axis) == 1 { share[axis] } else { 1.0 - share[axis] };
            let weights = [weight(0), weight(1), weight(2)];
            let sign = |axis: usize| if bit(axis) == 1 { 1.0 / step[axis] } else { -1.0 / step[axis] };
            let by = [
                sign(0) * weights[1] * weights[2],
                sign(1) * weights[0] * weights[2],
                sign(2) * weights[0] * weights[1],
            ];
            let all = weights[0] * weights[1] * weights[2];
            for i in 0..2 {
                pixel[i] += all * node[i];
                (0..3).for_each(|axis| slopes[i][axis] += by[axis] * node[i]);
            }
        }
        (pixel, slopes)
    }
}

impl SurfelCamera for LatticeView {
    const PERSPECTIVE: bool = false;

    fn size(&self) -> [usize; 2] {
        self.size
    }

    fn local(&self, _: usize, position: [f64; 3]) -> Option<LocalView> {
        let (pixel, jacobian) = self.seen(position);
        Some(LocalView { pixel, jacobian, depth_m: dot(position, self.sight), depth_axis: self.sight })
    }

    /// The camera is taken as affine about the middle: good for differences of near pixels.
    fn point(&self, pixel: [f64; 2], depth_m: f64) -> Option<[f64; 3]> {
        let by = [pixel[0], pixel[1], depth_m];
        let by = [0, 1, 2].map(|i| by[i] - self.at_middle[i]);
        Some([0, 1, 2].map(|i| self.middle[i] + dot(self.inverse[i], by)))
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera with a slight bend, and its line of sight.
    fn camera(p: [f64; 3]) -> [f64; 2] {
        [2.0 * p[0] + 0.6 * p[2] + 1e-6 * p[0] * p[0] + 200.0, -2.0 * p[1] + 0.2 * p[2] + 1e-6 * p[0] * p[1] + 200.0]
    }

    fn view() -> LatticeView {
        let lattice = LatticeBox::new([-100.0, -90.0, -20.0], [110.0, 95.0, 40.0], 32.0);
        let pixels = lattice.nodes().map(camera).collect();
        let along = [-0.3, 0.1, 1.0f64];
        let length = along.iter().map(|c| c * c).sum::<f64>().sqrt();
        LatticeView::new(lattice, pixels, along.map(|c| -c / length), [400, 380]).unwrap()
    }

    #[test]
    fn pixels_are_those_of_the_camera_and_slopes_their_differences() {
        let view = view();
        for p in [[3.0, -7.0, 11.0], [-99.0, 94.0, 39.0], [0.0; 3], [120.0, -100.0, 50.0]] {
            let (found, exact) = (view.pixel(p), camera(p));
            assert!((0..2).all(|i| (found[i] - exact[i]).abs() < 2e-3), "{found:?} {exact:?}");
            let here = view.local(0, p).unwrap();
            for axis in 0..3 {
                let moved = |by: f64| {
                    let mut p = p;
                    p[axis] += by;
                    view.pixel(p)
                };
                let (ahead, behind) = (moved(1e-3), moved(-1e-3));
                for i in 0..2 {
                    let slope = (ahead[i] - behind[i]) / 2e-3;
                    assert!((slope - here.jacobian[i][axis]).abs() < 1e-4, "{slope} {here:?}");
                }
            }
            let back = view.point(here.pixel, here.depth_m).unwrap();
            assert!((0..3).all(|i| (back[i] - p[i]).abs() < 0.05), "{back:?} {p:?}");
        }
    }

    #[test]
    fn a_lattice_with_an_unseen_node_is_none() {
        let lattice = LatticeBox::new([0.0; 3], [1.0; 3], 2.0);
        let mut pixels: Vec<[f64; 2]> = lattice.nodes().map(camera).collect();
        assert_eq!(pixels.len(), 8);
        pixels[3][0] = f64::NAN;
        assert_eq!(LatticeView::new(lattice, pixels, [0.0, 0.0, -1.0], [10, 10]), None);
    }
}
