//! The index of each pixel.

use numeric::Progress;
use raster::{Grid, gaussian, height_percentiles};
use rayon::prelude::*;

use crate::config::BuildingIndexConfig;
use crate::error::{BuildingIndexError, Reason, SIDE_MAX};
use crate::gradient::gradients;
use crate::junctions::{BranchLimits, junctions};
use crate::shadow::black_top_hat;
use crate::shapes::{ShapeLimits, coverage, shapes};
use crate::sunlight::Sunlight;

/// Least smoothing before gradients, pixels: below it gradients have few directions.
const SMOOTHING_PX: f64 = 0.8;
/// Smoothing before light and shadow are told apart, metres: less than the narrowest shadow.
const LIGHT_SMOOTHING_M: f64 = 0.5;
/// Percentiles of the image between which its contrast is measured.
const CONTRAST: (f64, f64) = (10.0, 90.0);

/// A building index.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct BuildingIndex {
    /// Index of each pixel, 0 to 1; NaN where the image has no value.
    pub index: Grid<f32>,
    /// Junctions that were found.
    pub junctions: usize,
    /// Junctions that another one supports as a corner of the same shape.
    pub pairs: usize,
}

/// Computes the building index of an image whose pixels measure `gsd_m`. NaN is no-data.
///
/// ```
/// use buildings::{BuildingIndexConfig, building_index};
/// use numeric::Silent;
/// use raster::Grid;
///
/// let mut image = Grid::filled(120, 120, 50.0f32);
/// for row in 40..80 {
///     image.row_mut(row)[35..85].fill(200.0);
/// }
/// let found = building_index(&image, 0.5, &BuildingIndexConfig::default(), &Silent)?;
/// assert!(found.index[(60, 60)] > 0.5 && found.index[(10, 60)] < 0.1);
/// # Ok::<(), buildings::BuildingIndexError>(())
/// ```
///
/// # Errors
/// [`BuildingIndexError`] for a parameter outside of its range, for pixels that are too coarse or
/// too fine, and when the caller asked to stop.
pub fn building_index(
    image: &Grid<f32>,
    gsd_m: f64,
    config: &BuildingIndexConfig,
    progress: &dyn Progress,
) -> Result<BuildingIndex, BuildingIndexError> {
    config.validate()?;
    let (finest_m, coarsest_m) = (config.most_side_m / SIDE_MAX as f64, config.least_side_m / 4.0);
    if !(gsd_m >= finest_m && gsd_m <= coarsest_m) {
        return Err(Reason::Scale { gsd_m, finest_m, coarsest_m }.into());
    }
    let pixels = |length_m: f64| length_m / gsd_m;
    let area = |area_m2: f64| (area_m2 / (gsd_m * gsd_m)) as f32;
    progress.begin("building index", 3);
    let slopes = gradients(image, pixels(config.smoothing_m).max(SMOOTHING_PX) as f32);
    progress.step();
    progress.check_cancelled()?;
    let branches = BranchLimits {
        least_px: pixels(config.least_side_m).ceil() as usize,
        most_px: pixels(config.most_side_m).floor() as usize,
        gap_px: pixels(config.gap_m).round() as usize,
        log_false_alarms: config.log_false_alarms as f32,
    };
    let found = junctions(&slopes, &branches);
    progress.step();
    progress.check_cancelled()?;
    let limits = ShapeLimits {
        least_px2: area(config.least_area_m2),
        most_px2: area(config.most_area_m2),
        half_px2: area(config.half_area_m2),
        spread_deg: config.angle_spread_deg as f32,
        tolerance_px: pixels(config.tolerance_m) as f32,
    };
    let (mut shapes, pairs) = shapes(&found, &slopes, &limits);
    let (low, high) = height_percentiles(image, CONTRAST.0, CONTRAST.1).unwrap_or((0.0, 0.0));
    let (contrast, half) = ((high - low).max(f32::MIN_POSITIVE), config.half_saliency as f32);
    let light_px = pixels(LIGHT_SMOOTHING_M).max(SMOOTHING_PX) as f32;
    let sunlight = Sunlight::of(image, &shapes, contrast, light_px, gsd_m as f32);
    if let Some(sunlight) = &sunlight {
        shapes.par_iter_mut().for_each(|shape| shape.weight *= sunlight.factor(shape));
    }
    let mut index = coverage(&shapes, image.width(), image.height());
    if let Some(sunlight) = &sunlight {
        let support = sunlight.support(config.cast_m as f32, light_px);
        let gain = config.cast_gain as f32;
        index.data_mut().iter_mut().zip(support.data()).for_each(|(value, cast)| *value *= 1.0 + gain * cast);
    }
    let shadow = black_top_hat(image, pixels(0.5 * config.shadow_m).round() as usize);
    index.data_mut().iter_mut().zip(shadow.data()).for_each(|(value, darker)| {
        let saliency = *value * (-darker / contrast).exp();
        *value = saliency / (saliency + half);
    });
    let index = gaussian(&index, pixels(config.blur_m) as f32);
    progress.step();
    Ok(BuildingIndex { index, junctions: found.len(), pairs })
}
