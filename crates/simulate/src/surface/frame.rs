//! The scene frame: metres of the map grid around the scene's centre.

use crs::{CrsError, MapProjection};
use geodesy::{LonLatHeight, utm_epsg};
use nalgebra::Vector3;

use crate::SimulateError;

/// The place of a scene: a UTM (or polar) map, and the origin of the scene on it.
#[derive(Debug, Clone)]
pub struct SceneFrame {
    projection: MapProjection,
    epsg: u32,
    origin_m: [f64; 2],
}

impl SceneFrame {
    /// Makes the frame around a position.
    ///
    /// The origin is moved to the nearest multiple of `cell_m` on the map, so that rasters of that
    /// cell size align with the map grid.
    ///
    /// # Errors
    /// A position where no map projection is defined.
    pub fn new(lon_deg: f64, lat_deg: f64, cell_m: f64) -> Result<Self, SimulateError> {
        let epsg = utm_epsg(lon_deg, lat_deg).map_err(CrsError::from)?;
        let projection = MapProjection::from_epsg(epsg)?;
        let map = projection.map_from_lonlat(lon_deg, lat_deg)?;
        let origin_m = [map.x, map.y].map(|c| (c / cell_m).round() * cell_m);
        Ok(Self { projection, epsg, origin_m })
    }

    /// Returns the EPSG code of the map.
    pub fn epsg(&self) -> u32 {
        self.epsg
    }

    /// Returns the map coordinates of the origin, metres.
    pub fn origin_m(&self) -> [f64; 2] {
        self.origin_m
    }

    /// Returns the ground position of a point of the scene.
    ///
    /// # Errors
    /// A point where the map projection is not defined.
    pub fn ground_from_scene(&self, p: Vector3<f64>) -> Result<LonLatHeight, SimulateError> {
        let (lon, lat) = self.projection.lonlat_from_map(p.x + self.origin_m[0], p.y + self.origin_m[1])?;
        Ok(LonLatHeight::new(lon, lat, p.z))
    }

    /// Returns the point of the scene at a ground position.
    ///
    /// # Errors
    /// A position where the map projection is not defined.
    pub fn scene_from_ground(&self, ground: LonLatHeight) -> Result<Vector3<f64>, SimulateError> {
        let map = self.projection.map_from_lonlat(ground.lon_deg, ground.lat_deg)?;
        Ok(Vector3::new(map.x - self.origin_m[0], map.y - self.origin_m[1], ground.height_m))
    }
}
