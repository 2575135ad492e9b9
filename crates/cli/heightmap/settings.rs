//! Options of height maps as values: normalisation, map, interpolation, and all of them for the tiles of a run.

use std::collections::HashMap;
use std::str::FromStr;
use std::sync::{Arc, Mutex};

use anyhow::Context;
use crs::MapProjection;
use geodesy::utm_epsg;
use heightmap::{MapSystem, Reading, TileRequest};

use super::MakeArgs;
use crate::stand::Stand;

/// `--normalize`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Normalize {
    /// Metres.
    None,
    /// By the mean distance of the map's points.
    Auto,
    /// By this many metres.
    By(f64),
}

impl FromStr for Normalize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self::None),
            "auto" => Ok(Self::Auto),
            number => match number.parse::<f64>() {
                Ok(s) if s > 0.0 && s.is_finite() => Ok(Self::By(s)),
                _ => Err(format!("expected auto, none or a positive number of metres, found {number:?}")),
            },
        }
    }
}

/// `--crs`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MapChoice {
    /// The tile's own.
    Local,
    /// The UTM zone of the camera.
    Utm,
    /// This one.
    Epsg(u32),
}

impl FromStr for MapChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let lower = text.to_ascii_lowercase();
        match lower.as_str() {
            "local" => Ok(Self::Local),
            "utm" => Ok(Self::Utm),
            other => match other.strip_prefix("epsg:").unwrap_or(other).parse() {
                Ok(code) => Ok(Self::Epsg(code)),
                Err(_) => Err(format!("expected local, utm or EPSG:n, found {text:?}")),
            },
        }
    }
}

/// `--interpolation`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Interpolation {
    /// The nearest cell.
    Nearest,
    /// Between four cells.
    Bilinear,
    /// Between sixteen cells.
    Cubic,
}

impl From<Interpolation> for Reading {
    fn from(interpolation: Interpolation) -> Self {
        match interpolation {
            Interpolation::Nearest => Self::Nearest,
            Interpolation::Bilinear => Self::Bilinear,
            Interpolation::Cubic => Self::Cubic,
        }
    }
}

/// What all tiles of a run share.
#[derive(Debug)]
pub(super) struct Settings {
    pub(super) size: usize,
    pub(super) resolution_px_per_m: f64,
    pub(super) ground_offset_m: f64,
    pub(super) normalize: Normalize,
    pub(super) reading: Reading,
    crs: MapChoice,
    /// Projections are dear to make, and tiles share them.
    projections: Mutex<HashMap<u32, Arc<MapProjection>>>,
}

impl Settings {
    pub(super) fn new(args: &MakeArgs) -> Self {
        Self {
            size: args.size,
            resolution_px_per_m: args.resolution,
            ground_offset_m: args.stand.ground_offset,
            normalize: args.normalize,
            reading: args.interpolation.into(),
            crs: args.crs,
            projections: Mutex::default(),
        }
    }

    pub(super) fn request(&self, stand: &Stand) -> TileRequest {
        TileRequest {
            lon_deg: stand.lon_deg,
            lat_deg: stand.lat_deg,
            heading_deg: stand.heading_deg,
            size: self.size,
            resolution_px_per_m: self.resolution_px_per_m,
        }
    }

    /// The map that a tile is written on.
    pub(super) fn system(&self, stand: &Stand) -> anyhow::Result<MapSystem> {
        let epsg = match self.crs {
            MapChoice::Local => return Ok(MapSystem::Local),
            MapChoice::Utm => utm_epsg(stand.lon_deg, stand.lat_deg)?,
            MapChoice::Epsg(code) => code,
        };
        let mut known = self.projections.lock().ok().context("another thread stopped while it made a projection")?;
        let projection = match known.get(&epsg) {
            Some(projection) => projection.clone(),
            None => known.entry(epsg).or_insert(Arc::new(MapProjection::from_epsg(epsg)?)).clone(),
        };
        Ok(MapSystem::Projected { epsg, projection })
    }

    /// All that changes the content of a map, as text.
    pub(super) fn fingerprint(&self) -> String {
        let Self { size, resolution_px_per_m, ground_offset_m, normalize, reading, crs, .. } = self;
        format!(
            "{size} px, {resolution_px_per_m} px/m, offset {ground_offset_m} m, {normalize:?}, {reading:?}, {crs:?}"
        )
    }
}
