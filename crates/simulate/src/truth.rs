//! The truth as rasters on the map grid: surface, terrain, classes, buildings, visibility in each
//! view, and the view from above.
//!
//! Values belong to cell centres, and heights are rounded to a millimetre. The scene is the
//! permanent one without vehicles, like a reference that was measured on another day. A view sees a
//! cell if its ray to the point of the cell meets nothing before it, vehicles of its date included.

use camera::{ImagePoint, Rpc};
use city::CityModel;
use geodesy::LonLatHeight;
use nalgebra::Vector3;
use raster::{GeoTransform, Grid};
use rayon::prelude::*;

use crate::SceneRay;
use crate::config::SimulationConfig;
use crate::error::SimulateError;
use crate::surface::frame::SceneFrame;
use crate::surface::lod2;
use crate::surface::scene::{Scene, TruthClass};
use crate::surface::texture::Texture;
use crate::views::sight::SightLines;

/// Value of the reflectance 1 in [`Truth::ortho`].
pub const ORTHO_SCALE: f64 = 10_000.0;
/// A point is visible if its ray ends within this distance of it, metres. It allows for the RPC's
/// residual of a thousandth of a pixel on a steep slope.
const SEEN_M: f64 = 0.03;
/// Samples along each side of a cell of the ortho image.
const ORTHO_SUBCELLS: usize = 2;

/// The surface as rasters.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Height of the upper surface, metres above the ellipsoid.
    pub dsm: Grid<f32>,
    /// Height of the bare ground, under buildings and trees too, metres above the ellipsoid.
    pub dtm: Grid<f32>,
    /// Class of the upper surface (see [`TruthClass`]).
    pub classes: Grid<u8>,
    /// Number of the building in each cell (see [`Scene::object_number`]).
    pub objects: Grid<i32>,
    /// Per view: 1 where it sees the point of the upper surface at the cell centre, else 0.
    pub visibility: Vec<Grid<u8>>,
    /// Reflectance seen from directly above, mean over the cell, in units of 1 / [`ORTHO_SCALE`].
    pub ortho: Grid<u16>,
    /// The buildings at LoD2 in map coordinates.
    pub buildings: CityModel,
    /// Geotransform of the cells.
    pub geotransform: GeoTransform,
    /// EPSG code of the map.
    pub epsg: u32,
}

/// A view for which visibility is tested.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Witness<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) sight: &'a SightLines,
    pub(crate) rpc: &'a Rpc,
    pub(crate) size: (usize, usize),
}

/// The cells of the truth in the scene frame.
#[derive(Debug, Clone, Copy)]
struct Cells {
    count: usize,
    cell_m: f64,
    half_m: f64,
}

impl Cells {
    fn new(config: &SimulationConfig) -> Self {
        let count = (config.size_m / config.gsd_m).round() as usize;
        Self { count, cell_m: config.gsd_m, half_m: (count / 2) as f64 * config.gsd_m }
    }

    fn centre(&self, index: usize) -> [f64; 2] {
        let at = |k: usize| (k as f64 + 0.5) * self.cell_m - self.half_m;
        [at(index % self.count), -at(index / self.count)]
    }

    fn grid<T: Send + Clone>(&self, value: impl Fn([f64; 2]) -> T + Sync) -> Grid<T> {
        let data = (0..self.count * self.count).into_par_iter().map(|k| value(self.centre(k))).collect();
        Grid::from_vec(self.count, self.count, data).expect("as many values as cells")
    }

    fn try_grid<T: Send + Clone>(
        &self,
        value: impl Fn([f64; 2]) -> Result<T, SimulateError> + Sync,
    ) -> Result<Grid<T>, SimulateError> {
        let data = (0..self.count * self.count).into_par_iter().map(|k| value(self.centre(k)));
        let data = data.collect::<Result<Vec<T>, SimulateError>>()?;
        Ok(Grid::from_vec(self.count, self.count, data).expect("as many values as cells"))
    }
}

impl Truth {
    pub(crate) fn new(
        config: &SimulationConfig,
        frame: &SceneFrame,
        scene: &Scene,
        views: &[Witness<'_>],
    ) -> Result<Self, SimulateError> {
        let cells = Cells::new(config);
        let dsm = cells.grid(|[x, y]| stored(scene.surface(x, y).0));
        let seen_by = cells.try_grid(|[x, y]| {
            let point = Vector3::new(x, y, scene.surface(x, y).0);
            let ground = frame.ground_from_scene(point)?;
            Ok(views.iter().enumerate().fold(0u16, |bits, (k, view)| bits | u16::from(view.sees(&point, ground)) << k))
        })?;
        let texture = Texture::new(config.seed, 0, config.surface);
        let [x, y] = frame.origin_m();
        Ok(Self {
            dsm,
            dtm: cells.grid(|[x, y]| stored(scene.terrain().height(x, y))),
            classes: cells.grid(|at| class(scene, at, cells.cell_m) as u8),
            objects: cells.grid(|[x, y]| scene.object_number(x, y)),
            visibility: (0..views.len()).map(|k| seen_by.map(|bits| (bits >> k & 1) as u8)).collect(),
            ortho: cells.grid(|at| reflectance_from_above(scene, &texture, at, cells.cell_m)),
            buildings: lod2::model(scene.buildings(), &config.absent_buildings, frame),
            geotransform: GeoTransform::north_up(x - cells.half_m, y + cells.half_m, cells.cell_m),
            epsg: frame.epsg(),
        })
    }
}

impl Witness<'_> {
    fn sees(&self, point: &Vector3<f64>, ground: LonLatHeight) -> bool {
        let inside = |coordinate: f64, pixels: usize| (0.0..=pixels as f64 - 1.0).contains(&coordinate);
        let at = match self.rpc.project(ground) {
            Ok(at) if inside(at.sample, self.size.0) && inside(at.line, self.size.1) => at,
            _ => return false,
        };
        self.scene.first_point(&self.sight.ray(at), 1.0).is_some_and(|met| (met - point).norm() < SEEN_M)
    }
}

/// Returns a height rounded to 2⁻¹⁰ m. The trailing zero bits halve the size of compressed files.
fn stored(height_m: f64) -> f32 {
    ((height_m * 1024.0).round() / 1024.0) as f32
}

/// Returns the class of a cell: the one of its centre, or the edge of a footprint where a façade
/// goes through the cell.
fn class(scene: &Scene, [x, y]: [f64; 2], cell_m: f64) -> TruthClass {
    let is_building = |class| class == TruthClass::Building;
    let centre = scene.surface(x, y).1;
    let half = 0.5 * cell_m;
    let corner = |(dx, dy): (f64, f64)| is_building(scene.surface(x + dx * half, y + dy * half).1);
    let differs = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)].map(corner).contains(&!is_building(centre));
    if differs { TruthClass::FootprintEdge } else { centre }
}

fn reflectance_from_above(scene: &Scene, texture: &Texture, [x, y]: [f64; 2], cell_m: f64) -> u16 {
    let offset = |k: usize| ((k as f64 + 0.5) / ORTHO_SUBCELLS as f64 - 0.5) * cell_m;
    let (low, high) = scene.height_range_m();
    let mut sum = 0.0;
    for k in 0..ORTHO_SUBCELLS * ORTHO_SUBCELLS {
        let origin = Vector3::new(x + offset(k % ORTHO_SUBCELLS), y + offset(k / ORTHO_SUBCELLS), high + 1.0);
        let down = SceneRay { origin, direction: -Vector3::z() };
        sum += scene.first_hit(&down, high - low + 2.0).map_or(0.0, |hit| texture.reflectance(scene, &hit));
    }
    (sum / (ORTHO_SUBCELLS * ORTHO_SUBCELLS) as f64 * ORTHO_SCALE).round() as u16
}

/// Returns the height of the surface at the centre of each pixel, metres above the ellipsoid. NaN
/// where there is none.
pub(crate) fn image_heights(scene: &Scene, sight: &SightLines, (width, height): (usize, usize)) -> Grid<f32> {
    let height_at = |k: usize| {
        let at = ImagePoint::new((k % width) as f64, (k / width) as f64);
        scene.first_point(&sight.ray(at), 1.0).map_or(f32::NAN, |point| stored(point.z))
    };
    let heights = (0..width * height).into_par_iter().map(height_at).collect();
    Grid::from_vec(width, height, heights).expect("as many values as pixels")
}
