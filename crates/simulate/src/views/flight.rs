//! Perspective cameras around a scene, as a drone would fly them, for priors and splats of its
//! buildings: where they stand, what they see, and the points that a reconstruction would find.
//!
//! Cameras stand on a circle around the middle of the scene, or on an arc of it, and look at it.
//! Every second one is nearer and steeper. Poses are in the map of the scene: easting, northing,
//! metres above the ellipsoid. The scene is the permanent one, without vehicles, under the sun of
//! the first date, so that the surface that the images show is exactly that of the truth.

use camera::{ImagePoint, Lens, LensError, LensModel, Pose};
use nalgebra::{Matrix3, Vector3};
use numeric::{Progress, SplitMix64};
use raster::Grid;
use rayon::prelude::*;

use crate::config::SensorConfig;
use crate::random::derived;
use crate::surface::scene::{Material, Part};
use crate::surface::texture::Texture;
use crate::views::render::{BAND, LitScene, Rays};
use crate::views::sensor::{BOX_AT_NYQUIST, PointSpread};
use crate::{SceneRay, Simulation};

/// Columns and rows of an image.
const SIZE: [usize; 2] = [640, 480];
const FOCAL_PX: f64 = 560.0;
/// Distance from the middle and height above the ground, as shares of the side of the scene.
/// Cameras alternate.
const STANDS: [[f64; 2]; 2] = [[0.75, 0.55], [0.35, 0.75]];
/// Samples along each side of a pixel.
const SUBPIXELS: usize = 2;
/// Exponent from radiance to grey values, as in the pictures of cameras.
const GAMMA: f64 = 1.0 / 2.2;
/// Places of each image at which a point is tried.
const TRIED_POINTS: usize = 1000;
/// Least number of images of a point.
const LEAST_IMAGES: usize = 3;
/// Standard deviation of the place of a point in an image, pixels.
const POINT_NOISE_PX: f64 = 0.5;
/// Depth at which rays end, metres: beyond every scene.
const FAR_M: f64 = 1e5;
/// A point is seen where a ray towards it ends within this distance of it, metres.
const SEEN_M: f64 = 0.01;

/// Cameras around a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// The lens of all cameras.
    pub lens: Lens,
    /// Where the cameras stand, on the map.
    pub poses: Vec<Pose>,
}

/// A point that several cameras of a flight see, as a reconstruction from their images finds it.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightPoint {
    /// Position on the map, with the error of the places in the images.
    pub position: [f64; 3],
    /// Grey value in the first image.
    pub grey: u8,
    /// Mean distance of the point from its places in the images, pixels.
    pub error_px: f64,
    /// Cameras that see the point, and its places in their images.
    pub seen: Vec<(usize, ImagePoint)>,
}

/// A point of the exact surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactPoint {
    /// Position on the map.
    pub position: [f64; 3],
    /// Unit normal to the outside.
    pub normal: [f64; 3],
    /// Whether it belongs to a building.
    pub on_building: bool,
}

impl Simulation {
    /// Makes `count` cameras with one lens around the scene: counter-clockwise from the east, or
    /// from one to the other end of an arc of azimuths (degrees clockwise from north), ends
    /// included.
    ///
    /// # Errors
    /// None occurs for the lens that is used. The type is the one of [`Lens::new`].
    pub fn flight(&self, count: usize, arc_deg: Option<[f64; 2]>) -> Result<Flight, LensError> {
        let middle = [0, 1].map(|i| (SIZE[i] as f64 - 1.0) / 2.0);
        let lens = Lens::new(SIZE[0], SIZE[1], LensModel::Pinhole, &[FOCAL_PX, FOCAL_PX, middle[0], middle[1]])?;
        let [east, north] = self.frame.origin_m();
        let target = [east, north, self.scene.terrain().height(0.0, 0.0)];
        let pose = |number: usize| {
            let [distance, height] = STANDS[number % 2].map(|part| part * self.config.size_m);
            let (north, east) = direction(number, count, arc_deg).sin_cos();
            looking(target, [distance * east, distance * north, height])
        };
        Ok(Flight { lens, poses: (0..count).map(pose).collect() })
    }

    /// Returns the picture of a camera: grey values, brighter in shadows than the radiance is, as
    /// in the pictures of cameras.
    pub fn flight_picture(&self, lens: &Lens, pose: &Pose, progress: &dyn Progress) -> Grid<u8> {
        let date = crate::views::acquisition::date(&self.config, 0);
        // Pixels are plain squares.
        let sensor = SensorConfig { mtf_at_nyquist: BOX_AT_NYQUIST, subpixels: SUBPIXELS, ..self.config.sensor };
        let texture = Texture::new(self.config.seed, 0, self.config.surface);
        let size = (lens.width(), lens.height());
        let rays = self.pinhole(lens, pose);
        let radiance =
            LitScene::new(&self.scene, texture, &date.sun).image(&rays, &PointSpread::new(&sensor), size, progress);
        radiance.map(|value| grey(f64::from(*value)))
    }

    /// Returns the number of steps that [`Self::flight_picture`] reports.
    pub fn flight_picture_steps(lens: &Lens) -> usize {
        lens.height().div_ceil(BAND)
    }

    /// Returns the points that a reconstruction of the flight would begin with: random places of
    /// the images that at least three cameras see, triangulated from places with an error of half a
    /// pixel.
    pub fn flight_points(&self, flight: &Flight) -> Vec<FlightPoint> {
        let one = |number: usize| self.flight_point(flight, number / TRIED_POINTS, number as u64);
        (0..flight.poses.len() * TRIED_POINTS).into_par_iter().filter_map(one).collect()
    }

    fn flight_point(&self, flight: &Flight, first: usize, number: u64) -> Option<FlightPoint> {
        let mut random = SplitMix64::new(derived(derived(self.config.seed, 6000), number));
        let lens = &flight.lens;
        let sizes = [lens.width() as f64, lens.height() as f64];
        let at = sizes.map(|size| random.uniform_in(0.0, size - 1.0));
        let cameras: Vec<Pinhole> = flight.poses.iter().map(|pose| self.pinhole(lens, pose)).collect();
        let ray = cameras[first].ray(ImagePoint::new(at[0], at[1]));
        let hit = self.scene.first_hit(&ray, FAR_M)?;
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let mut seen = Vec::new();
        for (camera, pinhole) in cameras.iter().enumerate() {
            let Some(at) = pinhole.pixel(hit.point).filter(|at| within(*at, sizes)) else { continue };
            let met = self.scene.first_point(&pinhole.ray(at), FAR_M);
            if !met.is_some_and(|met| (met - hit.point).norm() < SEEN_M) {
                continue;
            }
            let mut moved = || POINT_NOISE_PX * random.normal();
            let at = ImagePoint::new(at.sample + moved(), at.line + moved());
            // The point with the least sum of squared distances from all rays.
            let along = pinhole.ray(at).direction.normalize();
            let across = Matrix3::identity() - along * along.transpose();
            normal += across;
            right += across * pinhole.centre;
            seen.push((camera, at));
        }
        if seen.len() < LEAST_IMAGES {
            return None;
        }
        let point = normal.lu().solve(&right)?;
        let distance = |(camera, at): &(usize, ImagePoint)| {
            cameras[*camera].pixel(point).map_or(0.0, |p| (p.sample - at.sample).hypot(p.line - at.line))
        };
        let error_px = seen.iter().map(distance).sum::<f64>() / seen.len() as f64;
        let date = crate::views::acquisition::date(&self.config, 0);
        let texture = Texture::new(self.config.seed, 0, self.config.surface);
        let radiance = LitScene::new(&self.scene, texture, &date.sun).radiance(&ray, FAR_M);
        Some(FlightPoint { position: self.on_map(point), grey: grey(radiance), error_px, seen })
    }

    /// Returns the exact surface where at least one camera of the flight sees it: one point in each
    /// cube of `spacing_m`, in the order of the cameras and pixels.
    pub fn flight_surface(&self, flight: &Flight, spacing_m: f64) -> Vec<ExactPoint> {
        let (width, height) = (flight.lens.width(), flight.lens.height());
        let mut taken = std::collections::HashSet::new();
        let mut points = Vec::new();
        for pose in &flight.poses {
            let camera = self.pinhole(&flight.lens, pose);
            let hit = |pixel: usize| {
                let at = ImagePoint::new((pixel % width) as f64, (pixel / width) as f64);
                self.scene.first_hit(&camera.ray(at), FAR_M)
            };
            let hits: Vec<_> = (0..width * height).into_par_iter().map(hit).collect();
            for hit in hits.into_iter().flatten() {
                let cube: [i64; 3] = hit.point.map(|c| (c / spacing_m).floor() as i64).into();
                if taken.insert(cube) {
                    let on_building = match hit.part {
                        Part::Prism(index, _) => {
                            matches!(self.scene.solid(index).material, Material::Building | Material::BlankRoof)
                        }
                        Part::Ground | Part::Crown(_) => false,
                    };
                    let position = self.on_map(hit.point);
                    points.push(ExactPoint { position, normal: hit.normal.into(), on_building });
                }
            }
        }
        points
    }

    fn pinhole(&self, lens: &Lens, pose: &Pose) -> Pinhole {
        let [east, north] = self.frame.origin_m();
        let [x, y, z] = pose.centre;
        Pinhole {
            centre: Vector3::new(x - east, y - north, z),
            axes: pose.rotation.map(Vector3::from),
            focal_px: lens.focal_px(),
            principal: lens.principal_point(),
        }
    }

    fn on_map(&self, point: Vector3<f64>) -> [f64; 3] {
        let [east, north] = self.frame.origin_m();
        [point.x + east, point.y + north, point.z]
    }
}

/// A camera in the frame of the scene.
#[derive(Debug, Clone, Copy)]
struct Pinhole {
    centre: Vector3<f64>,
    /// To the right, down and forward.
    axes: [Vector3<f64>; 3],
    focal_px: [f64; 2],
    principal: ImagePoint,
}

impl Pinhole {
    /// Returns the pixel of a point in front of the camera.
    fn pixel(&self, point: Vector3<f64>) -> Option<ImagePoint> {
        let [x, y, z] = self.axes.map(|axis| axis.dot(&(point - self.centre)));
        let [fx, fy] = self.focal_px;
        (z > 0.0).then(|| ImagePoint::new(self.principal.sample + fx * x / z, self.principal.line + fy * y / z))
    }
}

impl Rays for Pinhole {
    /// The parameter of the ray is the depth along the optical axis, metres.
    fn ray(&self, at: ImagePoint) -> SceneRay {
        let [right, down, forward] = self.axes;
        let (x, y) = (at.sample - self.principal.sample, at.line - self.principal.line);
        let direction = right * (x / self.focal_px[0]) + down * (y / self.focal_px[1]) + forward;
        SceneRay { origin: self.centre, direction }
    }

    fn end(&self) -> f64 {
        FAR_M
    }
}

fn within(at: ImagePoint, [width, height]: [f64; 2]) -> bool {
    (0.0..=width - 1.0).contains(&at.sample) && (0.0..=height - 1.0).contains(&at.line)
}

fn grey(radiance: f64) -> u8 {
    (255.0 * radiance.clamp(0.0, 1.0).powf(GAMMA)).round() as u8
}

/// Returns the direction of a camera from the middle: the angle from the east, counter-clockwise,
/// radians.
fn direction(number: usize, count: usize, arc_deg: Option<[f64; 2]>) -> f64 {
    let Some([from, to]) = arc_deg else { return std::f64::consts::TAU * number as f64 / count as f64 };
    let width = if to >= from { to - from } else { to - from + 360.0 };
    let azimuth = from + width * number as f64 / (count.max(2) - 1) as f64;
    (90.0 - azimuth).to_radians()
}

/// Makes an upright camera at an offset from its target. The offset must not be vertical.
fn looking(target: [f64; 3], offset: [f64; 3]) -> Pose {
    let length = offset.iter().map(|c| c * c).sum::<f64>().sqrt();
    let forward = offset.map(|c| -c / length);
    let level = forward[0].hypot(forward[1]);
    let right = [forward[1] / level, -forward[0] / level, 0.0];
    let down = [-forward[2] * right[1], forward[2] * right[0], -level];
    Pose { rotation: [right, down, forward], centre: [0, 1, 2].map(|i| target[i] + offset[i]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SimulationConfig;

    #[test]
    fn a_camera_is_upright_and_looks_at_its_target() {
        for offset in [[30.0, 0.0, 40.0], [-3.0, 7.0, 1.0], [1e-3, 0.0, 9.0]] {
            let target = [690_000.0, 5_336_000.0, 510.0];
            let pose = looking(target, offset);
            let [right, down, forward] = pose.rotation;
            let cross = [0, 1, 2].map(|i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                right[j] * down[k] - right[k] * down[j]
            });
            assert!((0..3).all(|i| (cross[i] - forward[i]).abs() < 1e-12), "{offset:?}");
            assert!(down[2] < 0.0 && right[2] == 0.0);
            let [x, y, z] = pose.camera_from_world(target);
            assert!(
                x.abs() < 1e-6 && y.abs() < 1e-6 && (z - offset.iter().map(|c| c * c).sum::<f64>().sqrt()).abs() < 1e-6
            );
        }
    }

    #[test]
    fn an_arc_is_flown_from_end_to_end() {
        let azimuth = |number, count, arc| 90.0 - direction(number, count, Some(arc)).to_degrees();
        for (number, expected) in [(0, 135.0), (2, 180.0), (4, 225.0)] {
            assert!((azimuth(number, 5, [135.0, 225.0]) - expected).abs() < 1e-9);
        }
        // Through north.
        assert!((azimuth(1, 3, [330.0, 30.0]) - 360.0).abs() < 1e-9);
        assert!((azimuth(0, 1, [330.0, 30.0]) - 330.0).abs() < 1e-9);
    }

    #[test]
    fn points_lie_on_the_surface_and_where_their_images_say() {
        let mut config = SimulationConfig::preset("town").unwrap();
        (config.size_m, config.gsd_m, config.views) = (60.0, 2.0, 2);
        let simulation = Simulation::new(config).unwrap();
        let flight = simulation.flight(6, None).unwrap();
        let surface = simulation.flight_surface(&flight, 1.0);
        assert!(surface.len() > 2000 && surface.iter().any(|p| p.on_building), "{}", surface.len());
        let [east, north] = simulation.frame.origin_m();
        for point in &surface {
            let [x, y, z] = point.position;
            let out = [0, 1].map(|i| 1e-3 * point.normal[i]);
            let height = simulation.scene.surface(x - east - out[0], y - north - out[1]).0;
            assert!(z < height + 0.02 && (point.normal.iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-9);
        }
        let points = simulation.flight_points(&flight);
        assert!(points.len() > 1000, "{}", points.len());
        let mean_px = points.iter().map(|p| p.error_px).sum::<f64>() / points.len() as f64;
        assert!((0.2..0.7).contains(&mean_px), "{mean_px}");
    }
}
