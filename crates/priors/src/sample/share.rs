//! Shares points among the triangles by area and weight, and makes independent and stratified
//! points.

use city::SurfaceClass;
use rayon::prelude::*;

use super::config::{Amount, Purpose, SampleConfig};
use super::limits::{LIMIT, positive};
use super::point::{Sample, on_triangle};
use crate::{PriorModel, PriorsError};

/// The triangles on a line, end to end, each as long as its share of the points.
pub(super) struct Share<'a> {
    model: &'a PriorModel,
    config: &'a SampleConfig,
    /// End of each triangle on the line: cumulative sums of area times weight.
    ends: Vec<f64>,
    pub(super) area_m2: f64,
    pub(super) skipped_m2: Vec<(SurfaceClass, f64)>,
}

impl<'a> Share<'a> {
    pub(super) fn new(model: &'a PriorModel, config: &'a SampleConfig) -> Result<Self, PriorsError> {
        let mut ends = Vec::with_capacity(model.mesh().triangles.len());
        let mut skipped = [0.0; 256];
        let (mut total, mut area_m2) = (0.0, 0.0);
        for triangle in 0..model.mesh().triangles.len() {
            let weight = config.weight(model, triangle);
            if weight > 0.0 {
                area_m2 += model.area_m2(triangle);
                total += model.area_m2(triangle) * weight;
            } else if config.everything || model.is_building(triangle) {
                skipped[model.mesh().surface(triangle).class as usize] += model.area_m2(triangle);
            }
            ends.push(total);
        }
        if !(total > 0.0 && total.is_finite()) {
            return Err(PriorsError::NothingToSample { total: ends.len() });
        }
        let skipped_m2 = SurfaceClass::all().map(|class| (class, skipped[class as usize])).filter(|s| s.1 > 0.0);
        Ok(Self { model, config, ends, area_m2, skipped_m2: skipped_m2.collect() })
    }

    /// Returns the sum of area times weight of all triangles.
    fn total(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }

    /// Returns the number of points that the configuration asks for.
    pub(super) fn count(&self, config: &SampleConfig) -> Result<usize, PriorsError> {
        let asked = match config.amount {
            Amount::Count(count) => count as f64,
            Amount::PerSquareMetre(density) => positive("the density", density)? * self.total(),
            Amount::Adaptive { .. } => 0.0,
        };
        if asked > LIMIT as f64 {
            return Err(PriorsError::TooMany { asked: asked as u64, limit: LIMIT });
        }
        Ok(asked.round() as usize)
    }

    /// Returns the points per m² on a class of weight 1.
    pub(super) fn density(&self, count: usize) -> f64 {
        count as f64 / self.total()
    }

    /// Returns the triangle at a position in [0, 1) of the line.
    fn triangle(&self, at: f64) -> usize {
        let target = at * self.total();
        // Rounding may put the last position behind the last end.
        let found = self.ends.partition_point(|&end| end <= target);
        if found < self.ends.len() { found } else { self.ends.partition_point(|&end| end < self.total()) }
    }

    /// Makes a point at a place of the unit square on a triangle.
    fn point(&self, triangle: usize, place: [f64; 2], density: f64) -> Sample {
        let weight = self.config.weight(self.model, triangle);
        self.model.sample_at(
            triangle,
            on_triangle(self.model.mesh().corners(triangle), place),
            (weight * density).sqrt().recip(),
        )
    }

    /// Makes the i-th independent point.
    pub(super) fn independent(&self, index: u64, density: f64) -> Sample {
        let number = |purpose| self.config.stream(purpose).uniform(index);
        let triangle = self.triangle(number(Purpose::Triangle));
        self.point(triangle, [number(Purpose::First), number(Purpose::Second)], density)
    }

    /// Makes independent points, ordered by triangle.
    pub(super) fn random(&self, count: usize) -> Vec<Sample> {
        let density = self.density(count);
        let mut points: Vec<Sample> = (0..count as u64).into_par_iter().map(|i| self.independent(i, density)).collect();
        points.par_sort_by_key(|point| point.triangle);
        points
    }

    /// Makes stratified points, ordered by triangle.
    pub(super) fn stratified(&self, count: usize) -> Vec<Sample> {
        let density = self.density(count);
        let place = |i: usize| (i as f64 + self.config.stream(Purpose::Triangle).uniform(i as u64)) / count as f64;
        let triangles: Vec<usize> = (0..count).into_par_iter().map(|i| self.triangle(place(i))).collect();
        let first_of = |i: usize| triangles.partition_point(|&t| t < triangles[i]);
        let point = |i: usize| {
            let triangle = triangles[i];
            self.point(triangle, self.config.even_place(triangle, i - first_of(i)), density)
        };
        (0..count).into_par_iter().map(point).collect()
    }
}
