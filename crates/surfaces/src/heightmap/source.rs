//! Sources of heights: rasters, city models and point clouds, each read at the pixels of a tile.

use formats::points::is_point_cloud;
use heightmap::{MapSystem, TileRequest};
use numeric::Progress;
use rayon::prelude::*;

use super::config::HeightMapConfig;
use super::error::HeightMapJobError;
use super::raster_source::RasterSource;
use super::settings::Settings;
use super::source_map::Laid;
use super::vector_source::{ModelSource, PointSource};
use crate::camera_stand::CameraStand;
use crate::city_files::is_city_model;

/// Most pixels of all tiles that are filled in one pass over a point cloud (512 MiB).
const OPEN_CELLS: usize = 1 << 27;

/// A source of heights.
pub(super) enum HeightSource {
    /// Heights on a grid.
    Raster(RasterSource),
    /// Triangles of a city model.
    Model(Box<ModelSource>),
    /// Points.
    Points(PointSource),
}

impl HeightSource {
    /// Opens a source of any kind.
    pub(super) fn open(config: &HeightMapConfig, progress: &dyn Progress) -> Result<Self, HeightMapJobError> {
        let path = config.source.as_path();
        if is_point_cloud(path) {
            return PointSource::open(config, progress).map(Self::Points);
        }
        if is_city_model(path) {
            return ModelSource::open(config, progress).map(|model| Self::Model(Box::new(model)));
        }
        RasterSource::open(path, config.source_epsg, config.source_vertical, progress).map(Self::Raster)
    }

    /// Returns the kind of the source in words.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Raster(_) => "raster",
            Self::Model(_) => "city model",
            Self::Points(_) => "point cloud",
        }
    }

    /// Returns how many tiles are best read at a time.
    pub(super) fn batch(&self, settings: &Settings) -> usize {
        match self {
            Self::Points(_) => {
                (OPEN_CELLS / settings.config.size_px.saturating_mul(settings.config.size_px).max(1)).max(1)
            }
            _ => 64,
        }
    }

    /// Reads the heights at the tiles of some cameras.
    pub(super) fn lay(&self, settings: &Settings, stands: &[CameraStand]) -> Vec<Result<Laid, HeightMapJobError>> {
        let each = |one: &(dyn Fn(&CameraStand, TileRequest, MapSystem) -> Result<Laid, HeightMapJobError> + Sync)| {
            let lay = |stand: &CameraStand| one(stand, settings.request(stand), settings.system(stand)?);
            stands.par_iter().map(lay).collect()
        };
        match self {
            Self::Raster(raster) => {
                each(&|stand, request, system| raster.lay(stand, request, system, settings.config.interpolation))
            }
            Self::Model(model) => each(&|_, request, system| model.lay(request, system)),
            Self::Points(points) => points.lay(settings, stands),
        }
    }
}
