//! The camera of a satellite over the scene: an agile pushbroom on a circular orbit, or a frame
//! camera.
//!
//! Geometry is in the tangent frame (east, north, up; metres) of the scene's centre C. At t = 0 the
//! sensor is at `P(0) = C + r u`, where u is the line of sight at the chosen incidence and azimuth.
//! It moves on a circle about the Earth's centre with the speed of its orbit relative to the
//! ground, which moves too. The pushbroom is steered so that its line sweeps the ground at a
//! constant speed along the heading. A pixel of line l and sample s looks along `b(t) + (s − s₀) k
//! a(t)`, where b points to the target and a points across it. The frame camera looks along `b(0) +
//! (s − s₀) k a(0) + (l − l₀) k c(0)`.
//!
//! A ray is followed to an ellipsoidal height, so that the camera includes the curvature of the
//! Earth. The RPC is fitted to this camera (see [`FittedCamera`]). Refraction is left out, because
//! it only shifts an image, as pointing does.

use camera::{Correspondence, ImagePoint, Rpc, RpcFit};
use geodesy::{EnuFrame, EnuPoint, LonLatHeight};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::SimulateError;
use crate::config::CameraModel;

/// Height of the orbit, metres.
const ORBIT_M: f64 = 617_000.0;
/// Radius of the sphere that the orbit is concentric with, metres.
const EARTH_M: f64 = 6_371_000.0;
/// Gravitational parameter of the Earth, m³/s².
const GRAVITY: f64 = 3.986_004_418e14;
/// Angular velocity of the Earth, radians per second.
const EARTH_RATE: f64 = 7.292_115e-5;
/// Numbers of fit positions along samples, lines and heights.
const LATTICE: [usize; 3] = [11, 11, 7];
/// Share of the image size by which the domain of the RPC extends beyond the edges.
const FIT_MARGIN: f64 = 0.1;
/// Tolerance on the height that a ray is followed to, metres.
const TOLERANCE_M: f64 = 1e-7;
/// Largest number of steps to a height. Each step leaves a thousandth of the distance.
const MAX_STEPS: usize = 12;

/// The line of sight and the sampling distance of a view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Look {
    /// Angle between the line of sight and the vertical at the scene, degrees.
    pub incidence_deg: f64,
    /// Direction from the scene to the sensor, degrees clockwise from north.
    pub azimuth_deg: f64,
    /// Direction of flight, degrees clockwise from north; image lines follow it.
    pub heading_deg: f64,
    /// Sampling distance perpendicular to the line of sight, metres.
    pub gsd_m: f64,
}

/// A physical camera.
#[derive(Debug, Clone)]
pub(crate) struct PhysicalCamera {
    frame: EnuFrame,
    model: CameraModel,
    /// Sensor position at t = 0, the Earth's centre, and the sensor's velocity relative to the
    /// ground.
    position: Vector3<f64>,
    centre_of_orbit: Vector3<f64>,
    tangent: Vector3<f64>,
    rate: f64,
    earth_turn: Vector3<f64>,
    /// Ground distance between lines along the heading, metres, and the time between them, seconds.
    step: Vector3<f64>,
    period_s: f64,
    left: Vector3<f64>,
    per_pixel: f64,
    middle: ImagePoint,
}

/// An RPC with its residual against the physical camera.
#[derive(Debug, Clone)]
pub(crate) struct FittedCamera {
    pub(crate) rpc: Rpc,
    /// Largest distance from the physical camera at points that were not used in the fit, pixels.
    pub(crate) max_px: f64,
}

impl Look {
    /// Returns the unit vector from the scene to the sensor (east, north, up).
    pub fn towards_sensor(&self) -> Vector3<f64> {
        let (sin, cos) = self.incidence_deg.to_radians().sin_cos();
        let (east, north) = self.azimuth_deg.to_radians().sin_cos();
        Vector3::new(sin * east, sin * north, cos)
    }
}

impl PhysicalCamera {
    /// Makes the camera of an image of `width × height` pixels with the scene's `centre` in its
    /// middle.
    pub(crate) fn new(model: CameraModel, look: &Look, centre: LonLatHeight, (width, height): (usize, usize)) -> Self {
        let to_sensor = look.towards_sensor();
        let centre_of_orbit = Vector3::new(0.0, 0.0, -EARTH_M - centre.height_m);
        let orbit = EARTH_M + ORBIT_M;
        // |C + r u − O| = orbit radius, for the distance r.
        let along = -to_sensor.dot(&centre_of_orbit);
        let range = -along + (along * along + orbit * orbit - centre_of_orbit.norm_squared()).sqrt();
        let position = to_sensor * range;
        let (east, north) = look.heading_deg.to_radians().sin_cos();
        let track = Vector3::new(east, north, 0.0);
        // Samples grow to the left of the flight direction. An image flown southwards then has
        // north up and east right.
        let left = Vector3::new(-north, east, 0.0);
        let outwards = (position - centre_of_orbit).normalize();
        let tangent = (track - outwards * outwards.dot(&track)).normalize();
        let rate = (GRAVITY / orbit.powi(3)).sqrt();
        let (sin, cos) = centre.lat_deg.to_radians().sin_cos();
        let earth_turn = Vector3::new(0.0, cos, sin) * EARTH_RATE;
        // Lines are one sampling distance apart, measured across the scan plane.
        let scan_normal = left.cross(&to_sensor).normalize();
        let step_m = look.gsd_m / scan_normal.dot(&track).abs();
        Self {
            frame: EnuFrame::new(centre),
            model,
            position,
            centre_of_orbit,
            tangent,
            rate,
            earth_turn,
            step: track * step_m,
            period_s: step_m / (rate * EARTH_M),
            left,
            per_pixel: look.gsd_m / range,
            middle: ImagePoint::new((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0),
        }
    }

    /// Returns the ground position that an image position sees at an ellipsoidal height.
    pub(crate) fn localize(&self, at: ImagePoint, height_m: f64) -> LonLatHeight {
        let (origin, direction) = self.line_of_sight(at);
        let direction = direction.normalize();
        let mut along = (height_m - self.frame.origin().height_m - origin.z) / direction.z;
        let mut ground = self.ground(origin + direction * along);
        for _ in 0..MAX_STEPS {
            let missing = height_m - ground.height_m;
            if missing.abs() < TOLERANCE_M {
                break;
            }
            along += missing / direction.z;
            ground = self.ground(origin + direction * along);
        }
        ground
    }

    fn ground(&self, p: Vector3<f64>) -> LonLatHeight {
        self.frame.ground_from_enu(EnuPoint { east: p.x, north: p.y, up: p.z })
    }

    fn line_of_sight(&self, at: ImagePoint) -> (Vector3<f64>, Vector3<f64>) {
        let (across, lines) = (at.sample - self.middle.sample, at.line - self.middle.line);
        let (position, target) = match self.model {
            CameraModel::Pushbroom => (self.position_at(lines * self.period_s), self.step * lines),
            CameraModel::Frame => (self.position, Vector3::zeros()),
        };
        let boresight = (target - position).normalize();
        let left = (self.left - boresight * boresight.dot(&self.left)).normalize();
        let direction = boresight + left * (across * self.per_pixel);
        match self.model {
            CameraModel::Pushbroom => (position, direction),
            CameraModel::Frame => {
                let down = left.cross(&boresight);
                let down = down * down.dot(&self.step).signum();
                (position, direction + down * (lines * self.per_pixel))
            }
        }
    }

    fn position_at(&self, t_s: f64) -> Vector3<f64> {
        let arm = self.position - self.centre_of_orbit;
        let (sin, cos) = (self.rate * t_s).sin_cos();
        let on_orbit = self.centre_of_orbit + arm * cos + self.tangent * (arm.norm() * sin);
        on_orbit - self.earth_turn.cross(&arm) * t_s
    }

    /// Fits an RPC to this camera over its image and a range of heights (low, high), metres above
    /// the ellipsoid.
    ///
    /// # Errors
    /// The fit fails, which does not happen for usual lines of sight.
    pub(crate) fn fitted(&self, (low_m, high_m): (f64, f64)) -> Result<FittedCamera, SimulateError> {
        let rpc = RpcFit::to_correspondences(&self.lattice(LATTICE, (low_m, high_m)))?.rpc;
        let mut max_px: f64 = 0.0;
        // Check points lie between the fit positions and leave out the corners of the margin.
        for c in self.lattice(LATTICE.map(|n| n + 1), (low_m, high_m)) {
            let p = rpc.project(c.ground)?;
            max_px = max_px.max((p.sample - c.image.sample).hypot(p.line - c.image.line));
        }
        Ok(FittedCamera { rpc, max_px })
    }

    fn lattice(&self, [samples, lines, heights]: [usize; 3], (low_m, high_m): (f64, f64)) -> Vec<Correspondence> {
        let reach = |middle: f64, k: usize, n: usize| {
            middle * (1.0 + (1.0 + 2.0 * FIT_MARGIN) * (2.0 * k as f64 / (n - 1) as f64 - 1.0))
        };
        let point = |k: usize| {
            let sample = reach(self.middle.sample, k % samples, samples);
            let line = reach(self.middle.line, k / samples % lines, lines);
            let height = low_m + (high_m - low_m) * (k / (samples * lines)) as f64 / (heights - 1) as f64;
            let image = ImagePoint::new(sample, line);
            Correspondence { ground: self.localize(image, height), image }
        };
        (0..samples * lines * heights).map(point).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{CENTRE, look};

    #[test]
    fn the_line_of_sight_has_the_asked_incidence_and_azimuth() {
        for camera in [CameraModel::Pushbroom, CameraModel::Frame] {
            for (incidence, azimuth) in [(17.0, 10.0), (6.0, 100.0), (25.0, 280.0), (40.0, 190.0)] {
                let camera = PhysicalCamera::new(camera, &look(incidence, azimuth), CENTRE, (701, 681));
                let (origin, direction) = camera.line_of_sight(ImagePoint::new(350.0, 340.0));
                let to_sensor = look(incidence, azimuth).towards_sensor();
                assert!((direction + to_sensor).norm() < 1e-12);
                assert!(((origin - camera.centre_of_orbit).norm() - EARTH_M - ORBIT_M).abs() < 1e-3);
                let centre = camera.localize(ImagePoint::new(350.0, 340.0), 200.0);
                assert!((centre.lon_deg - CENTRE.lon_deg).abs() < 1e-11, "{centre:?}");
                assert!((centre.lat_deg - CENTRE.lat_deg).abs() < 1e-11 && (centre.height_m - 200.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn pixels_have_the_asked_size_and_north_is_up() {
        for model in [CameraModel::Pushbroom, CameraModel::Frame] {
            let camera = PhysicalCamera::new(model, &look(0.0, 0.0), CENTRE, (701, 701));
            let at = |sample: f64, line: f64| {
                let p = EnuFrame::new(CENTRE).enu_from_ground(camera.localize(ImagePoint::new(sample, line), 200.0));
                Vector3::new(p.east, p.north, 0.0)
            };
            let (centre, right, below) = (at(350.0, 350.0), at(450.0, 350.0), at(350.0, 450.0));
            assert!(right.x > centre.x + 40.0 && below.y < centre.y - 40.0);
            for step in [right - centre, below - centre] {
                assert!((step.norm() - 50.0).abs() < 0.01, "{model:?}: 100 pixels are {} m", step.norm());
            }
        }
    }

    #[test]
    fn an_rpc_holds_the_camera_to_a_thousandth_of_a_pixel() {
        for model in [CameraModel::Pushbroom, CameraModel::Frame] {
            for (incidence, azimuth, size) in [(16.5, 10.0, 700), (3.0, 100.0, 700), (40.0, 300.0, 2000)] {
                let camera = PhysicalCamera::new(model, &look(incidence, azimuth), CENTRE, (size, size));
                let fitted = camera.fitted((150.0, 400.0)).unwrap();
                assert!(fitted.max_px < 1e-3, "{model:?} at {incidence}°: {} px", fitted.max_px);
            }
        }
    }

    #[test]
    fn the_orbit_moves_the_pushbroom_while_it_scans() {
        let camera = PhysicalCamera::new(CameraModel::Pushbroom, &look(10.0, 10.0), CENTRE, (701, 701));
        let flown = camera.position_at(700.0 * camera.period_s) - camera.position;
        // The sensor flies about a tenth farther than the 350 m of ground that it scans, because
        // its circle is wider.
        assert!((350.0..420.0).contains(&flown.norm()), "{}", flown.norm());
        assert!(flown.y < 0.0);
    }

    /// Compares two derivations of a pushbroom: rays followed to the curved Earth, and the planes
    /// of a linear camera.
    #[test]
    fn over_a_small_scene_the_pushbroom_is_the_linear_one() {
        let camera = PhysicalCamera::new(CameraModel::Pushbroom, &look(18.0, 40.0), CENTRE, (601, 601));
        let linear = look(18.0, 40.0).rpc(CENTRE, 601, 601);
        for (sample, line, height_m) in
            [(0.0, 0.0, 200.0), (600.0, 0.0, 240.0), (80.0, 590.0, 180.0), (410.0, 33.0, 260.0)]
        {
            let p = linear.project(camera.localize(ImagePoint::new(sample, line), height_m)).unwrap();
            assert!((p.sample - sample).hypot(p.line - line) < 0.1, "{p:?} for {sample}, {line}");
        }
    }
}
