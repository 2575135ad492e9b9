//! A whole simulated acquisition: the scene, its views on one date or several, and the truth.
//!
//! Images are rendered through a physical camera. The RPC of each view is fitted to that camera and
//! then given a known translation and drift, as unadjusted RPCs have.

use camera::{ImageCorrection, Rpc, RpcCamera};
use raster::Grid;
use serde::{Deserialize, Serialize};

use crate::config::{SensorConfig, SimulationConfig};
use crate::error::SimulateError;
use crate::random::derived;
use crate::surface::frame::SceneFrame;
use crate::surface::scene::Scene;
use crate::surface::texture::Texture;
use crate::truth::{self, Truth, Witness};
use crate::views::acquisition;
use crate::views::camera_model::Look;
use crate::views::clouds::{self, CLOUD_RADIANCE};
use crate::views::date::Date;
use crate::views::render::{BAND, LitScene};
use crate::views::seasons::SeasonLook;
use crate::views::sensor::{PointSpread, Sensor};
use crate::views::sight::SightLines;
use crate::views::spectral_image::{SpectralCamera, SpectralImage};
use crate::views::spectrum::Spectrum;
use numeric::{Progress, Silent};

/// Width of the scene beyond the area, metres, so that houses and shadows surround its edge too.
const SURROUNDINGS_M: f64 = 60.0;
/// Margin above and below the scene over which the RPC is fitted too, metres.
const RPC_HEIGHT_MARGIN_M: f64 = 50.0;
/// The height of ordinary houses with their chimneys, and of trees, metres.
const ORDINARY_M: f64 = 30.0;

/// One simulated image.
#[derive(Debug, Clone)]
pub struct SimulatedView {
    /// Digital numbers. 0 is no-data.
    pub image: Grid<u16>,
    /// The delivered RPC: the true one with the pointing error.
    pub rpc: Rpc,
    /// The RPC of the camera through which the image was rendered.
    pub true_rpc: Rpc,
    /// Height of the surface at the centre of each pixel, behind clouds too, metres above the
    /// ellipsoid. NaN where the pixel sees no surface.
    pub heights: Grid<f32>,
    /// 1 where clouds hide the scene, else 0. `None` without clouds.
    pub clouds: Option<Grid<u8>>,
    /// The multispectral image, where the configuration asks for one.
    pub multispectral: Option<SpectralImage>,
    /// How the view was taken.
    pub record: ViewRecord,
    sight: SightLines,
}

/// How a view was taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewRecord {
    /// Line of sight.
    pub look: Look,
    /// Date.
    pub date: Date,
    /// Radiometry.
    pub sensor: Sensor,
    /// Pointing error of the delivered RPC in the middle of the image, pixels (sample, line).
    pub pointing_error_px: [f64; 2],
    /// Pointing error at every position: `delivered = pointing(true)`.
    pub pointing: ImageCorrection,
    /// Largest distance between the true RPC and the physical camera, pixels.
    pub rpc_fit_error_px: f64,
}

/// Views and truth.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The configuration.
    pub config: SimulationConfig,
    /// The permanent scene, without vehicles.
    pub scene: Scene,
    /// The place of the scene.
    pub frame: SceneFrame,
    /// The images.
    pub views: Vec<SimulatedView>,
    /// The truth.
    pub truth: Truth,
}

/// The parameters and properties of a simulation, written beside its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneRecord {
    /// The configuration.
    pub config: SimulationConfig,
    /// EPSG code of the map.
    pub epsg: u32,
    /// Map coordinates of the scene's origin, metres.
    pub origin_m: [f64; 2],
    /// Lowest and highest point of the permanent scene, its surroundings included, metres above the
    /// ellipsoid.
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
    /// A configuration out of range, or a place where no map projection is defined.
    pub fn new(config: SimulationConfig) -> Result<Self, SimulateError> {
        Self::with_progress(config, &Silent)
    }

    /// Does the same as [`Self::new`] and reports its progress.
    ///
    /// # Errors
    /// The same as for [`Self::new`].
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

    /// Returns the parameters and properties of the simulation.
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
    /// Returns the lines of sight through which the image was rendered, in the scene frame.
    pub fn sight(&self) -> &SightLines {
        &self.sight
    }
}

impl<'a> Witness<'a> {
    fn new(scene: &'a Scene, view: &'a SimulatedView) -> Self {
        Self { scene, sight: &view.sight, rpc: &view.true_rpc, size: (view.image.width(), view.image.height()) }
    }
}

/// Returns the distance from the centre to which the scene is built: the area, its surroundings,
/// and the part beyond them that slanted views see.
fn reach_m(config: &SimulationConfig) -> f64 {
    let steepest = (0..config.views).map(|i| acquisition::look(config, i).incidence_deg).fold(0.0, f64::max);
    let towers = match config.buildings.quarters.high_rise + config.buildings.quarters.dense_towers > 0.0 {
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
    let look_of_date = SeasonLook::new(&config.seasons, config.seed, date.index, date.season);
    let texture = Texture::new(config.seed, 1 + index as u64, config.surface).on_date(look_of_date);
    let mtf_at_nyquist = date.season.map_or(config.sensor.mtf_at_nyquist, |season| season.mtf_at_nyquist);
    let spread = PointSpread::new(&SensorConfig { mtf_at_nyquist, ..config.sensor });
    let lit = LitScene::new(scene, texture, &date.sun);
    let radiance = lit.image(&sight, &spread, size, progress);
    let sensor = Sensor::new(&config.sensor, &date);
    let opacity =
        clouds::opacity(&config.clouds, derived(config.campaign_seed(), 4000 + index as u64), config.gsd_m, size);
    let image =
        digital(&radiance, opacity.as_ref(), &sensor, config, derived(config.campaign_seed(), 2000 + index as u64));
    let pointing = acquisition::pointing(config, index, size);
    let rpc = RpcCamera { rpc: fitted.rpc.clone(), correction: pointing }.folded()?.rpc;
    let multispectral = config.multispectral.as_ref().map(|of| {
        let camera = SpectralCamera {
            config: of,
            optics: SensorConfig { mtf_at_nyquist, ..config.sensor },
            sensor: &sensor,
            clouds: &config.clouds,
            sight: &sight,
            size,
            seed: derived(config.campaign_seed(), 7000 + index as u64),
        };
        progress.begin(&format!("multispectral view {}", index + 1), camera.rows().div_ceil(BAND));
        let spectrum = Spectrum::new(config.seed, config.surface.cover, *of);
        camera.image(&lit, &spectrum, &rpc, opacity.as_ref(), progress)
    });
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
    Ok(SimulatedView { image, rpc, true_rpc: fitted.rpc, heights, clouds, multispectral, record, sight })
}

/// Returns the digital numbers of a view. `seed` is the seed of the noise.
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
