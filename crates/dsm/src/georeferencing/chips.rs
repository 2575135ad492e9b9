//! Image chips of ground points: the places at which the images show them.
//!
//! The camera says where an image should show the point; the chip is searched for around that
//! place, as far as the pointing may be off. The pixels of chip and image are compared on the
//! ground at the point's height where the chip has a place on a map or an RPC, and as they are
//! otherwise.

use std::collections::BTreeSet;

use camera::{ImagePoint, RpcCamera};
use crs::MapProjection;
use formats::ground_points::{GroundPoint, ImageChip};
use formats::raster::ImageSource;
use geodesy::LonLatHeight;
use raster::{GeoTransform, Grid, Window};
use sweep::pointing::{AdjustConfig, Chip, ChipConfig, ChipPlace, ChipSearch, Track, find_chip};

use crate::error::{DsmError, DsmSetting};
use crate::images::image_pixels::read_view;
use crate::images::scene_image::SceneImage;
use crate::notes::Notes;
use crate::report::ChipReport;

/// Radius of the search, standard deviations of the raw pointing and of the point's position.
const SEARCH_DEVIATIONS: f64 = 3.0;
/// Greatest radius of the search, pixels.
const SEARCH_PX_MAX: f64 = 200.0;
/// Part of a chip that is read around its point, pixels to each side.
const CHIP_REACH: usize = 128;
/// Distance of the places whose differences make a local map, pixels and metres.
const STEP: f64 = 8.0;

/// A chip that has been read.
struct OpenChip {
    image: Grid<f32>,
    /// Place of the point in `image`.
    point: [f64; 2],
    ground: ChipGround,
}

/// How the pixels of a chip lie on the ground.
enum ChipGround {
    /// Unknown: they are taken for those of the image.
    Pixels,
    /// On a map, by the georeference of the image.
    Map(GeoTransform, MapProjection),
    /// Seen by a camera, in the frame of the image.
    Camera(Box<RpcCamera>),
}

/// Adds the places at which the chip of a point is found to its places in images, and returns what
/// became of the search in each image. Misses are a warning.
///
/// # Errors
/// [`DsmError::Value`] for a chip without the place that is given, [`DsmError::Image`] for a
/// image that cannot be read, [`DsmError::Crs`].
pub(crate) fn find_places(
    point: &GroundPoint,
    ground: LonLatHeight,
    images: &[SceneImage],
    seen: &mut Track,
    notes: &mut Notes<'_>,
) -> Result<Vec<ChipReport>, DsmError> {
    let Some(chip) = &point.chip else { return Ok(Vec::new()) };
    let chip = OpenChip::read(chip, &point.name)?;
    let mut reports = Vec::new();
    let measured: BTreeSet<usize> = seen.iter().map(|(view, _)| *view).collect();
    for (view, image) in images.iter().enumerate().filter(|(view, _)| !measured.contains(view)) {
        let Some(found) = chip.find_in(image, ground, point.horizontal_m.max(point.vertical_m))? else { continue };
        let (name, image) = (point.name.clone(), image.path.file_name().unwrap_or_default().display().to_string());
        reports.push(match found {
            Ok((place, score)) => {
                seen.push((view, place));
                ChipReport { name, image, place: Some(place), score: Some(score), reason: None }
            }
            Err(reason) => ChipReport { name, image, place: None, score: None, reason: Some(reason) },
        });
    }
    seen.sort_by_key(|(view, _)| *view);
    let missed = |report: &ChipReport| Some(format!("{}: {}", report.image, report.reason.as_ref()?));
    let missed: Vec<String> = reports.iter().filter_map(missed).collect();
    if !missed.is_empty() {
        notes.warn(format!(
            "the chip of the ground point {} is not found in {} of {} images: {}",
            point.name,
            missed.len(),
            reports.len(),
            missed.join("; ")
        ));
    }
    Ok(reports)
}

/// A place with its correlation, or the reason why there is none.
type Found = Result<(ImagePoint, f64), String>;

impl OpenChip {
    fn read(chip: &ImageChip, name: &str) -> Result<Self, DsmError> {
        let source = ImageSource::open(&chip.path)?;
        let info = source.info().clone();
        let centre = [info.width, info.height].map(|side| 0.5 * (side as f64 - 1.0));
        let place = chip.place.map_or(centre, |place| [place.sample, place.line]);
        let is_inside = (0.0..info.width as f64).contains(&place[0]) && (0.0..info.height as f64).contains(&place[1]);
        if !is_inside {
            let found = format!("{name} at sample {}, line {} of {}", place[0], place[1], chip.path.display());
            let expected = format!("a place inside of the {} x {} pixels of the chip", info.width, info.height);
            return Err(DsmError::value(DsmSetting::Control, found, expected));
        }
        let pixel = Window { x: place[0] as i64, y: place[1] as i64, width: 1, height: 1 };
        let around = pixel.grown(CHIP_REACH).intersection(&source.window()).unwrap_or(pixel);
        let image = source.read_luma(around)?.luma;
        let origin = ImagePoint::new(around.x as f64, around.y as f64);
        let ground = match (info.geotransform, &info.crs_wkt) {
            (Some(map), Some(wkt)) => {
                ChipGround::Map(map.shifted(origin.sample, origin.line), MapProjection::from_definition(wkt)?)
            }
            // An image without an RPC is compared as it is.
            _ => match formats::rpc::read_for_image(&chip.path) {
                Ok(found) => ChipGround::Camera(Box::new(RpcCamera::new(found.rpc).cropped(origin))),
                Err(_) => ChipGround::Pixels,
            },
        };
        Ok(Self { image, point: [place[0] - origin.sample, place[1] - origin.line], ground })
    }

    /// Searches an image; `None` where the camera does not expect the point in it.
    fn find_in(&self, image: &SceneImage, ground: LonLatHeight, accuracy_m: f64) -> Result<Option<Found>, DsmError> {
        let Ok(expected) = image.camera.project(ground) else { return Ok(None) };
        let image_from_metres = metric_jacobian(|at| image.camera.project(at).ok(), ground);
        let Some((image_from_chip, px_per_m)) =
            image_from_metres.and_then(|metres| Some((self.image_from_chip(image, ground)?, side(metres))))
        else {
            return Ok(Some(Err("the chip has no place on the ground where the image has one".to_owned())));
        };
        let off_px = AdjustConfig::default().prior_px + accuracy_m * px_per_m;
        let reach_px = (SEARCH_DEVIATIONS * off_px).min(SEARCH_PX_MAX);
        // The compared part reaches as far beyond the search.
        let beyond = ChipConfig::default().radius_max as f64 * side(image_from_chip).clamp(1.0, 16.0) * 1.5;
        let (reach, at) = ((reach_px + beyond).ceil() as usize + 4, [expected.sample.floor(), expected.line.floor()]);
        let is_near = |at: f64, size: usize| (-reach_px..size as f64 + reach_px).contains(&at);
        if !is_near(at[0], image.size.0) || !is_near(at[1], image.size.1) {
            return Ok(None);
        }
        let pixel = Window { x: at[0] as i64, y: at[1] as i64, width: 1, height: 1 };
        let Some(window) = pixel.grown(reach).intersection(&image.whole()) else { return Ok(None) };
        let view = read_view(image, window)?;
        let search = ChipSearch {
            image: &view.levels[0],
            expected: [expected.sample - window.x as f64, expected.line - window.y as f64],
            reach_px,
            image_from_chip,
        };
        let chip = Chip { image: &self.image, point: self.point };
        let placed = |ChipPlace { place, score }| {
            let [sample, line] = [place[0] + window.x as f64, place[1] + window.y as f64];
            (ImagePoint::new(sample, line), f64::from(score))
        };
        Ok(Some(find_chip(chip, &search, &ChipConfig::default()).map(placed).map_err(|miss| miss.to_string())))
    }

    /// Returns the local map from the pixels of the chip to those of an image, at the point's
    /// height.
    fn image_from_chip(&self, image: &SceneImage, ground: LonLatHeight) -> Option<[[f64; 2]; 2]> {
        let on_ground = |[x, y]: [f64; 2]| -> Option<LonLatHeight> {
            match &self.ground {
                ChipGround::Pixels => None,
                ChipGround::Map(map, projection) => {
                    let (x, y) = map.map_from_cell(x, y);
                    let (lon, lat) = projection.lonlat_from_map(x, y).ok()?;
                    Some(LonLatHeight::new(lon, lat, ground.height_m))
                }
                ChipGround::Camera(camera) => camera.localize(ImagePoint::new(x, y), ground.height_m).ok(),
            }
        };
        if matches!(self.ground, ChipGround::Pixels) {
            return Some([[1.0, 0.0], [0.0, 1.0]]);
        }
        let [x, y] = self.point;
        jacobian(|[i, j]| image.camera.project(on_ground([x + i, y + j])?).ok())
    }
}

/// Returns the local map from metres east and north of a ground point to pixels.
fn metric_jacobian(
    project: impl Fn(LonLatHeight) -> Option<ImagePoint>,
    ground: LonLatHeight,
) -> Option<[[f64; 2]; 2]> {
    let frame = geodesy::EnuFrame::new(ground);
    jacobian(|[east, north]| project(frame.ground_from_enu(geodesy::EnuPoint { east, north, up: 0.0 })))
}

/// Returns the derivatives of an image position by two coordinates, by central differences.
fn jacobian(image: impl Fn([f64; 2]) -> Option<ImagePoint>) -> Option<[[f64; 2]; 2]> {
    let along = |by: [f64; 2]| {
        let (before, after) = (image(by.map(|v| -v))?, image(by)?);
        Some([after.sample - before.sample, after.line - before.line].map(|v| v / (2.0 * STEP)))
    };
    let ([a, c], [b, d]) = (along([STEP, 0.0])?, along([0.0, STEP])?);
    Some([[a, b], [c, d]])
}

/// Returns the factor of lengths of a local map.
fn side([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
    (a * d - b * c).abs().sqrt()
}
