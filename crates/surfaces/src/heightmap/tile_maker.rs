//! Height maps made one by one, and the surface around them, for jobs that lay images on them.

use std::path::Path;

use formats::raster::{Band, BandData, BandScale, MapTile, write_map_tile};
use heightmap::TileFrame;
use numeric::Progress;

use super::config::HeightMapConfig;
use super::error::HeightMapJobError;
use super::maker::{Maker, fnv1a};
use super::report::HeightMapMade;
use super::settings::Settings;
use super::source_map::Laid;
use crate::camera_stand::CameraStand;
use job::files::FileError;

/// Makes tiles of one source.
pub(crate) struct TileMaker {
    maker: Maker,
}

impl TileMaker {
    /// Opens the source of a configuration.
    pub(crate) fn open(config: &HeightMapConfig, progress: &dyn Progress) -> Result<Self, HeightMapJobError> {
        Ok(Self { maker: Maker::open(config, progress)? })
    }

    /// Returns a number for the map that is asked for and further settings.
    pub(crate) fn request(&self, stand: &CameraStand, further: &str) -> String {
        format!("{:016x}", fnv1a(format!("{}; {further}", self.maker.request(stand)).as_bytes()))
    }

    /// Makes the height map of a camera.
    pub(crate) fn make(&self, stand: &CameraStand, path: &Path) -> Result<HeightMapMade, HeightMapJobError> {
        self.maker.finish(stand, self.lay(&self.maker.settings, stand)?, path)
    }

    /// Writes the surface of a tile of another size around the same camera, heights above the
    /// ellipsoid. Returns the difference between its highest and its lowest height, metres.
    pub(crate) fn write_surface(
        &self,
        stand: &CameraStand,
        size_px: usize,
        path: &Path,
    ) -> Result<f64, HeightMapJobError> {
        let settings = Settings::new(&HeightMapConfig { size_px, ..self.maker.settings.config.clone() });
        let Laid { frame, heights, zero_m, .. } = self.lay(&settings, stand)?;
        let (low, high) = raster::height_percentiles(&heights, 0.0, 100.0).ok_or(HeightMapJobError::EmptyTile)?;
        let crs = frame.crs().map_or_else(|| frame.wkt(), |crs| crs.horizontal_definition());
        let tile = MapTile {
            bands: &[Band { description: "height_m", data: BandData::F32(&heights) }],
            geotransform: frame.geotransform(),
            crs: &crs,
            height_from_value: Some(BandScale { scale: 1.0, offset: zero_m }),
            metadata: &[],
        };
        write_map_tile(path, &tile, true).map_err(FileError::from)?;
        Ok(f64::from(high - low))
    }

    /// Returns longitudes and latitudes of pixels of the tile of a camera.
    pub(crate) fn lonlat(&self, stand: &CameraStand, pixels: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, HeightMapJobError> {
        Ok(self.frame(stand)?.lonlat_from_pixels(pixels)?)
    }

    /// Returns the pixels of longitudes and latitudes in the tile of a camera; NaN outside of its
    /// map.
    pub(crate) fn pixels(&self, stand: &CameraStand, lonlat: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, HeightMapJobError> {
        Ok(self.frame(stand)?.pixels_from_lonlat(lonlat)?)
    }

    /// Lays out the tile of a camera. The height of the ground, which is left out here, moves its
    /// corners by millimetres.
    fn frame(&self, stand: &CameraStand) -> Result<TileFrame, HeightMapJobError> {
        let settings = &self.maker.settings;
        Ok(TileFrame::new(settings.request(stand), stand.height_m.unwrap_or(0.0), settings.system(stand)?)?)
    }

    fn lay(&self, settings: &Settings, stand: &CameraStand) -> Result<Laid, HeightMapJobError> {
        self.maker.source.lay(settings, &[*stand]).pop().ok_or(HeightMapJobError::WorkerLost)?
    }
}
