//! The training: draw a view, compare, step down the gradient; split and remove surfels at times.

use numeric::SplitMix64;
use rayon::prelude::*;

use crate::config::TrainingConfig;
use crate::densify::{DensifyCounts, densify, reset_opacities};
use crate::image::SurfelImages;
use crate::loss::{LossInput, LossScratch, LossTerms, TrainingView, ViewAppearance};
use crate::raster::{Drawing, SurfelGradients};
use crate::simd::Registers;
use crate::state::TrainingState;
use crate::surfel::Surfel;
use crate::view::SurfelCamera;

/// Least and greatest standard deviation of a surfel relative to the size of the scene.
const SCALE_RANGE: [f64; 2] = [1e-6, 0.5];

/// A training of surfels on views.
#[derive(Debug)]
pub struct Trainer<'a, C> {
    views: &'a [TrainingView<C>],
    config: TrainingConfig,
    /// Size of the scene, metres.
    extent_m: f64,
    state: TrainingState,
    drawing: Drawing,
    by_images: SurfelImages,
    scratch: LossScratch,
    gradients: SurfelGradients,
    /// The surfels with the colours that a view sees.
    coloured: Vec<Surfel>,
    by_harmonics: Vec<f32>,
}

/// What an iteration did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainingStep {
    /// The view that was drawn.
    pub view: usize,
    /// Its loss before the step.
    pub terms: LossTerms,
    /// Surfels that were split and removed, where there was a round.
    pub densified: Option<DensifyCounts>,
}

/// Returns the share of the pixels of a view that belong to what is modelled.
fn modelled_share<C>(view: &TrainingView<C>) -> f32 {
    let share = |mask: &Vec<bool>| mask.iter().filter(|m| **m).count() as f32 / mask.len().max(1) as f32;
    view.mask.as_ref().map_or(1.0, share)
}

impl<'a, C: SurfelCamera> Trainer<'a, C> {
    /// Begins a training, or goes on with one from its state. The harmonics of the state get the
    /// degree of the settings: they are cut, or begin at 0.
    ///
    /// `extent_m` is the size of the scene, metres: steps of positions are relative to it.
    ///
    /// # Panics
    /// If there are no views, a view's planes do not have its camera's size, or the state has
    /// another number of views.
    pub fn new(views: &'a [TrainingView<C>], extent_m: f64, mut state: TrainingState, config: TrainingConfig) -> Self {
        assert!(!views.is_empty(), "a training needs views");
        assert_eq!(state.appearance.len(), views.len(), "the state has another number of views");
        for view in views {
            let [width, height] = view.camera.size();
            assert!(view.colour.iter().all(|plane| plane.len() == width * height), "a view has another size");
        }
        state.harmonics = state.harmonics.with_degree(config.harmonics.degree, state.surfels.len());
        Self {
            views,
            config,
            extent_m,
            state,
            drawing: Drawing::new(&[], &views[0].camera, Registers::Longest),
            by_images: SurfelImages::default(),
            scratch: LossScratch::default(),
            gradients: SurfelGradients::default(),
            coloured: Vec::new(),
            by_harmonics: Vec::new(),
        }
    }

    /// Returns what was learned so far.
    pub fn state(&self) -> &TrainingState {
        &self.state
    }

    /// Returns what was learned.
    pub fn into_state(self) -> TrainingState {
        self.state
    }

    /// Returns whether all iterations are done.
    pub fn is_done(&self) -> bool {
        self.state.iteration >= self.config.iterations
    }

    /// Does an iteration.
    pub fn step(&mut self) -> TrainingStep {
        let iteration = self.state.iteration;
        let number = self.view_at(iteration);
        let (view, weights) = (&self.views[number], self.config.weights_at(iteration));
        let (degree, surfels, camera) = (self.config.degree_at(iteration), &self.state.surfels, &view.camera);
        let seen = self.state.harmonics.seen(surfels, camera, degree, &mut self.coloured);
        self.drawing.set_spread(LossInput::<C>::spread(&weights));
        self.drawing.redraw(seen, camera);
        let input = LossInput {
            images: self.drawing.images(),
            view,
            weights,
            appearance: self.state.appearance[number],
            depth_scale: self.state.depth_scale,
            extent_m: self.extent_m,
        };
        let (terms, slopes) = input.compute(&mut self.scratch, &mut self.by_images);
        self.drawing.gradients(seen, camera, &self.by_images, &mut self.gradients);
        let by = &mut self.by_harmonics;
        self.state.harmonics.spread((surfels, seen), camera, degree, &mut self.gradients, by);
        self.descend(view.camera.size(), modelled_share(view));
        let rate = self.config.rates.view as f32;
        if self.config.appearance {
            let ViewAppearance { gain: [a, b, c], offset: [d, e, f] } = self.state.appearance[number];
            let mut learned = [a, b, c, d, e, f];
            self.state.appearance_moments[number].step(&mut learned, &slopes.appearance, &[rate; 6]);
            let [a, b, c, d, e, f] = learned;
            self.state.appearance[number] = ViewAppearance { gain: [a, b, c], offset: [d, e, f] };
        }
        if slopes.depth_scale != 0.0 {
            let mut scale = [self.state.depth_scale];
            self.state.scale_moments.step(&mut scale, &[slopes.depth_scale], &[self.config.rates.depth_scale as f32]);
            self.state.depth_scale = scale[0];
        }
        self.state.iteration += 1;
        TrainingStep { view: number, terms, densified: self.densify() }
    }

    /// Draws a view as the training sees it, and compares it without taking a step.
    pub fn judge(&mut self, view: &TrainingView<C>, appearance: ViewAppearance) -> LossTerms {
        let weights = self.config.weights_at(self.state.iteration);
        self.drawing.set_spread(LossInput::<C>::spread(&weights));
        self.drawing.redraw(self.state.seen(&view.camera, &mut self.coloured), &view.camera);
        let input = LossInput {
            images: self.drawing.images(),
            view,
            weights,
            appearance,
            depth_scale: self.state.depth_scale,
            extent_m: self.extent_m,
        };
        input.compute(&mut self.scratch, &mut self.by_images).0
    }

    /// Returns the images of the last drawing.
    pub fn images(&self) -> &SurfelImages {
        self.drawing.images()
    }

    /// Returns the view of an iteration. Each round through all views has an order of its own.
    fn view_at(&self, iteration: u32) -> usize {
        let (round, place) = (iteration as usize / self.views.len(), iteration as usize % self.views.len());
        let mut random = SplitMix64::new(self.config.seed ^ (round as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut order: Vec<usize> = (0..self.views.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, random.below(i + 1));
        }
        order[place]
    }

    /// Steps down the gradient of the surfels that were drawn. `modelled` is the share of the
    /// pixels that the colours are compared at.
    fn descend(&mut self, size: [usize; 2], modelled: f32) {
        let rates = self.rates();
        let scales = SCALE_RANGE.map(|s| (s * self.extent_m).ln() as f32);
        // Gradients by the position are judged as those of 3DGS: in halves of the image, for a loss
        // that is a mean over all its pixels. Otherwise a masked scene would be split more finely
        // than the same surface in a whole one.
        let half = modelled * size[0].max(size[1]) as f32 / 2.0;
        let (state, gradients) = (&mut self.state, &self.gradients);
        if self.config.degree_at(state.iteration) > 0 {
            let (rate, steps) = (self.config.harmonics_rate(state.iteration) as f32, &state.moments);
            let steps = |surfel: usize| steps[surfel].steps + 1;
            state.harmonics.descend(&self.by_harmonics, &gradients.by_pixel, steps, rate);
        }
        let moved = state.surfels.par_iter_mut().zip(&mut state.moments).zip(&mut state.pulls);
        moved.zip(&gradients.surfels).zip(&gradients.by_pixel).for_each(
            |((((surfel, moments), pull), gradient), &by_pixel)| {
                if !by_pixel.is_finite() {
                    return;
                }
                let mut parameters = surfel.to_array();
                moments.step(&mut parameters, &gradient.to_array(), &rates);
                *surfel = Surfel::from_array(parameters);
                surfel.log_scale = surfel.log_scale.map(|s| s.clamp(scales[0], scales[1]));
                pull[0] += by_pixel * half;
                pull[1] += 1.0;
            },
        );
    }

    fn rates(&self) -> [f32; Surfel::PARAMETERS] {
        let r = &self.config.rates;
        let position = self.config.position_rate(self.state.iteration) * self.extent_m;
        let colour = self.config.colour_rate(self.state.iteration);
        let [p, q, s, o, c] = [position, r.rotation, r.scale, r.opacity, colour].map(|rate| rate as f32);
        [p, p, p, q, q, q, q, s, s, o, c, c, c]
    }

    /// Splits and removes surfels where it is time to.
    fn densify(&mut self) -> Option<DensifyCounts> {
        let mut config = self.config.densify?;
        let [from, to] = config.during.map(|share| (share * f64::from(self.config.iterations)) as u32);
        let iteration = self.state.iteration;
        if iteration < from || !iteration.is_multiple_of(config.every.max(1)) {
            return None;
        }
        if iteration > to {
            config.budget = 0;
        }
        let counts = densify(&mut self.state, &config);
        let resets = config.reset_every > 0 && iteration <= to && iteration.is_multiple_of(config.reset_every);
        if resets {
            reset_opacities(&mut self.state, config.reset_opacity);
        }
        Some(counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::PinholeView;

    #[test]
    fn a_mask_says_which_share_is_modelled() {
        let camera = PinholeView {
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            centre: [0.0; 3],
            focal_px: [4.0; 2],
            principal_px: [1.5, 0.5],
            size: [4, 2],
        };
        let plane = || vec![0.5; 8];
        let colour = [plane(), plane(), plane()];
        let mut view = TrainingView::new(camera, colour);
        assert_eq!(modelled_share(&view), 1.0);
        view.mask = Some((0..8).map(|i| i < 2).collect());
        assert_eq!(modelled_share(&view), 0.25);
    }
}
