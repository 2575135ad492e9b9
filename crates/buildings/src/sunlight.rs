//! Shadows that buildings cast: where the sun stands, and what has a shadow behind it.
//!
//! The sun's direction in the image follows from the image itself. Around each shape, the sides
//! away from the sun have the shadow behind them. Each side pulls by its outward normal, as
//! strongly as it is long and dark outside and as its shape is salient:
//!
//! ```text
//! away from the sun ∝ − Σ weight · length · brightness outside · normal
//! ```
//!
//! Bright and dark surroundings cancel between opposite sides. Two cues follow. A shape is the more
//! salient, the darker it is outside of its sides away from the sun than outside of those towards
//! it; blocks between streets are equally dark on all sides. And a lit pixel is the more likely on
//! a building, if a shadow begins within a few metres away from the sun. Where the shapes disagree
//! about the direction, as in images without shadows, there are no cues.

use numeric::nearest_quantile;
use raster::{Grid, gaussian};
use rayon::prelude::*;

use crate::shapes::Shape;

/// Samples along a side; they keep away from its ends, where the shadows of other sides lie.
const ALONG: usize = 9;
/// Range of the strip outside of a side, metres. Nearer lies the blur of the edge.
const STRIP_M: [f32; 2] = [1.0, 5.0];
/// Step between samples across the strip and along a shadow, metres.
const STEP_M: f32 = 1.0;
/// Least agreement of the shapes about the sun, 0 to 1. Random directions of a hundred shapes agree
/// by a tenth.
const LEAST_COHERENCE: f32 = 0.2;
/// Fewest shapes that tell the direction.
const SHAPES_MIN: usize = 20;
/// Percentiles of the darkest shadows and of lit ground.
const LEVELS: [f64; 2] = [0.03, 0.5];
/// Brightness between these levels up to which a pixel is in shadow, and the width of the
/// transition above half of it: sky light is a quarter to a third of all light.
const SHADOW_LEVEL: f32 = 0.4;

/// Light and shadow of an image.
pub(crate) struct Sunlight {
    /// Unit vector away from the sun (columns, rows).
    away: [f32; 2],
    /// Smoothed image in units of its contrast.
    bright: Grid<f32>,
    gsd_m: f32,
}

impl Sunlight {
    /// Finds the direction of the sun from the shapes of an image; `None` where they disagree.
    pub(crate) fn of(image: &Grid<f32>, shapes: &[Shape], contrast: f32, sigma_px: f32, gsd_m: f32) -> Option<Self> {
        let bright = gaussian(image, sigma_px).map(|value| value / contrast);
        let found = Self { away: [0.0; 2], bright, gsd_m };
        let pulls: Vec<[f32; 2]> = shapes.par_iter().map(|shape| found.pull(shape)).collect();
        let (mut sum, mut total) = ([0.0f64; 2], 0.0f64);
        for [x, y] in &pulls {
            sum = [sum[0] + f64::from(*x), sum[1] + f64::from(*y)];
            total += f64::from(x.hypot(*y));
        }
        let length = sum[0].hypot(sum[1]);
        let agrees = length > f64::from(LEAST_COHERENCE) * total && pulls.len() >= SHAPES_MIN;
        agrees.then(|| Self { away: sum.map(|s| (s / length) as f32), ..found })
    }

    /// Returns how strongly the darkness around a shape pulls, and where to.
    fn pull(&self, shape: &Shape) -> [f32; 2] {
        let mut sum = [0.0; 2];
        for (start, side, normal) in shape.outer_sides() {
            let length = side[0].hypot(side[1]);
            if let Some(outside) = self.outside(start, side, normal) {
                let force = -shape.weight * length * outside;
                sum = [sum[0] + force * normal[0], sum[1] + force * normal[1]];
            }
        }
        sum
    }

    /// Returns the mean brightness of the strip outside of a side.
    fn outside(&self, start: [f32; 2], side: [f32; 2], normal: [f32; 2]) -> Option<f32> {
        let (mut sum, mut count) = (0.0, 0);
        let mut far_m = STRIP_M[0];
        while far_m <= STRIP_M[1] {
            let far = far_m / self.gsd_m;
            for k in 0..ALONG {
                let t = 0.1 + 0.8 * k as f32 / (ALONG - 1) as f32;
                let at = [0, 1].map(|i| start[i] + t * side[i] + far * normal[i]);
                if let Some(value) = self.value(at) {
                    sum += value;
                    count += 1;
                }
            }
            far_m += STEP_M;
        }
        (count > 0).then(|| sum / count as f32)
    }

    fn value(&self, at: [f32; 2]) -> Option<f32> {
        let [column, row] = at.map(f32::round);
        let is_inside = column >= 0.0 && row >= 0.0;
        let value = is_inside.then(|| self.bright.get(column as usize, row as usize).copied()).flatten()?;
        value.is_finite().then_some(value)
    }

    /// Returns the factor on the saliency of a shape: above 1 where it is darker behind the sides
    /// away from the sun than in front of those towards it.
    pub(crate) fn factor(&self, shape: &Shape) -> f32 {
        // Sums of brightness and of lengths, away from the sun and towards it.
        let (mut values, mut lengths) = ([0.0f32; 2], [0.0f32; 2]);
        for (start, side, normal) in shape.outer_sides() {
            let along = normal[0] * self.away[0] + normal[1] * self.away[1];
            if let Some(outside) = self.outside(start, side, normal) {
                let length = along.abs() * side[0].hypot(side[1]);
                values[usize::from(along < 0.0)] += length * outside;
                lengths[usize::from(along < 0.0)] += length;
            }
        }
        if lengths.iter().any(|length| *length <= 0.0) {
            return 1.0;
        }
        (values[1] / lengths[1] - values[0] / lengths[0]).exp()
    }

    /// Returns for each pixel, 0 to 1, whether it is lit and a shadow lies within `reach_m` away
    /// from the sun.
    pub(crate) fn support(&self, reach_m: f32, sigma_px: f32) -> Grid<f32> {
        let dark = self.shadows();
        let (width, height) = (dark.width(), dark.height());
        let mut behind = Grid::filled(width, height, 0.0f32);
        let mut far_m = STEP_M;
        while far_m <= reach_m {
            let [dx, dy] = self.away.map(|part| (part * far_m / self.gsd_m).round() as i64);
            behind.data_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
                let Ok(from) = usize::try_from(y as i64 + dy) else { return };
                for (x, value) in row.iter_mut().enumerate() {
                    let shadow = usize::try_from(x as i64 + dx).ok().and_then(|column| dark.get(column, from));
                    *value = value.max(shadow.copied().unwrap_or(0.0));
                }
            });
            far_m += STEP_M;
        }
        let mut support = gaussian(&behind, sigma_px);
        support.data_mut().iter_mut().zip(dark.data()).for_each(|(value, dark)| *value *= 1.0 - dark);
        support
    }

    /// Returns for each pixel, 0 to 1, whether it lies in shadow; 0 where it has no value.
    fn shadows(&self) -> Grid<f32> {
        let mut known: Vec<f32> = self.bright.data().iter().copied().filter(|v| v.is_finite()).collect();
        let levels = LEVELS.map(|share| nearest_quantile(&mut known, share).unwrap_or(0.0));
        let lit = SHADOW_LEVEL * (levels[1] - levels[0]).max(f32::MIN_POSITIVE);
        let top = levels[0] + lit;
        self.bright.map(|value| if value.is_finite() { ((top - value) / (0.5 * lit)).clamp(0.0, 1.0) } else { 0.0 })
    }
}
