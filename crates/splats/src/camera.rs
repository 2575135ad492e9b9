//! Cameras that splats are rendered through.
//!
//! The projection of satellites and of the view from above is affine over a splat: the pixel of a
//! local position, its depth, and their derivatives. The rays of perspective cameras meet splats in
//! space.
//!
//! Local positions are metres along the axes of the map. Depths are metres along the viewing
//! direction for satellites, relative to the origin; along the optical axis for perspective
//! cameras; and minus the height from above.

use camera::{Lens, Pose, RpcCamera};
use crs::{CrsError, MapProjection};
use geodesy::LonLatHeight;

use super::SplatSurface;

/// Step of the numerical derivatives of a satellite's projection, metres: an RPC is linear over it
/// to 1e-6 px.
const RPC_STEP_M: f64 = 1.0;
/// Low-pass of the original 3DGS code, px².
pub(crate) const LOW_PASS_PX2: f64 = 0.3;

/// A position seen by a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Column and row.
    pub pixel: [f64; 2],
    /// Depth, metres; the smaller one is in front.
    pub depth: f64,
    /// Derivatives of the depth by easting, northing and height.
    pub depth_gradient: [f64; 3],
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

    /// Returns how the rays of the camera lie.
    fn ray_model(&self) -> RayModel<'_>;
}

/// How the rays of a camera lie.
#[derive(Clone, Copy)]
pub enum RayModel<'a> {
    /// By a projection that is affine over a splat.
    Affine(&'a dyn AffineCamera),
    /// By rays through one point.
    Central(&'a Lens, &'a Pose),
}

/// A camera whose projection is affine over a splat.
pub trait AffineCamera: Sync {
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

    fn ray_model(&self) -> RayModel<'_> {
        RayModel::Affine(self)
    }
}

impl AffineCamera for RpcSplatCamera<'_> {
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
            let depth_gradient = self.towards_sensor.map(|c| -c);
            finite.then_some(Projection { pixel: seen[0], depth, depth_gradient, jacobian })
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

impl SplatCamera for LensSplatCamera<'_> {
    fn size(&self) -> (usize, usize) {
        (self.lens.width(), self.lens.height())
    }

    fn ray_model(&self) -> RayModel<'_> {
        RayModel::Central(self.lens, self.pose)
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

    fn ray_model(&self) -> RayModel<'_> {
        RayModel::Affine(self)
    }
}

impl AffineCamera for MapSplatCamera<'_> {
    fn project(&self, positions: &[[f64; 3]]) -> Result<Vec<Option<Projection>>, CrsError> {
        let origin = self.surface.origin();
        let one = |p: &[f64; 3]| {
            let (column, row) = self.surface.geotransform().cell_from_map(origin[0] + p[0], origin[1] + p[1])?;
            let (depth, depth_gradient) = (-p[2], [0.0, 0.0, -1.0]);
            Some(Projection { pixel: [column, row], depth, depth_gradient, jacobian: self.jacobian })
        };
        Ok(positions.iter().map(one).collect())
    }
}
