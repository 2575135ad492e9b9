//! First stage of a run: the images by their headers and RPCs.

use std::ops::Range;
use std::path::{Path, PathBuf};

use camera::RpcCamera;
use serde::{Deserialize, Serialize};

use formats::raster::{BandChoice, ImageSource, LumaRule, SampleType};
use numeric::{Progress, order_statistic};
use raster::Window;

use crate::config::DsmConfig;
use crate::error::DsmError;
use crate::images::doubts::doubts;
use crate::images::image_mask::masks_of_images;
use crate::images::image_pixels::open_source;
use crate::images::order::sort_by_content;
use crate::images::scene_image::SceneImage;
use crate::masks::ground_mask::check_masks;

/// Shares of the values below and above the spread of an image.
const SPREAD: [f64; 2] = [0.02, 0.98];
/// Spreads of the grey values of sensors, from 8 bits in haze to 16 bits.
const USUAL_SPREAD: Range<f32> = 32.0..65_536.0;

/// First stage of a run: the images, known by their headers and RPCs. No pixel has been read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Opened {
    /// Images with the cameras of their providers, in an order that follows from their content.
    pub images: Vec<SceneImage>,
}

/// Opens the images of a run and finds their RPCs.
///
/// # Errors
/// [`DsmError::Image`] for a file that is no image, [`DsmError::Rpc`] for an image without a usable
/// RPC, [`DsmError::SameImage`] for two images with the same camera, [`DsmError::Value`] for a mask
/// of none of the images.
pub fn open(config: &DsmConfig) -> Result<Opened, DsmError> {
    check_masks(config)?;
    let masks = masks_of_images(&config.image_masks, &config.images)?;
    let opened = config.images.iter().zip(masks).enumerate();
    let opened = opened.map(|(number, (path, masks))| open_one(path, number, config.band.as_ref(), masks));
    let mut images = opened.collect::<Result<Vec<_>, _>>()?;
    // A copy has another name and the same camera, which no two images share.
    let is_copy = |(i, image): &(usize, &SceneImage)| {
        images[..*i].iter().any(|other| other.camera == image.camera && other.size == image.size)
    };
    if let Some((_, image)) = images.iter().enumerate().find(is_copy) {
        return Err(DsmError::SameImage { path: image.path.clone() });
    }
    sort_by_content(&mut images);
    Ok(Opened { images })
}

impl Opened {
    /// Tells what is doubtful about the images by themselves.
    pub(crate) fn warn(&self, progress: &dyn Progress) {
        self.images.iter().flat_map(|image| &image.doubts).for_each(|doubt| progress.warn(doubt));
    }
}

fn open_one(
    path: &Path,
    number: usize,
    band: Option<&BandChoice>,
    masks: Vec<PathBuf>,
) -> Result<SceneImage, DsmError> {
    let source = open_source(path, band)?;
    let file = formats::rpc::read_for_image(path)?;
    let doubts = doubts(&source, &file)?;
    Ok(SceneImage {
        path: path.to_owned(),
        number,
        rpc_format: file.format.to_string(),
        size: (source.info().width, source.info().height),
        camera: RpcCamera::new(file.rpc),
        acquired_s: source.acquired_s(),
        satellite: source.satellite(),
        sun: source.sun(),
        stated_incidence_deg: source.item().and_then(|item| item.incidence_deg),
        gain: match source.info().sample {
            SampleType::F32 | SampleType::F64 => gain(&source)?,
            _ => 1.0,
        },
        band: match &source.info().luma {
            LumaRule::Single(position) => band.map(|_| *position),
            _ => None,
        },
        masks,
        doubts,
    })
}

/// Returns the power of two that brings the spread of a float image's values near that of sensors;
/// 1 where it is near already, or unknown.
fn gain(source: &ImageSource) -> Result<f32, DsmError> {
    /// Windows that are looked at, on a side, and their side in pixels.
    const WINDOWS: usize = 3;
    const SIDE: usize = 256;
    let (width, height) = (source.info().width, source.info().height);
    let start = |i: usize, size: usize| (size.saturating_sub(SIDE) * i / (WINDOWS - 1)) as i64;
    let mut values = Vec::new();
    for j in 0..WINDOWS {
        for i in 0..WINDOWS {
            let (x, y) = (start(i, width), start(j, height));
            let window = Window { x, y, width: SIDE.min(width), height: SIDE.min(height) };
            let tile = source.read_luma(window)?.luma;
            values.extend(tile.data().iter().copied().filter(|value| value.is_finite() && *value != 0.0));
        }
    }
    let last = values.len().saturating_sub(1) as f64;
    let mut quantile = |share: f64| order_statistic(&mut values, (share * last) as usize);
    let (Some(low), Some(high)) = (quantile(SPREAD[0]), quantile(SPREAD[1])) else { return Ok(1.0) };
    let spread = high - low;
    if spread.is_nan() || spread <= 0.0 || USUAL_SPREAD.contains(&spread) {
        return Ok(1.0);
    }
    let power = (USUAL_SPREAD.end / USUAL_SPREAD.start).sqrt().log2() + USUAL_SPREAD.start.log2() - spread.log2();
    Ok(power.round().clamp(-100.0, 100.0).exp2())
}
