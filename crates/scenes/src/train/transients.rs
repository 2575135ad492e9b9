//! Pixels that one view does not share with the others: vehicles, moved shadows, clouds.
//!
//! A pixel is transient where the model stays unlike the image there, although other views that see
//! the same place agree with the model. What no view explains is an error of the model and keeps
//! pulling.

use ::train::{Drawing, Registers, SurfelCamera, SurfelImages, TrainingState, TrainingView};
use numeric::upper_median;
use rayon::prelude::*;

/// Pixels around a pixel over which errors are averaged, in each direction.
const RADIUS: usize = 2;
/// Robust standard deviations above the median error from which on a pixel is unexplained.
const LIMIT: f64 = 4.0;
/// Standard deviation of a normal distribution in median absolute deviations.
const NMAD: f64 = 1.4826;
/// Distance along the line of sight within which another view sees the same place, sizes of a pixel
/// there: heights that images of a size of pixel give are off by one or two of them.
const SAME_PIXELS: f64 = 3.0;

/// A view as the model shows it.
struct Explained {
    images: SurfelImages,
    /// Mean error around each pixel; NaN without one.
    error: Vec<f32>,
    /// Error from which on a pixel is unexplained.
    limit: f32,
}

/// Returns for each view which of its pixels are transient. `views` are the first views of the
/// training.
pub(super) fn find_transients<C: SurfelCamera>(state: &TrainingState, views: &[TrainingView<C>]) -> Vec<Vec<bool>> {
    let explained: Vec<Explained> =
        views.iter().enumerate().map(|(number, view)| Explained::new(state, number, view)).collect();
    (0..views.len()).map(|number| transient(number, views, &explained)).collect()
}

impl Explained {
    fn new<C: SurfelCamera>(state: &TrainingState, number: usize, view: &TrainingView<C>) -> Self {
        let drawing = Drawing::new(state.seen(&view.camera, &mut Vec::new()), &view.camera, Registers::Longest);
        let images = drawing.images().clone();
        let look = state.appearance[number];
        let one = |pixel: usize| {
            if view.mask.as_ref().is_some_and(|mask| !mask[pixel]) {
                return f32::NAN;
            }
            let error = |k: usize| {
                let shown = look.gain[k] * images.colour[k][pixel] + look.offset[k] * images.coverage[pixel];
                (shown - view.colour[k][pixel]).abs()
            };
            (error(0) + error(1) + error(2)) / 3.0
        };
        let plain: Vec<f32> = (0..images.coverage.len()).into_par_iter().map(one).collect();
        let error = averaged(&plain, images.size);
        let mut sorted: Vec<f64> = error.iter().filter(|e| e.is_finite()).map(|e| f64::from(*e)).collect();
        let middle = upper_median(&mut sorted).unwrap_or(f64::INFINITY);
        let mut apart: Vec<f64> = sorted.iter().map(|e| (e - middle).abs()).collect();
        let spread = upper_median(&mut apart).unwrap_or(0.0);
        Self { images, error, limit: (middle + LIMIT * NMAD * spread) as f32 }
    }
}

/// Returns the means of squares around pixels, over those that are finite; NaN at the others.
fn averaged(values: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    let one = |pixel: usize| {
        if !values[pixel].is_finite() {
            return f32::NAN;
        }
        let (x, y) = (pixel % width, pixel / width);
        let (mut sum, mut count) = (0.0f32, 0.0f32);
        for row in y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height) {
            for column in x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width) {
                let value = values[row * width + column];
                if value.is_finite() {
                    (sum, count) = (sum + value, count + 1.0);
                }
            }
        }
        sum / count
    };
    (0..values.len()).into_par_iter().map(one).collect()
}

fn transient<C: SurfelCamera>(number: usize, views: &[TrainingView<C>], explained: &[Explained]) -> Vec<bool> {
    let (camera, own) = (&views[number].camera, &explained[number]);
    let width = own.images.size[0];
    let one = |pixel: usize| {
        if own.error[pixel].is_nan() || own.error[pixel] <= own.limit {
            return false;
        }
        let depth = f64::from(own.images.depth_m[pixel] / own.images.coverage[pixel]);
        let Some(place) = camera.point([(pixel % width) as f64, (pixel / width) as f64], depth) else { return false };
        let agrees = |other: usize| agreement(place, &views[other].camera, &explained[other]);
        let votes: Vec<bool> = (0..views.len()).filter(|&other| other != number).filter_map(agrees).collect();
        let agreed = votes.iter().filter(|vote| **vote).count();
        2 * agreed > votes.len()
    };
    (0..own.error.len()).into_par_iter().map(one).collect()
}

/// Returns whether a view that sees a place agrees with the model there; `None` where it does not
/// see the place.
fn agreement<C: SurfelCamera>(place: [f64; 3], camera: &C, seen: &Explained) -> Option<bool> {
    let local = camera.local(0, place)?;
    let [width, height] = seen.images.size;
    let [x, y] = local.pixel.map(f64::round);
    if !(x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64) {
        return None;
    }
    let pixel = y as usize * width + x as usize;
    let depth = f64::from(seen.images.depth_m[pixel] / seen.images.coverage[pixel]);
    let error = seen.error[pixel];
    let [here, beside] = [x, x + 1.0].map(|x| camera.point([x, y], local.depth_m));
    let size_m = here.zip(beside).map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt())?;
    ((depth - local.depth_m).abs() < SAME_PIXELS * size_m && error.is_finite()).then_some(error <= seen.limit)
}
