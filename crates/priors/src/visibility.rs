//! Counts the cameras that see each point, and keeps the best of them.
//!
//! A view sees a point when its pixel is inside the image by a margin, its depth is beyond the near
//! plane, the incidence angle is below the limit, and no triangle occludes it. The test for
//! occlusion casts a ray from the camera that ends ε before the point, measured along the ray. The
//! length ε absorbs the distance between a point and its own triangle.
//!
//! A point is kept when at least k views see it, with the m observations of the highest resolution
//! f cos θ / distance (pixels per metre of the surface). Of equal observations the first is kept.
//! Views are added one by one, so that a caller can show progress.

use bvh::Target;
use camera::ImagePoint;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{PriorModel, PriorsError, Sample, View};
use numeric::vector::{dot, norm, sub};

/// Conditions for a point to be seen and to be kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VisibilityConfig {
    /// Distance from the borders of the image, pixels; a point must be inside by at least this
    /// much.
    pub margin_px: f64,
    /// Depth of the near plane, metres.
    pub near_m: f64,
    /// Length ε of the last part of the ray, which is not tested for occlusion, metres.
    pub epsilon_m: f64,
    /// Largest angle between the ray and the normal, degrees; `None` allows any angle, also
    /// surfaces seen from behind.
    pub max_incidence_deg: Option<f64>,
    /// Number of views that a point needs to be kept.
    pub min_views: u32,
    /// Largest number of observations that are kept per point.
    pub max_observations: usize,
}

impl Default for VisibilityConfig {
    /// Returns a margin of 5 px, a near plane at 0.1 m, ε = 0.05 m, no limit of the incidence
    /// angle, two views and ten observations.
    fn default() -> Self {
        Self {
            margin_px: 5.0,
            near_m: 0.1,
            epsilon_m: 0.05,
            max_incidence_deg: None,
            min_views: 2,
            max_observations: 10,
        }
    }
}

impl VisibilityConfig {
    fn validate(&self) -> Result<(), PriorsError> {
        let numbers = [
            ("the margin", self.margin_px, self.margin_px.is_finite(), "a finite number of pixels"),
            ("the depth of the near plane", self.near_m, self.near_m >= 0.0 && self.near_m.is_finite(), "at least 0 m"),
            ("the length ε", self.epsilon_m, self.epsilon_m >= 0.0 && self.epsilon_m.is_finite(), "at least 0 m"),
            (
                "the largest incidence angle",
                self.max_incidence_deg.unwrap_or(90.0),
                self.max_incidence_deg.is_none_or(|a| a > 0.0 && a <= 90.0),
                "more than 0° and at most 90°",
            ),
            (
                "the number of observations",
                self.max_observations as f64,
                (1..=MAX_OBSERVATIONS).contains(&self.max_observations),
                "1 to 255",
            ),
        ];
        match numbers.into_iter().find(|(_, _, fine, _)| !fine) {
            Some((name, value, _, expected)) => Err(PriorsError::Config { name, value, expected }),
            None => Ok(()),
        }
    }
}

/// Largest number of observations per point.
const MAX_OBSERVATIONS: usize = 255;

/// Counts of the points of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ViewCounts {
    /// Number of points in its image, beyond the near plane and below the largest incidence angle.
    pub candidates: usize,
    /// Number of those points that are not occluded.
    pub visible: usize,
}

/// Observation of a point in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Index of the view, in the order of [`Visibility::add`].
    pub view: u32,
    /// Pixel of the point.
    pub pixel: ImagePoint,
}

/// Points that enough views see.
#[derive(Debug, Clone, PartialEq)]
pub struct Visible {
    /// Indices of the samples, ascending.
    pub points: Vec<u32>,
    /// Number of views that see each kept point.
    pub views: Vec<u32>,
    /// Best observations of each kept point, ordered by view.
    pub observations: Vec<Vec<Observation>>,
    /// Number of pairs of a view and a point that it sees, over all points.
    pub pairs: u64,
    /// Number of points by the number of views that see them: 0, 1, …; the last entry also counts
    /// larger numbers.
    pub histogram: Vec<usize>,
    /// Counts of each view.
    pub per_view: Vec<ViewCounts>,
}

/// Counts of the views that see each point, which grow view by view.
#[derive(Debug, Clone)]
pub struct Visibility<'a> {
    model: &'a PriorModel,
    samples: &'a [Sample],
    config: VisibilityConfig,
    views: Vec<View>,
    counts: Vec<u32>,
    /// Best observations of each point so far: `max_observations` slots per point.
    best: Vec<Slot>,
    per_view: Vec<ViewCounts>,
}

/// An observation of a point: the view, and its resolution.
#[derive(Debug, Clone, Copy)]
struct Slot {
    view: u32,
    score: f32,
}

/// Last number of views in the histogram, which counts all larger ones too.
const HISTOGRAM: usize = 32;

impl<'a> Visibility<'a> {
    /// Starts without views.
    ///
    /// # Errors
    /// [`PriorsError::Config`] when a parameter is out of its range.
    pub fn new(model: &'a PriorModel, samples: &'a [Sample], config: VisibilityConfig) -> Result<Self, PriorsError> {
        config.validate()?;
        let best = vec![Slot { view: u32::MAX, score: 0.0 }; samples.len().saturating_mul(config.max_observations)];
        let counts = vec![0; samples.len()];
        Ok(Self { model, samples, config, views: Vec::new(), counts, best, per_view: Vec::new() })
    }

    /// Adds a view, and returns its counts.
    pub fn add(&mut self, view: &View) -> ViewCounts {
        let number = self.views.len() as u32;
        let candidates = candidates(self.samples, view, &self.config);
        let targets: Vec<Target> = candidates.iter().map(|c| c.target).collect();
        let hidden = self.model.bvh().occluded(&view.eye(), &targets);
        let mut visible = 0;
        for (candidate, _) in candidates.iter().zip(&hidden).filter(|(_, hidden)| !**hidden) {
            visible += 1;
            let slots = self.config.max_observations;
            let point = candidate.sample as usize;
            let kept = &mut self.best[point * slots..(point + 1) * slots];
            insert(kept, self.counts[point] as usize, Slot { view: number, score: candidate.score });
            self.counts[point] += 1;
        }
        let counts = ViewCounts { candidates: candidates.len(), visible };
        self.per_view.push(counts);
        self.views.push(view.clone());
        counts
    }

    /// Returns per point the number of views that see it.
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// Returns the points that enough views see.
    pub fn finish(self) -> Visible {
        let slots = self.config.max_observations;
        let mut histogram = vec![0; HISTOGRAM + 1];
        self.counts.iter().for_each(|&c| histogram[(c as usize).min(HISTOGRAM)] += 1);
        let kept = |i: &u32| self.counts[*i as usize] >= self.config.min_views;
        let points: Vec<u32> = (0..self.samples.len() as u32).filter(kept).collect();
        let observed = |&point: &u32| {
            let point = point as usize;
            let used = (self.counts[point] as usize).min(slots);
            let mut of_point: Vec<u32> = self.best[point * slots..][..used].iter().map(|s| s.view).collect();
            of_point.sort_unstable();
            let position = self.samples[point].position;
            of_point.into_iter().filter_map(|view| self.observation(view, position)).collect()
        };
        Visible {
            views: points.iter().map(|&point| self.counts[point as usize]).collect(),
            observations: points.par_iter().map(observed).collect(),
            pairs: self.counts.iter().map(|&c| u64::from(c)).sum(),
            histogram,
            per_view: self.per_view,
            points,
        }
    }

    fn observation(&self, view: u32, position: [f64; 3]) -> Option<Observation> {
        let seen = &self.views[view as usize];
        let [x, y, z] = seen.eye().eye_from_world(position);
        seen.lens.project(x / z, y / z).map(|pixel| Observation { view, pixel })
    }
}

/// Inserts an observation into the best ones, which are in descending order; `count` observations
/// came before. A later observation must be better to replace an earlier one.
fn insert(slots: &mut [Slot], count: usize, new: Slot) {
    let used = count.min(slots.len());
    let place = slots[..used].iter().position(|slot| new.score > slot.score).unwrap_or(used);
    if place < slots.len() {
        let last = used.min(slots.len() - 1);
        slots.copy_within(place..last, place + 1);
        slots[place] = new;
    }
}

/// A point inside the image of a view, which may be occluded.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    sample: u32,
    target: Target,
    score: f32,
}

/// Returns the points that are inside the image of a view.
fn candidates(samples: &[Sample], view: &View, config: &VisibilityConfig) -> Vec<Candidate> {
    let eye = view.eye();
    let focal = view.lens.focal_px();
    let focal = (focal[0] * focal[1]).sqrt();
    let least_cosine = config.max_incidence_deg.map_or(0.0, |angle| angle.to_radians().cos());
    let candidate = |(number, sample): (usize, &Sample)| {
        let [x, y, z] = eye.eye_from_world(sample.position);
        if !(z > 0.0 && z >= config.near_m) {
            return None;
        }
        view.pixel(x / z, y / z, config.margin_px)?;
        let distance = norm([x, y, z]);
        let cosine = dot(sub(eye.centre, sample.position), sample.normal.map(f64::from)) / distance;
        if config.max_incidence_deg.is_some() && cosine < least_cosine {
            return None;
        }
        let target = Target { x: x / z, y: y / z, depth: z * (1.0 - config.epsilon_m / distance) };
        Some(Candidate { sample: number as u32, target, score: (focal * cosine.abs() / distance) as f32 })
    };
    samples.par_iter().enumerate().filter_map(candidate).collect()
}

#[cfg(test)]
mod tests;
