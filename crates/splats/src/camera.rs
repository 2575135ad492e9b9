//! Cameras that splats are rendered through: the pixel of a local position, its depth, and the
//! Jacobian that maps a covariance on the ground to one in the image (EWA splatting, Zwicker et al.
//! 2001).
//!
//! Local positions are metres along the axes of the map. Depths are only compared with each other.
//! They are the distance along the viewing direction for satellites, along the optical axis for
//! perspective cameras, and minus the height from above.

use camera::{ImagePoint, Lens, Pose, RpcCamera};
use crs::{CrsError, MapProjection};
use geodesy::LonLatHeight;

use super::SplatSurface;

/// Step of the numerical derivatives of a satellite's projection, metres: an RPC is linear over it
/// to 1e-6 px.
const RPC_STEP_M: f64 = 1.0;
/// Depth below which a perspective camera draws nothing, metres.
const NEAR_M: f64 = 0.1;
/// Step of the numerical derivatives of a lens, in its image plane at distance 1.
const LENS_STEP: f64 = 1e-5;

/// Multiple of the image's half width and height beyond which a lens is continued as if it were
/// flat. The derivative of a splat beside the camera is unbounded there and would smear it over the
/// image. The original 3DGS code has the same 1.3.
const BESIDE: f64 = 1.3;

/// Low-pass of the original 3DGS code, px².
const LOW_PASS_PX2: f64 = 0.3;

/// A position seen by a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Column and row.
    pub pixel: [f64; 2],
    /// Depth; the smaller one is in front.
    pub depth: f64,
    /// Derivatives of column (first) and row (second) by easting, northing and height, pixels per
    /// metre.
    pub jacobian: [[f64; 3]; 2],
}

/// A camera that splats can be rendered through.
pub trait SplatCamera: Sync {
    /// Columns and rows of the image.
    fn size(&self) -> (usize, usize);

    /// Variance that a pixel adds to the covariance of a splat, px². The default is that of 3DGS
    /// viewers.
    fn low_pass_px2(&self) -> f64 {
        LOW_PASS_PX2
    }

    /// Projects local positions into the image; `None` for positions that the camera cannot see.
    ///
    /// # Errors
    /// [`CrsError`] when PROJ cannot be set up.
    fn project(&self, positions: &[[f64; 3]]) -> Result<Vec<Option<Projection>>, CrsError>;
}

/// A satellite image with its RPC.
#[derive(Debug, Clone, Copy)]
pub struct RpcSplatCamera<'a> {
    camera: &'a RpcCamera,
    projection: &'a MapProjection,
    origin: [f64; 3],
    size: (usize, usize),
    towards_sensor: [f64; 3],
}

impl<'a> RpcSplatCamera<'a> {
    /// Creates the camera of an image. The origin of local positions is on the map of `projection`,
    /// with its height above the ellipsoid. The line of sight at the origin orders splats by depth:
    /// it hardly turns over a scene.
    ///
    /// Returns `None` where the camera has no line of sight at the origin, because the image shows
    /// another place.
    ///
    /// # Errors
    /// [`CrsError`] for an origin outside of the projection.
    pub fn new(
        camera: &'a RpcCamera,
        projection: &'a MapProjection,
        origin: [f64; 3],
        size: (usize, usize),
    ) -> Result<Option<Self>, CrsError> {
        let mut made = Self { camera, projection, origin, size, towards_sensor: [0.0, 0.0, 1.0] };
        let Some(Some(here)) = made.project(&[[0.0; 3]])?.pop() else { return Ok(None) };
        let [[a, b, c], [d, e, f]] = here.jacobian;
        // The direction along which the position in the image does not change.
        let across = [b * f - c * e, c * d - a * f, a * e - b * d];
        let length = across.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(across[2].abs() > 1e-6 * length && length.is_finite()) {
            return Ok(None);
        }
        made.towards_sensor = across.map(|x| x / length * across[2].signum());
        Ok(Some(made))
    }

    /// Unit vector from the ground to the sensor: easting, northing, height.
    pub fn towards_sensor(&self) -> [f64; 3] {
        self.towards_sensor
    }

    /// Returns the pixels of local positions; NaN for positions without a pixel.
    ///
    /// # Errors
    /// [`CrsError`] when PROJ cannot be set up.
    pub fn pixels(&self, positions: impl Iterator<Item = [f64; 3]>) -> Result<Vec<[f64; 2]>, CrsError> {
        let (mut x, mut y, mut h) = (Vec::new(), Vec::new(), Vec::new());
        for p in positions {
            x.push(p[0] + self.origin[0]);
            y.push(p[1] + self.origin[1]);
            h.push(p[2] + self.origin[2]);
        }
        self.projection.lonlat_from_map_slices(&mut x, &mut y)?;
        let pixel = |((&lon, &lat), &h): ((&f64, &f64), &f64)| match self.camera.project(LonLatHeight::new(lon, lat, h))
        {
            Ok(p) => [p.sample, p.line],
            Err(_) => [f64::NAN; 2],
        };
        Ok(x.iter().zip(&y).zip(&h).map(pixel).collect())
    }
}

impl SplatCamera for RpcSplatCamera<'_> {
    fn size(&self) -> (usize, usize) {
        self.size
    }

    fn project(&self, positions: &[[f64; 3]]) -> Result<Vec<Option<Projection>>, CrsError> {
        let moved = |p: &[f64; 3]| {
            let step = |axis: usize| {
                let mut q = *p;
                q[axis] += RPC_STEP_M;
                q
            };
            [*p, step(0), step(1), step(2)]
        };
        let pixels = self.pixels(positions.iter().flat_map(moved))?;
        let one = |(p, seen): (&[f64; 3], &[[f64; 2]])| {
            let by = |i: usize| [1, 2, 3].map(|axis| (seen[axis][i] - seen[0][i]) / RPC_STEP_M);
            let jacobian = [by(0), by(1)];
            let depth = -(0..3).map(|i| p[i] * self.towards_sensor[i]).sum::<f64>();
            let finite = jacobian.as_flattened().iter().all(|v| v.is_finite());
            finite.then_some(Projection { pixel: seen[0], depth, jacobian })
        };
        Ok(positions.iter().zip(pixels.chunks_exact(4)).map(one).collect())
    }
}

/// A perspective camera whose world is the local frame.
#[derive(Debug, Clone, Copy)]
pub struct LensSplatCamera<'a> {
    /// Inner geometry of the camera.
    pub lens: &'a Lens,
    /// Pose of the camera in the local frame, metres.
    pub pose: &'a Pose,
}

impl LensSplatCamera<'_> {
    /// Least and greatest coordinates in the image plane at distance 1 between which the lens is
    /// used as it is.
    fn word(&self) -> [[f64; 2]; 2] {
        let (width, height) = (self.lens.width() as f64 - 1.0, self.lens.height() as f64 - 1.0);
        let rim = [0.0, 0.5, 1.0].map(|t| [[t, 0.0], [t, 1.0], [0.0, t], [1.0, t]]).into_iter().flatten();
        let seen = rim.filter_map(|[s, t]| self.lens.direction(ImagePoint::new(s * width, t * height)));
        let none = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let [u, v] = seen.fold(none, |range, at| [0, 1].map(|i| [range[i][0].min(at[i]), range[i][1].max(at[i])]));
        [u, v].map(|[low, high]| {
            let (middle, half) = (low + (high - low) / 2.0, BESIDE * (high - low) / 2.0);
            // A lens that cannot be inverted at the rim has no bound.
            if half >= 0.0 { [middle - half, middle + half] } else { [f64::NEG_INFINITY, f64::INFINITY] }
        })
    }
}

impl SplatCamera for LensSplatCamera<'_> {
    fn size(&self) -> (usize, usize) {
        (self.lens.width(), self.lens.height())
    }

    fn project(&self, positions: &[[f64; 3]]) -> Result<Vec<Option<Projection>>, CrsError> {
        let word = self.word();
        let one = |p: &[f64; 3]| {
            let [x, y, z] = self.pose.camera_from_world(*p);
            if z <= NEAR_M {
                return None;
            }
            let beside = [x / z, y / z];
            let [u, v] = [0, 1].map(|i| beside[i].clamp(word[i][0], word[i][1]));
            let at = |u: f64, v: f64| self.lens.project(u, v).map(|p| [p.sample, p.line]);
            let (here, right, below) = (at(u, v)?, at(u + LENS_STEP, v)?, at(u, v + LENS_STEP)?);
            let by = [0, 1].map(|i| [(right[i] - here[i]) / LENS_STEP, (below[i] - here[i]) / LENS_STEP]);
            let jacobian = by.map(|[by_u, by_v]| {
                let in_camera = [by_u / z, by_v / z, -(by_u * u + by_v * v) / z];
                [0, 1, 2].map(|axis| (0..3).map(|k| in_camera[k] * self.pose.rotation[k][axis]).sum::<f64>())
            });
            let pixel = [0, 1].map(|i| here[i] + by[i][0] * (beside[0] - u) + by[i][1] * (beside[1] - v));
            Some(Projection { pixel, depth: z, jacobian })
        };
        Ok(positions.iter().map(one).collect())
    }
}

/// A view from straight above, with one pixel per cell of a surface.
#[derive(Debug, Clone, Copy)]
pub struct MapSplatCamera<'a> {
    surface: SplatSurface<'a>,
    jacobian: [[f64; 3]; 2],
}

impl<'a> MapSplatCamera<'a> {
    /// Creates the camera over a surface; `None` where the geotransform has no inverse.
    pub fn new(surface: &SplatSurface<'a>) -> Option<Self> {
        let transform = surface.geotransform();
        let origin = surface.origin();
        let at = |x: f64, y: f64| transform.cell_from_map(origin[0] + x, origin[1] + y);
        let (here, east, north) = (at(0.0, 0.0)?, at(1.0, 0.0)?, at(0.0, 1.0)?);
        let jacobian = [[east.0 - here.0, north.0 - here.0, 0.0], [east.1 - here.1, north.1 - here.1, 0.0]];
        Some(Self { surface: *surface, jacobian })
    }
}

impl SplatCamera for MapSplatCamera<'_> {
    fn size(&self) -> (usize, usize) {
        (self.surface.heights().width(), self.surface.heights().height())
    }

    /// Returns 0, because heights are read at the middles of cells.
    fn low_pass_px2(&self) -> f64 {
        0.0
    }

    fn project(&self, positions: &[[f64; 3]]) -> Result<Vec<Option<Projection>>, CrsError> {
        let origin = self.surface.origin();
        let one = |p: &[f64; 3]| {
            let (column, row) = self.surface.geotransform().cell_from_map(origin[0] + p[0], origin[1] + p[1])?;
            Some(Projection { pixel: [column, row], depth: -p[2], jacobian: self.jacobian })
        };
        Ok(positions.iter().map(one).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use camera::LensModel;

    #[test]
    fn the_jacobian_of_a_lens_is_its_derivative() {
        let lens =
            Lens::new(640, 480, LensModel::OpenCv, &[500.0, 510.0, 320.0, 240.0, -0.1, 0.02, 1e-3, -2e-3]).unwrap();
        let pose = Pose::from_quaternion([0.9, 0.1, -0.3, 0.2], [0.5, -1.0, 6.0]).unwrap();
        let camera = LensSplatCamera { lens: &lens, pose: &pose };
        let at = |p: [f64; 3]| camera.project(&[p]).unwrap()[0].unwrap();
        let here = at([0.3, 0.2, 0.1]);
        for axis in 0..3 {
            let (mut ahead, mut behind) = ([0.3, 0.2, 0.1], [0.3, 0.2, 0.1]);
            ahead[axis] += 1e-4;
            behind[axis] -= 1e-4;
            for i in 0..2 {
                let slope = (at(ahead).pixel[i] - at(behind).pixel[i]) / 2e-4;
                assert!((slope - here.jacobian[i][axis]).abs() < 1e-2 * (1.0 + slope.abs()), "{slope} {here:?}");
            }
        }
        // Far beside the image there is no derivative without bounds, and no way back into it.
        let aside = pose.rotation[0];
        let far = at([0, 1, 2].map(|i| pose.centre[i] + 25.0 * aside[i] + 0.2 * pose.rotation[2][i]));
        assert!(far.pixel[0] > 10_000.0 && far.jacobian.as_flattened().iter().all(|j| j.abs() < 5000.0), "{far:?}");
        let behind = pose.centre.map(|c| c - 100.0);
        assert!(camera.project(&[behind]).unwrap()[0].is_none_or(|p| p.depth > NEAR_M));
    }
}
