//! The lines of sight of a satellite image in the frame of a mesh.
//!
//! The RPC is inverted at two heights, just above and just below the model, on a lattice of pixels.
//! Between the nodes the ground points are interpolated bilinearly. The widest lattice with an
//! interpolation error below a millimetre is used. The error is measured in the middles of cells.
//! Halfway between the heights the deviation of the straight line from the line of the RPC, which
//! is curved in the map, is measured too.

use bvh::Ray;
use camera::{ImagePoint, RpcCamera};
use crs::MapProjection;

use crate::{PriorModel, PriorsError};
use numeric::vector::{Vector, along, dot, norm, sub, unit};

/// Spacings of the lattice that are tried, pixels.
const STEPS: [usize; 4] = [64, 16, 4, 1];
/// Largest interpolation error, metres.
const TOLERANCE_M: f64 = 1e-3;
/// Number of rows and columns of cells in which the error is measured.
const MEASURED: usize = 8;
/// Distance of the ends of a line of sight above and below the model, metres.
const BEYOND_M: f64 = 1.0;
/// Step in latitude for the meridian convergence, degrees.
const NORTH_STEP_DEG: f64 = 1e-4;

/// Lines of sight of the pixels of an image.
#[derive(Debug, Clone)]
pub struct LinesOfSight {
    size: (usize, usize),
    /// Spacing of the lattice, pixels.
    step: usize,
    /// Number of nodes in a row of the lattice.
    columns: usize,
    /// Ground points of the nodes at the upper and the lower height; NaN where the RPC has none.
    nodes: Vec<[Vector; 2]>,
    from_height_m: f64,
    error_m: f64,
    /// Unit vector to the north in the map.
    north: [f64; 2],
}

/// A camera, and the transform of its ground points to the frame of the mesh.
struct Ground<'a> {
    camera: &'a RpcCamera,
    projection: &'a MapProjection,
    origin: Vector,
}

impl LinesOfSight {
    /// Computes the lines of sight of an image with `size` (columns, rows).
    ///
    /// The mesh of the model must be in the map of `projection` (metres), with heights above the
    /// ellipsoid.
    ///
    /// # Errors
    /// [`PriorsError::NothingToSee`] when the model has no triangles, [`PriorsError::Geodesy`] when
    /// its position cannot be projected.
    pub fn new(
        camera: &RpcCamera,
        size: (usize, usize),
        model: &PriorModel,
        projection: &MapProjection,
    ) -> Result<Self, PriorsError> {
        let mesh = model.mesh();
        let origin = [mesh.origin.x, mesh.origin.y, mesh.origin.z];
        let corners = || mesh.positions.iter();
        let low = corners().fold([f64::INFINITY; 3], |low, p| [0, 1, 2].map(|i| low[i].min(p[i])));
        let high = corners().fold([f64::NEG_INFINITY; 3], |high, p| [0, 1, 2].map(|i| high[i].max(p[i])));
        if low[2] > high[2] {
            return Err(PriorsError::NothingToSee);
        }
        let heights = [high[2] + BEYOND_M + origin[2], low[2] - BEYOND_M + origin[2]];
        let middle = [0, 1].map(|i| 0.5 * (low[i] + high[i]) + origin[i]);
        let mut made = Self {
            size,
            step: 1,
            columns: 0,
            nodes: Vec::new(),
            from_height_m: heights[0],
            error_m: 0.0,
            north: north(projection, middle)?,
        };
        let ground = Ground { camera, projection, origin };
        for step in STEPS {
            made.lay(&ground, step, heights)?;
            let bent = made.measure(&ground, heights)?;
            // The straightness does not depend on the lattice, so a narrower one would not improve
            // it.
            if bent.interpolation_m <= TOLERANCE_M || step == 1 {
                made.error_m = bent.interpolation_m.max(bent.straightness_m);
                break;
            }
        }
        Ok(made)
    }

    /// Returns the columns and rows of the image.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Returns the height above the ellipsoid at which lines of sight begin, metres.
    pub fn from_height_m(&self) -> f64 {
        self.from_height_m
    }

    /// Returns the largest measured distance between a line of sight and the RPC, metres.
    pub fn error_m(&self) -> f64 {
        self.error_m
    }

    /// Returns the line of sight of a pixel, from above the model (t = 0) to below it (t = 1).
    ///
    /// Returns `None` outside the image and where the RPC has no ground point.
    pub fn ray(&self, column: usize, row: usize) -> Option<Ray> {
        if column >= self.size.0 || row >= self.size.1 {
            return None;
        }
        let [top, bottom] = self.ends(column as f64, row as f64);
        let direction = sub(bottom, top);
        direction.iter().all(|c| c.is_finite()).then_some(Ray { origin: top, direction, end: 1.0 })
    }

    /// Converts a direction of the map to east, north, up.
    pub(crate) fn east_north_up(&self, direction: Vector) -> Vector {
        let [x, y] = self.north;
        [dot(direction, [y, -x, 0.0]), dot(direction, [x, y, 0.0]), direction[2]]
    }

    /// Computes the nodes of a lattice.
    fn lay(&mut self, ground: &Ground<'_>, step: usize, heights: [f64; 2]) -> Result<(), PriorsError> {
        let count = |pixels: usize| pixels.saturating_sub(1).div_ceil(step) + 1;
        (self.step, self.columns) = (step, count(self.size.0));
        let node = |i: usize| ImagePoint {
            sample: ((i % self.columns) * step) as f64,
            line: ((i / self.columns) * step) as f64,
        };
        let pixels: Vec<ImagePoint> = (0..self.columns * count(self.size.1)).map(node).collect();
        let (tops, bottoms) = (ground.at(&pixels, heights[0])?, ground.at(&pixels, heights[1])?);
        self.nodes = tops.into_iter().zip(bottoms).map(|(top, bottom)| [top, bottom]).collect();
        Ok(())
    }

    /// Interpolates the two ends of a line of sight.
    fn ends(&self, sample: f64, line: f64) -> [Vector; 2] {
        let step = self.step as f64;
        let rows = self.nodes.len() / self.columns;
        let cell = |at: f64, count: usize| ((at / step) as usize).min(count.saturating_sub(2));
        let (column, row) = (cell(sample, self.columns), cell(line, rows));
        let (u, v) = (sample / step - column as f64, line / step - row as f64);
        let node = |c: usize, r: usize| &self.nodes[r.min(rows - 1) * self.columns + c.min(self.columns - 1)];
        let mix = |a: Vector, b: Vector, t: f64| if t == 0.0 { a } else { along(a, t, sub(b, a)) };
        [0, 1].map(|end| {
            let upper = mix(node(column, row)[end], node(column + 1, row)[end], u);
            let lower = mix(node(column, row + 1)[end], node(column + 1, row + 1)[end], u);
            mix(upper, lower, v)
        })
    }

    /// Measures the distance of the lines from the RPC in the middles of some cells.
    fn measure(&self, ground: &Ground<'_>, heights: [f64; 2]) -> Result<Bent, PriorsError> {
        let middles = |pixels: usize| {
            let cells = pixels.saturating_sub(1).div_ceil(self.step).max(1);
            let every = cells.div_ceil(MEASURED);
            let middle = move |i: usize| ((i as f64 + 0.5) * self.step as f64).min(pixels.saturating_sub(1) as f64);
            (0..cells).step_by(every).map(middle)
        };
        let rows: Vec<f64> = middles(self.size.1).collect();
        let pixels: Vec<ImagePoint> =
            middles(self.size.0).flat_map(|sample| rows.iter().map(move |&line| ImagePoint { sample, line })).collect();
        let between = 0.5 * (heights[0] + heights[1]);
        let exact = [ground.at(&pixels, heights[0])?, ground.at(&pixels, heights[1])?, ground.at(&pixels, between)?];
        let mut bent = Bent { interpolation_m: 0.0, straightness_m: 0.0 };
        for (i, pixel) in pixels.iter().enumerate() {
            let [top, bottom] = self.ends(pixel.sample, pixel.line);
            let middle = |a: Vector, b: Vector| along(a, 0.5, sub(b, a));
            // `max` ignores NaN, the distance where the RPC has no ground point.
            bent.interpolation_m =
                bent.interpolation_m.max(norm(sub(top, exact[0][i]))).max(norm(sub(bottom, exact[1][i])));
            let straight = middle(exact[0][i], exact[1][i]);
            bent.straightness_m = bent.straightness_m.max(norm(sub(straight, exact[2][i])));
        }
        Ok(bent)
    }
}

/// Errors of lines of sight.
struct Bent {
    /// Largest error of the interpolation, metres.
    interpolation_m: f64,
    /// Largest distance of a straight line from the line of the RPC, metres.
    straightness_m: f64,
}

impl Ground<'_> {
    /// Returns the ground points of pixels at a height, in the frame of the mesh; NaN where the RPC
    /// has none.
    fn at(&self, pixels: &[ImagePoint], height_m: f64) -> Result<Vec<Vector>, PriorsError> {
        let found = |&pixel: &ImagePoint| match self.camera.localize(pixel, height_m) {
            Ok(ground) => (ground.lon_deg, ground.lat_deg),
            Err(_) => (f64::NAN, f64::NAN),
        };
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = pixels.iter().map(found).unzip();
        self.projection.map_from_lonlat_slices(&mut x, &mut y)?;
        let local = |(x, y): (f64, f64)| [x - self.origin[0], y - self.origin[1], height_m - self.origin[2]];
        Ok(x.into_iter().zip(y).map(local).collect())
    }
}

/// Returns the unit vector to the north at a position of the map.
fn north(projection: &MapProjection, [x, y]: [f64; 2]) -> Result<[f64; 2], PriorsError> {
    let (lon, lat) = projection.lonlat_from_map(x, y)?;
    // At the pole there is no room for a step to the north.
    let (from, to) = (lat.min(90.0 - NORTH_STEP_DEG), lat.min(90.0 - NORTH_STEP_DEG) + NORTH_STEP_DEG);
    let (a, b) = (projection.map_from_lonlat(lon, from)?, projection.map_from_lonlat(lon, to)?);
    let [x, y, _] = unit([b.x - a.x, b.y - a.y, 0.0]).unwrap_or([0.0, 1.0, 0.0]);
    Ok([x, y])
}
