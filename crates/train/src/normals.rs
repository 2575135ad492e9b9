//! Consistency of the normals of splats with the normals of the drawn depths, both ways, as in the
//! code of 2DGS: Σ (1 − A ⟨N, n⟩) with the drawn normals N and the normals n of the depths, which
//! are cross products of central differences. The coverage A as a factor is held fixed.

use rayon::prelude::*;

use crate::image::SurfelImages;
use crate::view::SurfelCamera;

/// Coverage from which on a pixel has a depth to make normals of.
const LEAST_COVERAGE: f32 = 0.5;

/// Gradients of a pixel by the two differences of points that its normal is made of.
type ByDifferences = [[f32; 3]; 2];

/// Makes normals of depths. Keeps its memory from one image to the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Consistency {
    /// Point of each pixel; NaN where it has no depth.
    points: Vec<[f64; 3]>,
    /// What its two differences pull at.
    pulls: Vec<ByDifferences>,
}

/// A normal of depths.
struct DepthNormal {
    /// Unit vector, turned to the camera.
    unit: [f64; 3],
    /// Length of the cross product.
    length: f64,
    /// Differences along the row and along the column.
    differences: [[f64; 3]; 2],
}

impl Consistency {
    /// Adds `weight` times the gradient of the mean over all pixels to `out`, and returns the mean.
    /// `held` is the coverage that is held fixed.
    pub(crate) fn add_gradient<C: SurfelCamera>(
        &mut self,
        images: &SurfelImages,
        held: &[f32],
        camera: &C,
        weight: f64,
        out: &mut SurfelImages,
    ) -> f64 {
        let [width, height] = images.size;
        if width < 3 || height < 3 {
            return 0.0;
        }
        let unit = 1.0 / (width * height) as f64;
        let depth = |pixel: usize| f64::from(images.depth_m[pixel] / images.coverage[pixel]);
        let place = |pixel: usize| [(pixel % width) as f64, (pixel / width) as f64];
        let point = |pixel: usize| {
            let found = (images.coverage[pixel] > LEAST_COVERAGE).then(|| camera.point(place(pixel), depth(pixel)));
            found.flatten().unwrap_or([f64::NAN; 3])
        };
        (0..width * height).into_par_iter().map(point).collect_into_vec(&mut self.points);
        self.pulls.resize(width * height, [[0.0; 3]; 2]);
        let (points, factor) = (&self.points, weight * unit);
        let [east, north, up] = &mut out.normal;
        let rows = self.pulls.par_chunks_mut(width).zip(east.par_chunks_mut(width));
        let rows = rows.zip(north.par_chunks_mut(width)).zip(up.par_chunks_mut(width)).enumerate();
        let sums = rows.map(|(row, (((pulls, east), north), up))| {
            let mut sum = 0.0;
            for column in 0..width {
                pulls[column] = [[0.0; 3]; 2];
                let pixel = row * width + column;
                let is_inside = column > 0 && row > 0 && column + 1 < width && row + 1 < height;
                let Some(normal) = is_inside.then(|| DepthNormal::new(points, pixel, width)).flatten() else {
                    continue;
                };
                let drawn = [0, 1, 2].map(|i| f64::from(images.normal[i][pixel]));
                let (n, held) = (normal.unit, f64::from(held[pixel]));
                let along = dot(drawn, n);
                sum += 1.0 - held * along;
                let slope = -factor * held;
                east[column] += (slope * n[0]) as f32;
                north[column] += (slope * n[1]) as f32;
                up[column] += (slope * n[2]) as f32;
                let by_cross = [0, 1, 2].map(|i| slope * (drawn[i] - along * n[i]) / normal.length);
                let [a, b] = normal.differences;
                // The normal is b × a, so that it points to the camera.
                pulls[column] = [cross(by_cross, b), cross(a, by_cross)].map(|pull| pull.map(|c| c as f32));
            }
            sum
        });
        let sums: Vec<f64> = sums.collect();
        self.pull_depths(images, camera, out);
        sums.iter().sum::<f64>() * unit
    }

    /// Brings what the differences pull at back to the depths.
    fn pull_depths<C: SurfelCamera>(&self, images: &SurfelImages, camera: &C, out: &mut SurfelImages) {
        let [width, height] = images.size;
        let rows = out.depth_m.par_chunks_mut(width).zip(out.coverage.par_chunks_mut(width)).enumerate();
        rows.for_each(|(row, (by_depth, by_coverage))| {
            for column in 0..width {
                let pixel = row * width + column;
                if self.points[pixel][0].is_nan() {
                    continue;
                }
                let mut by_point = [0.0f64; 3];
                let mut add = |pull: [f32; 3], sign: f64| (0..3).for_each(|i| by_point[i] += sign * f64::from(pull[i]));
                if column > 0 {
                    add(self.pulls[pixel - 1][0], 1.0);
                }
                if column + 1 < width {
                    add(self.pulls[pixel + 1][0], -1.0);
                }
                if row > 0 {
                    add(self.pulls[pixel - width][1], 1.0);
                }
                if row + 1 < height {
                    add(self.pulls[pixel + width][1], -1.0);
                }
                let coverage = images.coverage[pixel];
                let depth = images.depth_m[pixel] / coverage;
                let Some(beyond) = camera.point([column as f64, row as f64], f64::from(depth) + 1.0) else { continue };
                let along = [0, 1, 2].map(|i| beyond[i] - self.points[pixel][i]);
                let slope = dot(by_point, along) as f32;
                by_depth[column] += slope / coverage;
                by_coverage[column] -= slope * depth / coverage;
            }
        });
    }
}

impl DepthNormal {
    /// Returns the normal of a pixel that is not at the border; `None` where it or a neighbour has
    /// no depth.
    fn new(points: &[[f64; 3]], pixel: usize, width: usize) -> Option<Self> {
        let between = |before: usize, behind: usize| [0, 1, 2].map(|i| points[behind][i] - points[before][i]);
        let differences = [between(pixel - 1, pixel + 1), between(pixel - width, pixel + width)];
        let whole = cross(differences[1], differences[0]);
        let length = dot(whole, whole).sqrt();
        let is_known = length > 0.0 && !points[pixel][0].is_nan();
        is_known.then(|| Self { unit: whole.map(|c| c / length), length, differences })
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
