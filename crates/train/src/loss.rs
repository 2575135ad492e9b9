//! The loss of a drawing against a view, and its gradient by the images.
//!
//! All terms are means over pixels, so that images of any size count alike:
//! L = L_colour + λ L_mask + λ L_distortion + λ L_consistency + λ L_depth + λ L_normal + λ L_r. The
//! colour term is λ |e| + λ e² + λ (1 − SSIM). The
//! terms with priors are those of GS4Buildings: |M|⁻¹ Σ |D̂ − s D| with a learned scale s, and
//! |M|⁻¹ Σ (1 − ⟨N̂, N⟩). L_r = 1 − r with Pearson's correlation r is that of SkySplat, for depths
//! whose scale and zero are unknown.

use crate::config::LossWeights;
use crate::image::{DepthSpread, SurfelImages};
use crate::normals::Consistency;
use crate::ssim::{Channel, Similarity};
use crate::view::SurfelCamera;

/// Coverage below which a pixel has no depth to compare.
const LEAST_COVERAGE: f32 = 0.1;

/// What a view shows, by rows.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingView<C> {
    /// The camera.
    pub camera: C,
    /// Red, green, blue; 0 to 1. NaN where the image has no data.
    pub colour: [Vec<f32>; 3],
    /// Whether a pixel belongs to what is modelled. Elsewhere the model has to be empty. All pixels
    /// belong to it when `None`.
    pub mask: Option<Vec<bool>>,
    /// Depths of a prior model, metres; NaN where it has none.
    pub prior_depth_m: Option<Vec<f32>>,
    /// Unit normals of a prior model in the local frame; NaN where it has none.
    pub prior_normal: Option<[Vec<f32>; 3]>,
    /// Depths of any scale and from any zero, such as a network's; NaN where there is none.
    pub relative_depth: Option<Vec<f32>>,
}

impl<C> TrainingView<C> {
    /// A view of a picture alone.
    pub fn new(camera: C, colour: [Vec<f32>; 3]) -> Self {
        Self { camera, colour, mask: None, prior_depth_m: None, prior_normal: None, relative_depth: None }
    }
}

/// What belongs to an image rather than to the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewAppearance {
    /// Factors of red, green and blue.
    pub gain: [f32; 3],
    /// What is added to red, green and blue where the model covers the image.
    pub offset: [f32; 3],
}

impl ViewAppearance {
    /// Colours as they are.
    pub const PLAIN: Self = Self { gain: [1.0; 3], offset: [0.0; 3] };
}

/// The terms of a loss without their weights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LossTerms {
    /// Colour.
    pub colour: f64,
    /// Mean squared difference of colours, for the signal-to-noise ratio.
    pub squared: f64,
    /// One less the structural similarity; 0 where its weight is.
    pub dissimilarity: f64,
    /// Coverage against the mask.
    pub mask: f64,
    /// Spread of the depths of a ray; 0 where its weight is.
    pub distortion: f64,
    /// Normals of splats against those of depths.
    pub consistency: f64,
    /// Depths against the prior.
    pub prior_depth: f64,
    /// Normals against the prior.
    pub prior_normal: f64,
    /// One less the correlation with depths of unknown scale.
    pub correlation: f64,
    /// Gain and offset of the view against none.
    pub exposure: f64,
    /// Sum with the weights.
    pub total: f64,
}

/// Gradient of a loss by what is learned of a view.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewSlopes {
    /// By gain (red, green, blue) and offset.
    pub appearance: [f32; 6],
    /// By the depth scale.
    pub depth_scale: f32,
}

/// Everything that a loss is computed from.
pub(crate) struct LossInput<'a, C> {
    pub(crate) images: &'a SurfelImages,
    pub(crate) view: &'a TrainingView<C>,
    pub(crate) weights: LossWeights,
    pub(crate) appearance: ViewAppearance,
    /// Factor of the prior depths.
    pub(crate) depth_scale: f32,
    /// Size of the scene, metres.
    pub(crate) extent_m: f64,
}

/// Memory of losses, which is kept from one to the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct LossScratch {
    similarity: Similarity,
    consistency: Consistency,
    /// Whether the colours of a pixel are compared.
    counts: Vec<bool>,
    /// A channel as it is shown and as it is to be, 0 where it is not compared.
    shown: Vec<f32>,
    truth: Vec<f32>,
    /// Gradient by what is shown.
    by_shown: Vec<f32>,
}

impl<C: SurfelCamera> LossInput<'_, C> {
    /// What the distortion of the drawing has to be the spread of.
    pub(crate) fn spread(weights: &LossWeights) -> DepthSpread {
        let wanted = C::PERSPECTIVE && weights.distortion > 0.0;
        if wanted { DepthSpread::InverseDepths } else { DepthSpread::Depths }
    }

    /// Computes the loss, and its gradient into `out`.
    pub(crate) fn compute(&self, scratch: &mut LossScratch, out: &mut SurfelImages) -> (LossTerms, ViewSlopes) {
        out.resize(self.images.size);
        for plane in out.planes_mut() {
            plane.fill(0.0);
        }
        let (mut terms, mut slopes) = (LossTerms::default(), ViewSlopes::default());
        self.colour(scratch, out, &mut terms, &mut slopes);
        self.mask(out, &mut terms);
        self.distortion(out, &mut terms);
        if self.weights.consistency > 0.0 {
            let (images, camera, weight) = (self.images, &self.view.camera, self.weights.consistency);
            terms.consistency = scratch.consistency.add_gradient(images, &images.coverage, camera, weight, out);
        }
        self.prior_depth(out, &mut terms, &mut slopes);
        self.prior_normal(out, &mut terms);
        self.correlation(out, &mut terms);
        self.exposure(&mut terms, &mut slopes);
        let w = &self.weights;
        terms.total = terms.colour
            + w.mask * terms.mask
            + w.distortion * terms.distortion
            + w.consistency * terms.consistency
            + w.prior_depth * terms.prior_depth
            + w.prior_normal * terms.prior_normal
            + w.correlation * terms.correlation
            + w.exposure * terms.exposure;
        (terms, slopes)
    }

    fn is_modelled(&self, pixel: usize) -> bool {
        self.view.mask.as_ref().is_none_or(|mask| mask[pixel])
    }

    fn colour(
        &self,
        scratch: &mut LossScratch,
        out: &mut SurfelImages,
        terms: &mut LossTerms,
        slopes: &mut ViewSlopes,
    ) {
        let LossScratch { similarity, counts, shown, truth, by_shown, .. } = scratch;
        let (target, pixels) = (&self.view.colour, self.images.coverage.len());
        counts.clear();
        counts.extend((0..pixels).map(|p| self.is_modelled(p) && target.iter().all(|c| c[p].is_finite())));
        let seen = counts.iter().filter(|counted| **counted).count();
        let count = seen.max(1) as f64 * 3.0;
        let [absolute, squared, alike] =
            [self.weights.absolute, self.weights.squared, self.weights.similarity].map(|weight| weight as f32);
        let unit = (1.0 / count) as f32;
        let mut similar = 0.0;
        for (k, target) in target.iter().enumerate() {
            let (gain, offset) = (self.appearance.gain[k], self.appearance.offset[k]);
            let (colour, coverage) = (&self.images.colour[k], &self.images.coverage);
            let compared = |value: f32, pixel: usize| if counts[pixel] { value } else { 0.0 };
            truth.clear();
            truth.extend(target.iter().enumerate().map(|(pixel, value)| compared(*value, pixel)));
            shown.clear();
            shown.extend((0..pixels).map(|pixel| compared(gain * colour[pixel] + offset * coverage[pixel], pixel)));
            by_shown.clear();
            let (mut sum, mut squares) = (0.0f64, 0.0f64);
            by_shown.extend(shown.iter().zip(truth.iter()).map(|(shown, truth)| {
                let error = shown - truth;
                sum += f64::from(absolute * error.abs() + squared * error * error);
                squares += f64::from(error * error);
                (absolute * sign(error) + 2.0 * squared * error) * unit
            }));
            if alike > 0.0 {
                let channel = Channel { size: self.images.size, shown, truth, counts };
                similar += similarity.add_gradient(&channel, -alike * unit, by_shown);
            }
            let (mut by_gain, mut by_offset) = (0.0f64, 0.0f64);
            for pixel in (0..pixels).filter(|pixel| counts[*pixel]) {
                let slope = by_shown[pixel];
                out.colour[k][pixel] += slope * gain;
                out.coverage[pixel] += slope * offset;
                by_gain += f64::from(slope * colour[pixel]);
                by_offset += f64::from(slope * coverage[pixel]);
            }
            terms.colour += sum / count;
            terms.squared += squares / count;
            slopes.appearance[k] = by_gain as f32;
            slopes.appearance[3 + k] = by_offset as f32;
        }
        if alike > 0.0 && seen > 0 {
            terms.dissimilarity = 1.0 - similar / count;
            terms.colour += self.weights.similarity * terms.dissimilarity;
        }
    }

    /// The coverage is to be that of the mask: 1 within, 0 elsewhere.
    fn mask(&self, out: &mut SurfelImages, terms: &mut LossTerms) {
        let Some(mask) = &self.view.mask else { return };
        let unit = 1.0 / mask.len().max(1) as f64;
        let slope = (2.0 * self.weights.mask * unit) as f32;
        for (pixel, &modelled) in mask.iter().enumerate() {
            let error = self.images.coverage[pixel] - if modelled { 1.0 } else { 0.0 };
            terms.mask += f64::from(error * error) * unit;
            out.coverage[pixel] += slope * error;
        }
    }

    /// The distortion in units of the size of the scene: of depths for affine cameras, of inverse
    /// depths for others.
    fn distortion(&self, out: &mut SurfelImages, terms: &mut LossTerms) {
        if self.weights.distortion == 0.0 {
            return;
        }
        let size = self.extent_m * self.extent_m;
        let unit = if C::PERSPECTIVE { size } else { 1.0 / size } / self.images.coverage.len().max(1) as f64;
        terms.distortion = self.images.distortion.iter().map(|&d| f64::from(d)).sum::<f64>() * unit;
        out.distortion.fill((self.weights.distortion * unit) as f32);
    }

    fn prior_depth(&self, out: &mut SurfelImages, terms: &mut LossTerms, slopes: &mut ViewSlopes) {
        let Some(prior) = self.view.prior_depth_m.as_ref().filter(|_| self.weights.prior_depth > 0.0) else { return };
        let images = self.images;
        let compared = |pixel: &usize| prior[*pixel].is_finite() && images.coverage[*pixel] > LEAST_COVERAGE;
        let count = (0..prior.len()).filter(compared).count().max(1) as f64;
        let unit = 1.0 / (count * self.extent_m);
        for pixel in (0..prior.len()).filter(compared) {
            let coverage = images.coverage[pixel];
            let depth = images.depth_m[pixel] / coverage;
            let error = depth - self.depth_scale * prior[pixel];
            terms.prior_depth += f64::from(error.abs()) * unit;
            let slope = sign(error) * (self.weights.prior_depth * unit) as f32;
            out.depth_m[pixel] += slope / coverage;
            out.coverage[pixel] -= slope * depth / coverage;
            slopes.depth_scale -= slope * prior[pixel];
        }
    }

    fn prior_normal(&self, out: &mut SurfelImages, terms: &mut LossTerms) {
        let Some(prior) = self.view.prior_normal.as_ref().filter(|_| self.weights.prior_normal > 0.0) else { return };
        let known = |pixel: &usize| prior.iter().all(|c| c[*pixel].is_finite());
        let count = (0..prior[0].len()).filter(known).count().max(1) as f64;
        let slope = (self.weights.prior_normal / count) as f32;
        for pixel in (0..prior[0].len()).filter(known) {
            let along: f32 = (0..3).map(|i| self.images.normal[i][pixel] * prior[i][pixel]).sum();
            terms.prior_normal += f64::from(1.0 - along) / count;
            (0..3).for_each(|i| out.normal[i][pixel] -= slope * prior[i][pixel]);
        }
    }
}

impl<C> LossInput<'_, C> {
    /// Gains are to be 1 and offsets 0: without this, the scene could be as dark as its views are
    /// bright.
    fn exposure(&self, terms: &mut LossTerms, slopes: &mut ViewSlopes) {
        let ViewAppearance { gain, offset } = self.appearance;
        for k in 0..3 {
            let [by_gain, by_offset] = [gain[k] - 1.0, offset[k]];
            terms.exposure += f64::from(by_gain * by_gain + by_offset * by_offset) / 3.0;
            let unit = 2.0 * self.weights.exposure as f32 / 3.0;
            slopes.appearance[k] += unit * by_gain;
            slopes.appearance[3 + k] += unit * by_offset;
        }
    }

    /// One less Pearson's correlation r of the drawn depths d and the relative depths q. With the
    /// deviations d' and q' from their means, ∂r/∂d_i = q'_i / √(Σd'² Σq'²) − r d'_i / Σd'².
    fn correlation(&self, out: &mut SurfelImages, terms: &mut LossTerms) {
        let Some(relative) = self.view.relative_depth.as_ref().filter(|_| self.weights.correlation > 0.0) else {
            return;
        };
        let images = self.images;
        let compared = |pixel: &usize| relative[*pixel].is_finite() && images.coverage[*pixel] > LEAST_COVERAGE;
        let pixels: Vec<usize> = (0..relative.len()).filter(compared).collect();
        let drawn: Vec<f64> = pixels.iter().map(|&p| f64::from(images.depth_m[p] / images.coverage[p])).collect();
        let given: Vec<f64> = pixels.iter().map(|&p| f64::from(relative[p])).collect();
        let (drawn, given) = (deviations(drawn), deviations(given));
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (by_drawn, by_given) = (product(&drawn, &drawn), product(&given, &given));
        let norm = (by_drawn * by_given).sqrt();
        if norm.is_nan() || norm <= 0.0 {
            return;
        }
        let r = product(&drawn, &given) / norm;
        terms.correlation = 1.0 - r;
        for ((&pixel, d), q) in pixels.iter().zip(&drawn).zip(&given) {
            let slope = -self.weights.correlation * (q / norm - r * d / by_drawn);
            let coverage = f64::from(images.coverage[pixel]);
            let depth = f64::from(images.depth_m[pixel]) / coverage;
            out.depth_m[pixel] += (slope / coverage) as f32;
            out.coverage[pixel] -= (slope * depth / coverage) as f32;
        }
    }
}

/// Returns the differences of values from their mean.
fn deviations(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

/// The slope of the absolute value, 0 at 0.
fn sign(value: f32) -> f32 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::PinholeView;

    const SIZE: [usize; 2] = [5, 4];

    fn value(seed: usize, low: f32, high: f32) -> f32 {
        low + (high - low) * ((seed * 7919 + 31) % 1009) as f32 / 1009.0
    }

    fn plane(seed: usize, low: f32, high: f32) -> Vec<f32> {
        (0..20).map(|i| value(seed * 100 + i, low, high)).collect()
    }

    #[test]
    fn gradients_are_differences_of_the_loss() {
        let mut images = SurfelImages::zeros(SIZE);
        for (k, p) in images.planes_mut().into_iter().enumerate() {
            *p = plane(k, 0.3, 0.9);
        }
        let camera = PinholeView {
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            centre: [0.0; 3],
            focal_px: [5.0; 2],
            principal_px: [2.0; 2],
            size: SIZE,
        };
        let mut prior_depth_m = plane(30, 0.5, 1.5);
        prior_depth_m[3] = f32::NAN;
        let view = TrainingView {
            camera,
            colour: [20, 21, 22].map(|k| plane(k, 0.0, 1.0)),
            mask: Some((0..20).map(|i| i % 3 > 0).collect()),
            prior_depth_m: Some(prior_depth_m),
            prior_normal: Some([40, 41, 42].map(|k| plane(k, -1.0, 1.0))),
            relative_depth: Some(plane(50, -3.0, 9.0)),
        };
        // Every term counts. The random depths make normals of any direction, whose slopes are
        // steep.
        let weights = LossWeights {
            absolute: 0.8,
            squared: 0.4,
            similarity: 0.2,
            mask: 0.5,
            distortion: 10.0,
            consistency: 0.02,
            prior_depth: 5.0,
            prior_normal: 0.1,
            correlation: 4.0,
            exposure: 0.1,
        };
        let appearance = ViewAppearance { gain: [1.1, 0.9, 1.0], offset: [0.05, 0.0, -0.05] };
        let held = &images.coverage;
        let loss = |images: &SurfelImages, appearance: ViewAppearance, depth_scale: f32| {
            let (mut out, mut scratch) = (SurfelImages::default(), LossScratch::default());
            let input = LossInput { images, view: &view, weights, appearance, depth_scale, extent_m: 2.0 };
            let (terms, slopes) = input.compute(&mut scratch, &mut out);
            // The coverage that the normals are multiplied with is held fixed.
            let mut none = SurfelImages::zeros(SIZE);
            let free = Consistency::default().add_gradient(images, &images.coverage, &camera, 0.0, &mut none);
            let fixed = Consistency::default().add_gradient(images, held, &camera, 0.0, &mut none);
            (terms.total + weights.consistency * (fixed - free), slopes, out)
        };
        let (_, slopes, by_images) = loss(&images, appearance, 1.02);
        assert!(by_images.depth_m.iter().any(|slope| *slope != 0.0));
        let step = 1e-3f32;
        let close = |found: f32, ahead: f64, behind: f64, what: &str| {
            let slope = (ahead - behind) / f64::from(2.0 * step);
            assert!((slope - f64::from(found)).abs() < 2e-4, "{what}: {found} is not {slope}");
        };
        for k in 0..9 {
            for pixel in 0..20 {
                let moved = |by: f32| {
                    let mut images = images.clone();
                    images.planes_mut()[k][pixel] += by;
                    loss(&images, appearance, 1.02).0
                };
                close(by_images.planes()[k][pixel], moved(step), moved(-step), &format!("image {k}, pixel {pixel}"));
            }
        }
        for k in 0..6 {
            let moved = |by: f32| {
                let mut appearance = appearance;
                if k < 3 {
                    appearance.gain[k] += by
                } else {
                    appearance.offset[k - 3] += by
                }
                loss(&images, appearance, 1.02).0
            };
            close(slopes.appearance[k], moved(step), moved(-step), "appearance");
        }
        let moved = |by: f32| loss(&images, appearance, 1.02 + by).0;
        close(slopes.depth_scale, moved(step), moved(-step), "depth scale");
    }
}
