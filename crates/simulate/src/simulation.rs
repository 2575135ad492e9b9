//! A whole simulated acquisition: the town, its views in one pass of one sensor, and the truth.
//!
//! The views come seconds apart, so light and town are the same in all of them. Each view's RPC carries a planted pointing
//! error of 1 to 3 pixels (a translation), as unadjusted RPCs do; the images are rendered through the true cameras.

use camera::{ImageCorrection, ImagePoint, Rpc, RpcCamera};
use nalgebra::Vector3;
use raster::{GeoTransform, Grid};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::block::Block;
use crate::config::{SimulationConfig, ViewDirection};
use crate::date::Date;
use crate::error::SimulateError;
use crate::frame::SceneFrame;
use crate::pushbroom::Look;
use crate::random::{Stream, derived};
use crate::render::LitScene;
use crate::scene::Scene;
use crate::sensor::Sensor;
use crate::sight::Sight;
use crate::texture::Texture;
use crate::town;

/// Pixels around the area of the truth, for what leans out of it and for the pointing error.
const MARGIN_PX: f64 = 12.0;
/// Town beyond the area, metres, so that its edge sees houses and shadows as its middle does.
const SURROUNDINGS_M: f64 = 60.0;

/// One simulated image.
#[derive(Debug, Clone)]
pub struct View {
    /// Digital numbers, 11 bits.
    pub image: Grid<u16>,
    /// The RPC that a user gets: the true one with the pointing error.
    pub rpc: Rpc,
    /// The RPC of the camera through which the image was rendered.
    pub true_rpc: Rpc,
    /// How it was taken.
    pub record: ViewRecord,
}

/// How a view was taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewRecord {
    /// Geometry.
    pub look: Look,
    /// When it was taken.
    pub date: Date,
    /// Radiometry.
    pub sensor: Sensor,
    /// What the given RPC projects too far in the middle of the image, pixels (sample, line).
    pub pointing_error_px: [f64; 2],
    /// The same everywhere: `given = pointing(true)`.
    pub pointing: ImageCorrection,
}

/// The surface as rasters.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Height of the upper surface at the cell centres, metres above the ellipsoid.
    pub dsm: Grid<f32>,
    /// Class of the upper surface at the cell centres (see [`crate::SurfaceClass`]).
    pub classes: Grid<u8>,
    /// Where the cells lie on the map.
    pub geotransform: GeoTransform,
    /// EPSG code of the map.
    pub epsg: u32,
}

/// Views and truth.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The configuration that made it.
    pub config: SimulationConfig,
    /// The surface.
    pub scene: Scene,
    /// Where the surface lies.
    pub frame: SceneFrame,
    /// The images.
    pub views: Vec<View>,
    /// The truth.
    pub truth: Truth,
}

/// All that made a simulation, for a reader of its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneRecord {
    /// The configuration.
    pub config: SimulationConfig,
    /// EPSG code of the map.
    pub epsg: u32,
    /// Map coordinates of the scene's origin, metres.
    pub origin_m: [f64; 2],
    /// The views in order.
    pub views: Vec<ViewRecord>,
    /// The blocks of the buildings, in the scene frame.
    pub blocks: Vec<Block>,
}

impl Simulation {
    /// Builds the scene, renders the views and samples the truth.
    ///
    /// # Errors
    /// A configuration out of range, or a place that cannot be mapped.
    pub fn new(config: SimulationConfig) -> Result<Self, SimulateError> {
        config.validate()?;
        let frame = SceneFrame::new(config.lon_deg, config.lat_deg, config.gsd_m)?;
        let scene = town::build(
            config.seed,
            config.size_m / 2.0 + SURROUNDINGS_M,
            config.ground_height_m,
            config.buildings.landmark_height_m,
        );
        let views = (0..config.views).map(|i| view(&config, &frame, &scene, i)).collect::<Result<_, _>>()?;
        let truth = truth(&config, &frame, &scene);
        Ok(Self { config, scene, frame, views, truth })
    }

    /// The record of what was made.
    pub fn record(&self) -> SceneRecord {
        SceneRecord {
            config: self.config.clone(),
            epsg: self.frame.epsg(),
            origin_m: self.frame.origin_m(),
            views: self.views.iter().map(|view| view.record.clone()).collect(),
            blocks: self.scene.blocks().copied().collect(),
        }
    }
}

fn view(config: &SimulationConfig, frame: &SceneFrame, scene: &Scene, index: usize) -> Result<View, SimulateError> {
    let mut stream = Stream::new(derived(config.seed, 1000 + index as u64));
    let look = look(config, index);
    let (true_rpc, size) = camera(config, frame, &look)?;
    let (low, high) = scene.height_range_m();
    let sight = Sight::new(&true_rpc, frame, size, (low - 1.0, high + 1.0))?;
    let sensor = Sensor {
        gain: stream.uniform(2300.0, 2700.0),
        offset: stream.uniform(80.0, 140.0),
        electrons_per_dn: 12.0,
        read_noise: 2.0,
    };
    let date = Date::new(config, index * config.acquisition.dates / config.views);
    let lit = LitScene::new(scene, Texture::new(config.seed), &date.sun);
    let image = lit.image(&sight, &sensor, size, derived(config.seed, 2000 + index as u64));
    let pointing = pointing(config, &mut stream, size);
    let rpc = RpcCamera { rpc: true_rpc.clone(), correction: pointing }.folded()?.rpc;
    let record = ViewRecord { look, date, sensor, pointing_error_px: pointing.translation_px, pointing };
    Ok(View { image, rpc, true_rpc, record })
}

/// What the given RPC projects too far: a translation at the middle of the image, and a drift along its lines.
fn pointing(config: &SimulationConfig, stream: &mut Stream, (width, height): (usize, usize)) -> ImageCorrection {
    let a = &config.acquisition;
    let mut vector = |length: f64| {
        let direction = stream.uniform(0.0, std::f64::consts::TAU);
        [length * direction.cos(), length * direction.sin()]
    };
    let drift = vector(a.pointing_drift_px).map(|px| px / (height as f64 - 1.0));
    let [shortest, longest] = a.pointing_error_px;
    let length = stream.uniform(shortest, longest);
    let direction = stream.uniform(0.0, std::f64::consts::TAU);
    ImageCorrection {
        translation_px: [length * direction.cos(), length * direction.sin()],
        linear: [[0.0, drift[0]], [0.0, drift[1]]],
        centre: ImagePoint::new((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0),
    }
}

/// The look of a view: as given, or one of a pass from the forward view to the backward one, weaving to both sides.
fn look(config: &SimulationConfig, index: usize) -> Look {
    let a = &config.acquisition;
    let (heading_deg, gsd_m) = (a.heading_deg, config.gsd_m);
    if let Some(ViewDirection { incidence_deg, azimuth_deg }) = a.looks.get(index).copied() {
        return Look { incidence_deg, azimuth_deg, heading_deg, gsd_m };
    }
    let along = a.along_track_deg.to_radians().tan() * (1.0 - 2.0 * index as f64 / (config.views - 1) as f64);
    let across = a.across_track_deg.to_radians().tan() * (std::f64::consts::FRAC_PI_2 * index as f64).sin();
    let incidence_deg = along.hypot(across).atan().to_degrees();
    // The first view is taken before the sensor passes: it looks ahead, and is seen from behind the heading.
    let azimuth_deg = (heading_deg + 180.0 + across.atan2(along).to_degrees()).rem_euclid(360.0);
    Look { incidence_deg, azimuth_deg, heading_deg, gsd_m }
}

/// The RPC and the size of an image that holds the whole area.
fn camera(config: &SimulationConfig, frame: &SceneFrame, look: &Look) -> Result<(Rpc, (usize, usize)), SimulateError> {
    let half = config.size_m / 2.0;
    let ground = |x, y| frame.ground_from_scene(Vector3::new(x, y, config.ground_height_m));
    let centre = ground(0.0, 0.0)?;
    // The scale of a camera does not depend on its image's size: any that holds the area measures the corners.
    let roughly = (1.5 * config.size_m / config.gsd_m) as usize;
    let measuring = look.rpc(centre, roughly, roughly);
    let mut reach = ImagePoint::default();
    for (x, y) in [(-half, -half), (half, -half), (-half, half), (half, half)] {
        let corner = measuring.project(ground(x, y)?)?;
        let (sample, line) = (corner.sample - measuring.samp_off, corner.line - measuring.line_off);
        reach = ImagePoint::new(reach.sample.max(sample.abs()), reach.line.max(line.abs()));
    }
    let pixels = |reach: f64| 2 * (reach + MARGIN_PX).ceil() as usize;
    let size = (pixels(reach.sample), pixels(reach.line));
    Ok((look.rpc(centre, size.0, size.1), size))
}

fn truth(config: &SimulationConfig, frame: &SceneFrame, scene: &Scene) -> Truth {
    let cells = (config.size_m / config.gsd_m).round() as usize;
    let half_m = (cells / 2) as f64 * config.gsd_m;
    let at = |k: usize| (k as f64 + 0.5) * config.gsd_m - half_m;
    let cell = |index: usize| scene.surface(at(index % cells), -at(index / cells));
    let surface: Vec<_> = (0..cells * cells).into_par_iter().map(cell).collect();
    let mut dsm = Grid::filled(cells, cells, 0f32);
    let mut classes = Grid::filled(cells, cells, 0u8);
    for (i, (height, class)) in surface.into_iter().enumerate() {
        dsm.data_mut()[i] = height as f32;
        classes.data_mut()[i] = class as u8;
    }
    let [x, y] = frame.origin_m();
    let geotransform = GeoTransform::north_up(x - half_m, y + half_m, config.gsd_m);
    Truth { dsm, classes, geotransform, epsg: frame.epsg() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfaceClass;

    fn small() -> SimulationConfig {
        SimulationConfig { size_m: 120.0, gsd_m: 1.0, seed: 6, ..SimulationConfig::default() }
    }

    fn in_threads(threads: usize) -> Simulation {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Simulation::new(small())).unwrap()
    }

    #[test]
    fn a_seed_gives_one_simulation_whatever_the_threads() {
        let (one, three) = (in_threads(1), in_threads(3));
        assert_eq!(one.truth.dsm, three.truth.dsm);
        for (a, b) in one.views.iter().zip(&three.views) {
            assert!(a.image == b.image && a.rpc == b.rpc);
        }
        let other = Simulation::new(SimulationConfig { seed: 7, ..small() }).unwrap();
        assert_ne!(one.truth.dsm, other.truth.dsm);
    }

    #[test]
    fn the_truth_is_the_height_function_on_the_map() {
        let simulation = Simulation::new(small()).unwrap();
        let truth = &simulation.truth;
        let [x0, y0] = simulation.frame.origin_m();
        for (column, row) in [(0, 0), (119, 119), (60, 60), (31, 88)] {
            let (x, y) = truth.geotransform.map_from_cell(column as f64, row as f64);
            let (height, class) = simulation.scene.surface(x - x0, y - y0);
            assert_eq!(truth.dsm[(column, row)], height as f32);
            assert_eq!(truth.classes[(column, row)], class as u8);
        }
        let buildings = truth.classes.data().iter().filter(|c| **c == SurfaceClass::Building as u8).count();
        assert!((1000..8000).contains(&buildings), "{buildings} of {} cells", truth.classes.data().len());
    }

    /// The lines of sight of a view's true camera.
    fn sight(simulation: &Simulation, view: &View) -> Sight {
        let (low, high) = simulation.scene.height_range_m();
        let size = (view.image.width(), view.image.height());
        Sight::new(&view.true_rpc, &simulation.frame, size, (low - 1.0, high + 1.0)).unwrap()
    }

    #[test]
    fn a_pixel_sees_the_point_that_projects_to_it_or_one_that_hides_it() {
        let simulation = Simulation::new(small()).unwrap();
        let (mut seen, mut hidden) = (0, 0);
        for view in &simulation.views {
            let (rpc, sight) = (view.true_rpc.clone(), sight(&simulation, view));
            for k in 0..400 {
                let (x, y) = (f64::from(k % 20) * 5.9 - 57.0, f64::from(k / 20) * 5.7 - 55.0);
                let point = Vector3::new(x, y, simulation.scene.surface(x, y).0);
                let at = rpc.project(simulation.frame.ground_from_scene(point).unwrap()).unwrap();
                assert!((0.0..view.image.width() as f64 - 1.0).contains(&at.sample), "{at:?}");
                assert!((0.0..view.image.height() as f64 - 1.0).contains(&at.line), "{at:?}");
                let found = simulation.scene.first_point(&sight.ray(at), 1.0).unwrap();
                if (found - point).norm() < 0.01 {
                    seen += 1;
                } else {
                    assert!(found.z > point.z, "a ray went through the surface: {found:?} under {point:?}");
                    hidden += 1;
                }
            }
        }
        assert!(seen > 1000 && hidden > 10, "{seen} seen, {hidden} hidden");
    }

    #[test]
    fn views_converge_and_every_rpc_points_a_little_wrong() {
        let simulation = Simulation::new(SimulationConfig { views: 5, ..small() }).unwrap();
        let tangent = |v: &View| v.record.look.towards_sensor() / v.record.look.towards_sensor().z;
        let base = (tangent(&simulation.views[0]) - tangent(&simulation.views[4])).norm();
        assert!((base - 2.0 * 16.5_f64.to_radians().tan()).abs() < 0.02, "base over height {base}");
        for view in &simulation.views {
            let [sample, line] = view.record.pointing_error_px;
            assert!((1.0..=3.0).contains(&sample.hypot(line)));
            assert!((view.rpc.samp_off - view.true_rpc.clone().samp_off - sample).abs() < 1e-9);
        }
    }

    #[test]
    fn images_use_their_range_without_saturating() {
        let simulation = Simulation::new(small()).unwrap();
        for view in &simulation.views {
            let mut values = view.image.data().to_vec();
            values.sort_unstable();
            let quantile = |q: f64| values[(q * (values.len() - 1) as f64) as usize];
            assert!(quantile(0.99) < crate::DN_MAX && quantile(0.95) - quantile(0.05) > 300);
        }
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        for (bad, name) in [
            (SimulationConfig { size_m: f64::NAN, ..small() }, "size"),
            (SimulationConfig { views: 1, ..small() }, "views"),
            (SimulationConfig { gsd_m: 0.0, ..small() }, "sampling"),
            (SimulationConfig { lat_deg: 95.0, ..small() }, "latitude"),
        ] {
            let error = Simulation::new(bad).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
}
