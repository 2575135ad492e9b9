//! The observations of a model, grouped by image: tracks group them by point.

use camera::ImagePoint;

use crate::colmap::convention::colmap_from_pixel;
use crate::colmap::model::ColmapPoint;

/// The observations of every image, in the order of the points.
pub(super) struct ImageObservations {
    /// Per view the end of its part of `observations`.
    ends: Vec<usize>,
    /// Pixels in COLMAP's convention and identifiers of the points, view after view.
    observations: Vec<(ImagePoint, u64)>,
}

impl ImageObservations {
    pub(super) fn of(views: usize, points: &[ColmapPoint]) -> Self {
        let mut next = vec![0usize; views];
        points.iter().flat_map(|p| &p.track).for_each(|seen| next[seen.view as usize] += 1);
        let mut total = 0;
        for count in &mut next {
            total += std::mem::replace(count, total);
        }
        let mut observations = vec![(ImagePoint { sample: 0.0, line: 0.0 }, 0); total];
        for (number, point) in (1u64..).zip(points) {
            for seen in &point.track {
                let at = &mut next[seen.view as usize];
                observations[*at] = (colmap_from_pixel(seen.pixel), number);
                *at += 1;
            }
        }
        Self { ends: next, observations }
    }

    /// Returns the observations of a view.
    pub(super) fn by_view(&self, view: usize) -> &[(ImagePoint, u64)] {
        let start = view.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.observations[start..self.ends[view]]
    }
}

/// Counts the observations of every view in the order of the points, as [`ImageObservations`] lays
/// them out.
pub(super) struct Numbering(Vec<u32>);

impl Numbering {
    pub(super) fn new(views: usize) -> Self {
        Self(vec![0; views])
    }

    /// Returns the index of the next observation of a view.
    pub(super) fn next(&mut self, view: u32) -> u32 {
        let next = &mut self.0[view as usize];
        *next += 1;
        *next - 1
    }
}
