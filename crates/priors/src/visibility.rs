//! Which cameras see which points, and which of them see a point best.
//!
//! A view sees a point that lies in its image by a margin, not nearer than the near plane, not at a
//! more grazing angle than allowed, and with nothing before it: a ray from the camera meets no
//! triangle up to ε before the point (any hit). ε absorbs the distance between a point and its own
//! triangle, and is a length along the ray. Points are kept that at least k views see, with the m
//! observations of the highest resolution f cos θ / distance (pixels per metre of the surface), the
//! first of equals. Views are added one by one, so a caller may show progress.

use bvh::Target;
use camera::ImagePoint;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{PriorModel, PriorsError, Sample, View};
use numeric::vector::{dot, norm, sub};

/// What it takes to be seen, and to be kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VisibilityConfig {
    /// How far inside the borders of the image a point must lie, pixels.
    pub margin_px: f64,
    /// Depth before which nothing is seen, metres.
    pub near_m: f64,
    /// The last part of the ray that is not looked at, metres.
    pub epsilon_m: f64,
    /// The largest angle between the ray and the normal, degrees; `None` sees up to 90°, and
    /// surfaces from behind.
    pub max_incidence_deg: Option<f64>,
    /// A point needs this many views to be kept.
    pub min_views: u32,
    /// At most this many observations are kept per point, the best.
    pub max_observations: usize,
}

impl Default for VisibilityConfig {
    /// 5 px, near plane at 0.1 m, ε = 0.05 m, no limit of incidence, two views, ten observations.
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
            ("the margin", self.margin_px, self.margin_px.is_finite(), "a number of pixels"),
            ("the near plane", self.near_m, self.near_m >= 0.0 && self.near_m.is_finite(), "0 or more metres"),
            ("ε", self.epsilon_m, self.epsilon_m >= 0.0 && self.epsilon_m.is_finite(), "0 or more metres"),
            (
                "the largest incidence",
                self.max_incidence_deg.unwrap_or(90.0),
                self.max_incidence_deg.is_none_or(|a| a > 0.0 && a <= 90.0),
                "an angle up to 90°",
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

/// Slots of a point are counted in a byte.
const MAX_OBSERVATIONS: usize = 255;

/// What one view sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ViewCounts {
    /// Points in its image, in front of it and not too grazing.
    pub candidates: usize,
    /// Those that nothing hides.
    pub visible: usize,
}

/// A point in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Index of the view, in the order of adding.
    pub view: u32,
    /// Where.
    pub pixel: ImagePoint,
}

/// The points that were kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Visible {
    /// Indices of the samples, ascending.
    pub points: Vec<u32>,
    /// Per kept point how many views see it.
    pub views: Vec<u32>,
    /// Per kept point its best observations, ordered by view.
    pub observations: Vec<Vec<Observation>>,
    /// Pairs of a view and a point that it sees, over all points.
    pub pairs: u64,
    /// Points by the number of views that see them: 0, 1, …, and the last for that many and more.
    pub histogram: Vec<usize>,
    /// What each view sees.
    pub per_view: Vec<ViewCounts>,
}

/// A count of views per point that grows view by view.
#[derive(Debug, Clone)]
pub struct Visibility<'a> {
    model: &'a PriorModel,
    samples: &'a [Sample],
    config: VisibilityConfig,
    views: Vec<View>,
    counts: Vec<u32>,
    /// The best observations of each point so far, `max_observations` slots each.
    best: Vec<Slot>,
    per_view: Vec<ViewCounts>,
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    view: u32,
    score: f32,
}

/// The longest histogram.
const HISTOGRAM: usize = 32;

impl<'a> Visibility<'a> {
    /// Begins with no view.
    ///
    /// # Errors
    /// A configuration with numbers that mean nothing.
    pub fn new(model: &'a PriorModel, samples: &'a [Sample], config: VisibilityConfig) -> Result<Self, PriorsError> {
        config.validate()?;
        let best = vec![Slot { view: u32::MAX, score: 0.0 }; samples.len().saturating_mul(config.max_observations)];
        let counts = vec![0; samples.len()];
        Ok(Self { model, samples, config, views: Vec::new(), counts, best, per_view: Vec::new() })
    }

    /// Adds a view.
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

    /// How many views see each point.
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// The points that enough views see.
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

/// Puts an observation among the best, worst last; `count` were seen before. A later one must be
/// better to replace.
fn insert(slots: &mut [Slot], count: usize, new: Slot) {
    let used = count.min(slots.len());
    let place = slots[..used].iter().position(|slot| new.score > slot.score).unwrap_or(used);
    if place < slots.len() {
        let last = used.min(slots.len() - 1);
        slots.copy_within(place..last, place + 1);
        slots[place] = new;
    }
}

/// A point that may be visible.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    sample: u32,
    target: Target,
    score: f32,
}

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
