//! The frame of the map for a job that works on it: its coordinate system, its extent and its
//! ground.

use formats::raster::{ImageSource, RasterError};
use numeric::upper_median;

use super::scene::{MapSystem, Scene, reduced};

/// Longest side of the reduced heights from which the ground follows.
const GROUND_SIDE: usize = 256;

/// Where the map lies.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct MapFrame {
    /// Name of the first raster.
    pub name: String,
    /// Coordinate system as WKT; `None` where the rasters name none.
    pub wkt: Option<String>,
    /// Its EPSG code, where it is known.
    pub epsg: Option<u32>,
    /// Least easting and northing, greatest easting and northing of the first raster.
    pub bounds: [f64; 4],
    /// Median of the first raster with heights; `None` without one.
    pub ground_m: Option<f64>,
    /// Vertical datum of that raster, where it is known.
    pub vertical: Option<String>,
}

impl MapFrame {
    /// Returns the frame of a scene; `None` for rasters without a georeference.
    pub(super) fn of(scene: &Scene) -> Result<Option<Self>, RasterError> {
        let Some(first) = scene.rasters.first().filter(|_| scene.map.is_placed) else { return Ok(None) };
        let corners = [(0, 0), (first.width, 0), (0, first.height), (first.width, first.height)];
        let map = corners.map(|(x, y)| first.transform.map_from_cell(x as f64 - 0.5, y as f64 - 0.5));
        let bound =
            |pick: fn(f64, f64) -> f64, start| map.iter().fold([start; 2], |b, m| [pick(b[0], m.0), pick(b[1], m.1)]);
        let (low, high) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
        let (mut ground_m, mut vertical) = (None, None);
        if let Some(raster) = scene.heights() {
            let source = ImageSource::open(&raster.path)?;
            let size = reduced((source.info().width, source.info().height), GROUND_SIDE);
            let cells = source.read_reduced(1, source.window(), size)?;
            let mut heights: Vec<f64> = cells.data().iter().filter(|h| h.is_finite()).map(|h| f64::from(*h)).collect();
            ground_m = upper_median(&mut heights);
            vertical = MapSystem::of(&source)?.vertical;
        }
        Ok(Some(Self {
            name: first.path.display().to_string(),
            wkt: scene.map.wkt.clone(),
            epsg: scene.map.epsg,
            bounds: [low[0], low[1], high[0], high[1]],
            ground_m,
            vertical,
        }))
    }
}
