//! Makes one height map: ground, height of the camera, normalisation, confidence, and the file.

use std::path::Path;

use formats::raster::{Band, BandData, BandScale, MapTile, write_map_tile, write_png_rgb, write_world_file};
use heightmap::{GROUND_REACH_M, HeightMapError, Reading, ground_height, mean_distance_m};
use numeric::Progress;
use raster::{Grid, Light};

use super::config::{ConfidenceSource, HeightMapConfig, Normalization};
use super::error::HeightMapJobError;
use super::raster_source::RasterSource;
use super::report::HeightMapMade;
use super::settings::Settings;
use super::source::HeightSource;
use super::source_map::Laid;
use super::tags::HeightMapTags;
use crate::camera_stand::CameraStand;
use crate::standing::ground_under;
use crate::surface_layer::CONFIDENCE;
use job::files::FileError;

/// Percentiles of the heights that the colours of the picture span.
const COLOURS: (f64, f64) = (1.0, 99.0);

/// Makes the maps of a configuration.
pub(super) struct Maker {
    pub(super) settings: Settings,
    pub(super) source: HeightSource,
    /// File name of the source.
    name: String,
    /// Names, sizes and times of the source files, in place of their content.
    fingerprint: String,
    terrain: Option<RasterSource>,
    confidence: Confidence,
    previews: bool,
    overwrite: bool,
}

/// The band of confidences.
enum Confidence {
    /// None is written.
    None,
    /// 1 where the source has a height, 0 where the terrain model gave it.
    Presence,
    /// From a raster.
    Raster(Box<RasterSource>),
}

impl Maker {
    /// Opens the source, the terrain model and the confidence.
    pub(super) fn open(config: &HeightMapConfig, progress: &dyn Progress) -> Result<Self, HeightMapJobError> {
        let (settings, path) = (Settings::new(config), config.source.as_path());
        let source = HeightSource::open(config, progress)?;
        let terrain = config.terrain.as_deref().map(|terrain| RasterSource::open(terrain, None, None, progress));
        let terrain = terrain.transpose()?;
        Ok(Self {
            fingerprint: [Some(path), config.terrain.as_deref()].into_iter().flatten().map(stamp).collect(),
            confidence: confidence(config, &source, progress)?,
            settings,
            source,
            name: path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
            terrain,
            previews: config.previews,
            overwrite: config.overwrite,
        })
    }

    /// Returns a number for the map that is asked for: maps with the same number are the same.
    ///
    /// The text under the hash must not change, or maps of earlier runs are not recognised.
    pub(super) fn request(&self, stand: &CameraStand) -> String {
        let confidence = !matches!(self.confidence, Confidence::None);
        let CameraStand { lon_deg, lat_deg, heading_deg, height_m } = stand;
        let stand = format!(
            "Stand {{ lon_deg: {lon_deg:?}, lat_deg: {lat_deg:?}, heading_deg: {heading_deg:?}, height_m: {height_m:?} }}"
        );
        let version = env!("CARGO_PKG_VERSION");
        let (settings, source) = (self.settings.fingerprint(), &self.fingerprint);
        let text = format!("{version}; {stand}; {settings}; confidence {confidence}; {source}");
        format!("{:016x}", fnv1a(text.as_bytes()))
    }

    /// Completes a tile whose heights the source gave, and writes it.
    pub(super) fn finish(
        &self,
        stand: &CameraStand,
        laid: Laid,
        path: &Path,
    ) -> Result<HeightMapMade, HeightMapJobError> {
        let Laid { frame, mut heights, zero_m, lowest } = laid;
        if let HeightSource::Raster(raster) = &self.source {
            raster.check_meets(stand, &frame)?;
        }
        let resolution = self.settings.config.resolution_px_per_m;
        let measured = heights.clone();
        let ground = match &self.terrain {
            Some(terrain) => {
                let terrain = terrain.on(&frame, Reading::Bilinear, zero_m)?;
                fill(&mut heights, &terrain);
                ground_height(&terrain, resolution)
            }
            None => match &lowest {
                Some(lowest) => ground_height(lowest, resolution),
                None => ground_under(&heights, resolution),
            },
        };
        let ground_height_m = ground.map(|above| above + zero_m);
        let camera_height_m = match (stand.height_m, ground_height_m) {
            (Some(height), _) => height,
            (None, Some(ground)) => ground + self.settings.config.stand.ground_offset_m,
            (None, None) => {
                let (lon_deg, lat_deg) = (stand.lon_deg, stand.lat_deg);
                return Err(HeightMapError::NoGround { reach_m: GROUND_REACH_M, lon_deg, lat_deg }.into());
            }
        };
        let lift = zero_m - camera_height_m;
        heights.data_mut().iter_mut().for_each(|h| *h = (f64::from(*h) + lift) as f32);
        let mean = mean_distance_m(&heights, resolution).ok_or(HeightMapJobError::EmptyTile)?;
        let (scene_scale_m, normalized) = match self.settings.config.normalization {
            Normalization::None => (mean, false),
            Normalization::Auto => (mean, true),
            Normalization::By(s) => (s, true),
        };
        let tags = HeightMapTags {
            camera_lon_deg: stand.lon_deg,
            camera_lat_deg: stand.lat_deg,
            camera_height_m,
            ground_height_m,
            heading_deg: stand.heading_deg,
            resolution_px_per_m: resolution,
            scene_scale_m,
            normalized,
            source: self.name.clone(),
            source_kind: self.source.kind().to_owned(),
            interpolation: format!("{:?}", self.settings.config.interpolation).to_lowercase(),
            request: self.request(stand),
        };
        let confidence = match &self.confidence {
            Confidence::None => None,
            Confidence::Presence => Some(presence(&measured, &heights)),
            Confidence::Raster(raster) => Some(raster.confidence(&frame, &heights)?),
        };
        let crs = frame.crs().map_or_else(|| frame.wkt(), |crs| crs.horizontal_definition());
        let file = MapFile { path, geotransform: frame.geotransform(), crs: &crs, overwrite: self.overwrite };
        file.write(&tags, &heights, confidence.as_ref())?;
        if self.previews {
            let picture = path.with_extension("png");
            write_preview(&picture, &heights, resolution)?;
            write_world_file(&picture, frame.geotransform(), 1).map_err(FileError::from)?;
        }
        let void = heights.data().iter().filter(|h| h.is_nan()).count();
        let height_range_m = raster::height_percentiles(&heights, 0.0, 100.0).unwrap_or((f32::NAN, f32::NAN));
        Ok(HeightMapMade {
            path: path.to_owned(),
            tags,
            void_share: void as f64 / heights.data().len().max(1) as f64,
            height_range_m,
        })
    }
}

/// Computes the FNV-1a hash (Fowler, Noll, Vo), which is the same in every build.
pub(super) fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Returns name, size and time of a file.
fn stamp(path: &Path) -> String {
    let meta = std::fs::metadata(path).ok();
    let modified = meta.as_ref().and_then(|m| m.modified().ok());
    let seconds = modified.and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok()).map_or(0, |d| d.as_secs());
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    format!("{name} {} {seconds}; ", meta.map_or(0, |m| m.len()))
}

/// Opens the confidence that is asked for.
fn confidence(
    config: &HeightMapConfig,
    source: &HeightSource,
    progress: &dyn Progress,
) -> Result<Confidence, HeightMapJobError> {
    let open = |path: &Path| {
        RasterSource::open(path, None, Some(crs::VerticalDatum::Ellipsoid), progress)
            .map(|raster| Confidence::Raster(Box::new(raster)))
    };
    let beside = config.source.with_file_name(CONFIDENCE);
    match (&config.confidence, source) {
        (ConfidenceSource::None, _) => Ok(Confidence::None),
        (ConfidenceSource::Raster(path), _) => open(path),
        (ConfidenceSource::Automatic, HeightSource::Raster(_)) if beside.is_file() => open(&beside),
        (ConfidenceSource::Automatic, _) => Ok(Confidence::Presence),
    }
}

/// Returns 1 where the source has a height and 0 where only the terrain model has one.
fn presence(measured: &Grid<f32>, heights: &Grid<f32>) -> Grid<f32> {
    let mut confidence = heights.clone();
    for (value, own) in confidence.data_mut().iter_mut().zip(measured.data()) {
        if value.is_finite() {
            *value = if own.is_finite() { 1.0 } else { 0.0 };
        }
    }
    confidence
}

/// Fills heights that are NaN from the terrain.
fn fill(heights: &mut Grid<f32>, terrain: &Grid<f32>) {
    for (height, ground) in heights.data_mut().iter_mut().zip(terrain.data()) {
        if height.is_nan() {
            *height = *ground;
        }
    }
}

/// File of a map and its place.
struct MapFile<'a> {
    path: &'a Path,
    geotransform: raster::GeoTransform,
    crs: &'a str,
    overwrite: bool,
}

impl MapFile<'_> {
    /// Writes heights and confidences with their metadata.
    fn write(
        &self,
        tags: &HeightMapTags,
        heights: &Grid<f32>,
        confidence: Option<&Grid<f32>>,
    ) -> Result<(), FileError> {
        let scale = if tags.normalized { tags.scene_scale_m } else { 1.0 };
        let scaled = tags.normalized.then(|| heights.map(|&h| (f64::from(h) / scale) as f32));
        let description = if tags.normalized { "height_above_camera_scene_units" } else { "height_above_camera_m" };
        let mut bands = vec![Band { description, data: BandData::F32(scaled.as_ref().unwrap_or(heights)) }];
        if let Some(confidence) = confidence {
            bands.push(Band { description: "confidence_0_to_1", data: BandData::F32(confidence) });
        }
        let tile = MapTile {
            bands: &bands,
            geotransform: self.geotransform,
            crs: self.crs,
            height_from_value: Some(BandScale { scale, offset: tags.camera_height_m }),
            metadata: &tags.items(),
        };
        Ok(write_map_tile(self.path, &tile, self.overwrite)?)
    }
}

/// Writes a relief with light from the upper left of the picture. It replaces an earlier one.
fn write_preview(path: &Path, heights: &Grid<f32>, resolution_px_per_m: f64) -> Result<(), FileError> {
    let pixel_m = 1.0 / resolution_px_per_m;
    let shade = raster::hillshade(heights, (pixel_m, pixel_m), Light::default());
    let (low, high) = raster::height_percentiles(heights, COLOURS.0, COLOURS.1).unwrap_or((0.0, 1.0));
    Ok(write_png_rgb(path, &raster::coloured_relief(heights, &shade, low, high), true)?)
}
