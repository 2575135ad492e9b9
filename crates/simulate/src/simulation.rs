//! A whole simulated acquisition: the scene, its views on one date or several, and the truth.
//!
//! Images are rendered through a physical camera. Each view's RPC is fitted to that camera and then made to point wrong by a
//! planted translation and drift, as unadjusted RPCs do.

use camera::{ImageCorrection, Rpc, RpcCamera};
use raster::Grid;
use serde::{Deserialize, Serialize};

use crate::acquisition;
use crate::camera_model::Look;
use crate::clouds::{self, CLOUD_RADIANCE};
use crate::config::SimulationConfig;
use crate::date::Date;
use crate::error::SimulateError;
use crate::frame::SceneFrame;
use crate::random::derived;
use crate::render::{BAND, LitScene};
use crate::scene::Scene;
use crate::sensor::{PointSpread, Sensor};
use crate::sight::SightLines;
use crate::texture::Texture;
use crate::truth::{self, Truth, Witness};
use numeric::{Progress, Silent};

/// Scene beyond the area, metres, so that its edge sees houses and shadows as its middle does.
const SURROUNDINGS_M: f64 = 60.0;
/// Heights above and below the scene for which the RPC is fitted too, metres.
const RPC_HEIGHT_MARGIN_M: f64 = 50.0;
/// The height of ordinary houses with their chimneys, and of trees, metres.
const ORDINARY_M: f64 = 30.0;

/// One simulated image.
#[derive(Debug, Clone)]
pub struct SimulatedView {
    /// Digital numbers; 0 is no-data.
    pub image: Grid<u16>,
    /// The RPC that a user gets: the true one with the pointing error.
    pub rpc: Rpc,
    /// The RPC of the camera through which the image was rendered.
    pub true_rpc: Rpc,
    /// Height, metres above the ellipsoid, of what the centre of each pixel sees behind the clouds; NaN where that is
    /// nothing.
    pub heights: Grid<f32>,
    /// 1 where clouds hide the scene, else 0; `None` under a clear sky.
    pub clouds: Option<Grid<u8>>,
    /// How it was taken.
    pub record: ViewRecord,
    sight: SightLines,
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
    /// Largest distance between the true RPC and the physical camera, pixels.
    pub rpc_fit_error_px: f64,
}

/// Views and truth.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The configuration that made it.
    pub config: SimulationConfig,
    /// The permanent surface: without vehicles.
    pub scene: Scene,
    /// Where the surface lies.
    pub frame: SceneFrame,
    /// The images.
    pub views: Vec<SimulatedView>,
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
    /// Lowest and highest point of the permanent scene, its surroundings included, metres above the ellipsoid.
    pub height_range_m: [f64; 2],
    /// Number of buildings, surroundings included.
    pub buildings: usize,
    /// Number of trees, surroundings included.
    pub trees: usize,
    /// The views in order.
    pub views: Vec<ViewRecord>,
}

impl Simulation {
    /// Builds the scene, renders the views and samples the truth.
    ///
    /// # Errors
    /// A configuration out of range, or a place that cannot be mapped.
    pub fn new(config: SimulationConfig) -> Result<Self, SimulateError> {
        Self::with_progress(config, &Silent)
    }

    /// [`Self::new`], which says how far it is.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn with_progress(config: SimulationConfig, progress: &dyn Progress) -> Result<Self, SimulateError> {
        config.validate()?;
        progress.begin("scene", 1);
        let frame = SceneFrame::new(config.lon_deg, config.lat_deg, config.gsd_m)?;
        let scene = Scene::new(&config, reach_m(&config));
        let dates: Vec<Scene> = (0..config.acquisition.dates).map(|date| scene.on_date(&config, date)).collect();
        progress.step();
        let mut views = Vec::new();
        for index in 0..config.views {
            let date = acquisition::date(&config, index);
            views.push(view(&config, &frame, &dates[date.index], date, index, progress)?);
        }
        progress.begin("truth", 1);
        let witnesses: Vec<_> =
            views.iter().map(|view: &SimulatedView| Witness::new(&dates[view.record.date.index], view)).collect();
        let truth = Truth::new(&config, &frame, &scene, &witnesses)?;
        progress.step();
        Ok(Self { config, scene, frame, views, truth })
    }

    /// The record of what was made.
    pub fn record(&self) -> SceneRecord {
        let (low, high) = self.scene.height_range_m();
        SceneRecord {
            config: self.config.clone(),
            epsg: self.frame.epsg(),
            origin_m: self.frame.origin_m(),
            height_range_m: [low, high],
            buildings: self.scene.buildings().len(),
            trees: self.scene.tree_count(),
            views: self.views.iter().map(|view| view.record.clone()).collect(),
        }
    }
}

impl SimulatedView {
    /// The lines of sight through which the image was rendered, in the scene frame.
    pub fn sight(&self) -> &SightLines {
        &self.sight
    }
}

impl<'a> Witness<'a> {
    fn new(scene: &'a Scene, view: &'a SimulatedView) -> Self {
        Self { scene, sight: &view.sight, rpc: &view.true_rpc, size: (view.image.width(), view.image.height()) }
    }
}

/// How far from the centre the scene is built: the area, its surroundings, and what a slanted view sees beyond them.
fn reach_m(config: &SimulationConfig) -> f64 {
    let steepest = (0..config.views).map(|i| acquisition::look(config, i).incidence_deg).fold(0.0, f64::max);
    let towers = match config.buildings.quarters.high_rise > 0.0 {
        true => config.buildings.high_rise_height_m[1],
        false => 0.0,
    };
    let built = towers.max(config.buildings.landmark_height_m).max(ORDINARY_M);
    let ground = 2.0 * config.terrain.relief_m / (1.0 - config.terrain.roughness) + config.terrain.pit_depth_m;
    config.size_m / 2.0 + SURROUNDINGS_M + (built + ground) * steepest.to_radians().tan()
}

fn view(
    config: &SimulationConfig,
    frame: &SceneFrame,
    scene: &Scene,
    date: Date,
    index: usize,
    progress: &dyn Progress,
) -> Result<SimulatedView, SimulateError> {
    let look = acquisition::look(config, index);
    let (low, high) = scene.height_range_m();
    let (camera, size) = acquisition::camera(config, frame, &look, (low, high))?;
    let fitted = camera.fitted((low - RPC_HEIGHT_MARGIN_M, high + RPC_HEIGHT_MARGIN_M))?;
    let sight = SightLines::new(&camera, frame, size, (low - 1.0, high + 1.0))?;
    progress.begin(&format!("view {}", index + 1), size.1.div_ceil(BAND));
    let texture = Texture::new(config.seed, 1 + index as u64, config.surface);
    let spread = PointSpread::new(&config.sensor);
    let radiance = LitScene::new(scene, texture, &date.sun).image(&sight, &spread, size, progress);
    let sensor = Sensor::new(&config.sensor, &date);
    let opacity = clouds::opacity(&config.clouds, derived(config.seed, 4000 + index as u64), config.gsd_m, size);
    let image = digital(&radiance, opacity.as_ref(), &sensor, config, derived(config.seed, 2000 + index as u64));
    let pointing = acquisition::pointing(config, index, size);
    let rpc = RpcCamera { rpc: fitted.rpc.clone(), correction: pointing }.folded()?.rpc;
    let record = ViewRecord {
        look,
        date,
        sensor,
        pointing_error_px: pointing.translation_px,
        pointing,
        rpc_fit_error_px: fitted.max_px,
    };
    let clouds = opacity.map(|cover| cover.map(|o| u8::from(*o > 0.0)));
    let heights = truth::image_heights(scene, &sight, size);
    Ok(SimulatedView { image, rpc, true_rpc: fitted.rpc, heights, clouds, record, sight })
}

/// The digital numbers of a view; `seed` is that of the noise.
fn digital(
    radiance: &Grid<f32>,
    opacity: Option<&Grid<f32>>,
    sensor: &Sensor,
    config: &SimulationConfig,
    seed: u64,
) -> Grid<u16> {
    let width = radiance.width();
    let mut image = Grid::filled(width, radiance.height(), 0u16);
    for (index, (number, clear)) in image.data_mut().iter_mut().zip(radiance.data()).enumerate() {
        let hidden = opacity.map_or(0.0, |cover| cover.data()[index]);
        if hidden == 0.0 || !config.clouds.masked {
            let seen = clear + hidden * (CLOUD_RADIANCE - clear);
            *number = sensor.quantise(f64::from(seen), seed, index % width, index / width);
        }
    }
    image
}
