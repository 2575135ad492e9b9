//! One height map: ground, camera height, normalisation, confidence, and its file.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use heightmap::{GROUND_REACH_M, HeightMapError, Reading, ground_height, mean_distance_m};
use io::raster::{Band, BandData, BandScale, MapTile, write_map_tile, write_png_rgb};
use raster::{Grid, Light};
use serde::Serialize;

use super::MakeArgs;
use super::settings::{Normalize, Settings};
use super::source::{Laid, RasterSource, Source};
use super::tags::Tags;
use crate::stand::Stand;
use crate::{Global, Outcome, print};

/// Name that a run of skysweep gives to the confidence beside its DSM.
const CONFIDENCE: &str = "confidence.tif";
/// The confidences that belong to the source.
const AUTO: &str = "auto";
/// Percentiles of the heights that the picture's colours span.
const COLOURS: (f64, f64) = (1.0, 99.0);

/// What maps are made from, and how.
pub(super) struct Maker {
    pub(super) settings: Settings,
    pub(super) source: Source,
    name: String,
    /// Content of the source, as far as its size and time tell.
    fingerprint: String,
    terrain: Option<RasterSource>,
    /// Whether a band of confidences is wanted, and its raster where there is one.
    confidence: Option<Option<RasterSource>>,
    previews: bool,
    overwrite: bool,
}

/// What became of a map.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Made {
    pub(super) path: PathBuf,
    #[serde(flatten)]
    pub(super) tags: Tags,
    /// Share of the pixels without a height.
    pub(super) void_share: f64,
    /// Lowest and highest height relative to the camera, metres.
    pub(super) height_range_m: (f32, f32),
}

/// Runs `skysweep heightmap` for one camera.
pub(super) fn run(args: &MakeArgs, source: &Path, output: &Path, global: Global) -> anyhow::Result<Outcome> {
    let stand =
        args.stand.single()?.context("no position: give --center LON LAT, --camera FILE or --positions FILE")?;
    ensure!(
        args.overwrite || output.symlink_metadata().is_err(),
        "the output exists already: choose another name or pass --overwrite: {}",
        output.display()
    );
    let maker = Maker::open(args, source, !args.no_preview)?;
    let laid = maker.source.lay(&maker.settings, &[stand]).pop().context("no tile was laid")??;
    let made = maker.finish(&stand, laid, output)?;
    if args.json {
        print::json(&made)?;
    } else if !global.is_quiet() {
        print::text(&made.text())?;
    }
    Ok(Outcome::Complete)
}

impl Made {
    fn text(&self) -> String {
        let t = &self.tags;
        let (low, high) = self.height_range_m;
        format!(
            "height map  {}\ncamera      {:.7} {:.7}, {:.3} m above the ellipsoid, heading {}°\nheights     {low:.2} to {high:.2} m, \
             {:.1} % void\nscale       s = {:.4} m{}\n",
            self.path.display(),
            t.camera_lon_deg,
            t.camera_lat_deg,
            t.camera_height_m,
            t.heading_deg,
            100.0 * self.void_share,
            t.scene_scale_m,
            if t.normalized { ", heights are divided by it" } else { "" },
        )
    }
}

impl Maker {
    pub(super) fn open(args: &MakeArgs, path: &Path, previews: bool) -> anyhow::Result<Self> {
        let settings = Settings::new(args);
        let source = Source::open(path, args)?;
        let terrain = args.dtm.as_deref().map(|dtm| RasterSource::open(dtm, None, None)).transpose()?;
        Ok(Self {
            fingerprint: [Some(path), args.dtm.as_deref()].into_iter().flatten().map(stamp).collect(),
            confidence: args.confidence.as_deref().map(|asked| confidence(asked, path, &source)).transpose()?,
            settings,
            source,
            name: path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
            terrain,
            previews,
            overwrite: args.overwrite,
        })
    }

    /// A number for what a map for a stand is asked to be: the same number is the same map.
    pub(super) fn request(&self, stand: &Stand) -> String {
        let confidence = self.confidence.is_some();
        let version = env!("CARGO_PKG_VERSION");
        let (settings, source) = (self.settings.fingerprint(), &self.fingerprint);
        let text = format!("{version}; {stand:?}; {settings}; confidence {confidence}; {source}");
        format!("{:016x}", fnv1a(text.as_bytes()))
    }

    /// Completes a tile that the source has been laid under, and writes it.
    pub(super) fn finish(&self, stand: &Stand, laid: Laid, path: &Path) -> anyhow::Result<Made> {
        let Laid { frame, mut heights, zero_m } = laid;
        let resolution = self.settings.resolution_px_per_m;
        let measured = heights.clone();
        let ground = match &self.terrain {
            Some(terrain) => {
                let terrain = terrain.on(&frame, Reading::Bilinear, zero_m)?;
                fill(&mut heights, &terrain);
                ground_height(&terrain, resolution)
            }
            None => ground_height(&heights, resolution),
        };
        let ground_height_m = ground.map(|above| above + zero_m);
        let camera_height_m = match (stand.height_m, ground_height_m) {
            (Some(height), _) => height,
            (None, Some(ground)) => ground + self.settings.ground_offset_m,
            (None, None) => {
                let (lon_deg, lat_deg) = (stand.lon_deg, stand.lat_deg);
                return Err(HeightMapError::NoGround { reach_m: GROUND_REACH_M, lon_deg, lat_deg }.into());
            }
        };
        let lift = zero_m - camera_height_m;
        heights.data_mut().iter_mut().for_each(|h| *h = (f64::from(*h) + lift) as f32);
        let mean = mean_distance_m(&heights, resolution)
            .context("the source has no height anywhere in the tile: check position and coordinate systems")?;
        let (scene_scale_m, normalized) = match self.settings.normalize {
            Normalize::None => (mean, false),
            Normalize::Auto => (mean, true),
            Normalize::By(s) => (s, true),
        };
        let tags = Tags {
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
            interpolation: format!("{:?}", self.settings.reading).to_lowercase(),
            request: self.request(stand),
        };
        let confidence = self.confidence.as_ref().map(|raster| match raster {
            Some(raster) => raster.confidence(&frame, &heights),
            None => Ok(presence(&measured, &heights)),
        });
        let crs = frame.crs().map_or_else(|| frame.wkt(), |crs| crs.horizontal_definition());
        write(path, &tags, &heights, confidence.transpose()?.as_ref(), frame.geotransform(), &crs, self.overwrite)?;
        if self.previews {
            write_preview(&path.with_extension("png"), &heights, resolution)?;
        }
        let void = heights.data().iter().filter(|h| h.is_nan()).count();
        let height_range_m = raster::height_percentiles(&heights, 0.0, 100.0).unwrap_or((f32::NAN, f32::NAN));
        Ok(Made {
            path: path.to_owned(),
            tags,
            void_share: void as f64 / heights.data().len().max(1) as f64,
            height_range_m,
        })
    }
}

/// The hash of Fowler, Noll and Vo, the same in every build.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// A file's name, size and time.
fn stamp(path: &Path) -> String {
    let meta = std::fs::metadata(path).ok();
    let modified = meta.as_ref().and_then(|m| m.modified().ok());
    let seconds = modified.and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok()).map_or(0, |d| d.as_secs());
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    format!("{name} {} {seconds}; ", meta.map_or(0, |m| m.len()))
}

/// The raster of confidences that is asked for; `None` where the source itself is to tell.
fn confidence(asked: &Path, source_path: &Path, source: &Source) -> anyhow::Result<Option<RasterSource>> {
    let open = |path: &Path| RasterSource::open(path, None, Some(crs::VerticalDatum::Ellipsoid));
    if asked != Path::new(AUTO) {
        return open(asked).map(Some);
    }
    let beside = source_path.with_file_name(CONFIDENCE);
    match source {
        Source::Raster(_) if beside.is_file() => open(&beside).map(Some),
        _ => Ok(None),
    }
}

/// 1 where the source has a height, 0 where only the terrain model has one.
fn presence(measured: &Grid<f32>, heights: &Grid<f32>) -> Grid<f32> {
    let mut confidence = heights.clone();
    for (value, own) in confidence.data_mut().iter_mut().zip(measured.data()) {
        if value.is_finite() {
            *value = if own.is_finite() { 1.0 } else { 0.0 };
        }
    }
    confidence
}

fn fill(heights: &mut Grid<f32>, terrain: &Grid<f32>) {
    for (height, ground) in heights.data_mut().iter_mut().zip(terrain.data()) {
        if height.is_nan() {
            *height = *ground;
        }
    }
}

fn write(
    path: &Path,
    tags: &Tags,
    heights: &Grid<f32>,
    confidence: Option<&Grid<f32>>,
    geotransform: raster::GeoTransform,
    crs: &str,
    overwrite: bool,
) -> anyhow::Result<()> {
    let scale = if tags.normalized { tags.scene_scale_m } else { 1.0 };
    let scaled = tags.normalized.then(|| heights.map(|&h| (f64::from(h) / scale) as f32));
    let description = if tags.normalized { "height_above_camera_scene_units" } else { "height_above_camera_m" };
    let mut bands = vec![Band { description, data: BandData::F32(scaled.as_ref().unwrap_or(heights)) }];
    if let Some(confidence) = confidence {
        bands.push(Band { description: "confidence_0_to_1", data: BandData::F32(confidence) });
    }
    let tile = MapTile {
        bands: &bands,
        geotransform,
        crs,
        height_from_value: Some(BandScale { scale, offset: tags.camera_height_m }),
        metadata: &tags.items(),
    };
    Ok(write_map_tile(path, &tile, overwrite)?)
}

/// A relief whose light comes from the upper left of the picture. It is made anew with its map.
fn write_preview(path: &Path, heights: &Grid<f32>, resolution_px_per_m: f64) -> anyhow::Result<()> {
    let pixel_m = 1.0 / resolution_px_per_m;
    let shade = raster::hillshade(heights, (pixel_m, pixel_m), Light::default());
    let (low, high) = raster::height_percentiles(heights, COLOURS.0, COLOURS.1).unwrap_or((0.0, 1.0));
    Ok(write_png_rgb(path, &raster::coloured_relief(heights, &shade, low, high), true)?)
}
