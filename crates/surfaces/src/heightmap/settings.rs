//! Settings that all tiles of a run share.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use crs::MapProjection;
use geodesy::utm_epsg;
use heightmap::{MapSystem, TileRequest};

use super::config::{HeightMapConfig, MapChoice};
use super::error::HeightMapJobError;
use crate::camera_stand::CameraStand;

/// Settings that all tiles of a run share.
#[derive(Debug)]
pub(super) struct Settings {
    pub(super) config: HeightMapConfig,
    /// Projections by EPSG code: they are expensive to make, and tiles share them.
    projections: Mutex<HashMap<u32, Arc<MapProjection>>>,
}

impl Settings {
    pub(super) fn new(config: &HeightMapConfig) -> Self {
        Self { config: config.clone(), projections: Mutex::default() }
    }

    /// Returns the tile of a camera.
    pub(super) fn request(&self, stand: &CameraStand) -> TileRequest {
        TileRequest {
            lon_deg: stand.lon_deg,
            lat_deg: stand.lat_deg,
            heading_deg: stand.heading_deg,
            size: self.config.size_px,
            resolution_px_per_m: self.config.resolution_px_per_m,
        }
    }

    /// Returns the map projection that the tile of a camera is written in.
    pub(super) fn system(&self, stand: &CameraStand) -> Result<MapSystem, HeightMapJobError> {
        let epsg = match self.config.map {
            MapChoice::Local => return Ok(MapSystem::Local),
            MapChoice::Utm => utm_epsg(stand.lon_deg, stand.lat_deg)?,
            MapChoice::Epsg(code) => code,
        };
        let mut known = self.projections.lock().map_err(|_| HeightMapJobError::WorkerLost)?;
        let projection = match known.get(&epsg) {
            Some(projection) => projection.clone(),
            None => known.entry(epsg).or_insert(Arc::new(MapProjection::from_epsg(epsg)?)).clone(),
        };
        Ok(MapSystem::Projected { epsg, projection })
    }

    /// Returns all settings that change the content of a map, as text.
    ///
    /// The text is hashed into the file of the map: a change of the format makes earlier maps
    /// unknown.
    pub(super) fn fingerprint(&self) -> String {
        let HeightMapConfig { size_px, resolution_px_per_m, stand, normalization, interpolation, map, .. } =
            &self.config;
        format!(
            "{size_px} px, {resolution_px_per_m} px/m, offset {} m, {normalization:?}, {interpolation:?}, {map:?}",
            stand.ground_offset_m
        )
    }
}
