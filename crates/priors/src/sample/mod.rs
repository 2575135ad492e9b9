//! Points on the surfaces of a model: how many, where, and of which classes.
//!
//! A point's chance to lie on a triangle goes with the triangle's area times the weight of its
//! class; on the triangle all places are alike. Points carry the local spacing s = 1/√(points per
//! m²), for splats to be made of them. The i-th point does not depend on the others, or only on
//! those before it, so any number of threads makes the same points.

mod adaptive;
mod creases;
mod poisson;
mod weights;

use city::SurfaceClass;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{PriorModel, PriorsError};
use numeric::RandomByIndex;
use numeric::vector::Vector;

pub use adaptive::{ErrorCurve, error_curve};
pub use weights::ClassWeights;

/// A point on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Position, metres from the origin of the mesh.
    pub position: [f64; 3],
    /// Unit normal of its triangle.
    pub normal: [f32; 3],
    /// Distance to its neighbours as the density there makes it, metres.
    pub spacing_m: f32,
    /// Its triangle.
    pub triangle: u32,
    /// Its object in the city model.
    pub object: u32,
    /// The class of its surface.
    pub class: SurfaceClass,
}

/// How many points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Amount {
    /// This many on the whole model.
    Count(usize),
    /// This many per square metre, on classes of weight 1.
    PerSquareMetre(f64),
    /// As many as a geometric error needs: a flat disk with the radius of its point's spacing stays
    /// within the error of the surface (convex, and flat or evenly curved). Few points on large
    /// planes, many at edges and on small parts. The points are stratified.
    Adaptive {
        /// The error, metres.
        error_m: f64,
        /// The largest spacing, metres: what the largest planes get.
        max_spacing_m: f64,
    },
}

/// How points keep away from one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Spacing {
    /// Not at all: independent points, as in the paper.
    Random,
    /// Triangles get their share up to one point, and the points of a triangle follow a
    /// low-discrepancy sequence.
    #[default]
    Stratified,
    /// No two points on the same side of a wall are closer than a distance that follows from the
    /// density.
    PoissonDisk,
}

/// What to sample.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleConfig {
    /// How many points.
    pub amount: Amount,
    /// How they keep away from one another.
    pub spacing: Spacing,
    /// What each class counts.
    pub weights: ClassWeights,
    /// Sample objects that are no buildings as well.
    pub everything: bool,
    /// Another number makes other points.
    pub seed: u64,
}

impl Default for SampleConfig {
    /// A million points, stratified, on buildings, without grounds, closures and interiors.
    fn default() -> Self {
        Self {
            amount: Amount::Count(1_000_000),
            spacing: Spacing::default(),
            weights: ClassWeights::visible(),
            everything: false,
            seed: 0,
        }
    }
}

/// Points on a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// The points, ordered by triangle unless they are Poisson disks.
    pub points: Vec<Sample>,
    /// Area that was sampled, m².
    pub area_m2: f64,
    /// Area by class that was left out for its weight, m², without classes that have none.
    pub skipped_m2: Vec<(SurfaceClass, f64)>,
    /// The distance that Poisson disks keep on classes of weight 1, metres.
    pub disk_m: Option<f64>,
}

/// At most this many points are made.
pub(crate) const LIMIT: usize = 100_000_000;

/// What the numbers of a random stream are for.
#[derive(Debug, Clone, Copy)]
enum Purpose {
    Triangle = 0,
    First = 1,
    Second = 2,
    Offset = 3,
    Share = 4,
}

impl SampleConfig {
    fn stream(&self, purpose: Purpose) -> RandomByIndex {
        RandomByIndex::new(self.seed, purpose as u64)
    }

    /// What a triangle counts per area; 0 leaves it out.
    fn weight(&self, model: &PriorModel, triangle: usize) -> f64 {
        let inside = self.everything || model.is_building(triangle);
        if inside && model.normal(triangle) != [0.0; 3] {
            self.weights.get(model.mesh().surface(triangle).class)
        } else {
            0.0
        }
    }
}

/// Spreads points over a model.
///
/// # Errors
/// A density, error or spacing that is not a positive number, nothing left to sample, or more than
/// 10⁸ points.
pub fn sample(model: &PriorModel, config: &SampleConfig) -> Result<Samples, PriorsError> {
    let share = Share::new(model, config)?;
    let mut disk_m = None;
    let points = match config.amount {
        Amount::Adaptive { error_m, max_spacing_m } => {
            adaptive::sample(model, config, adaptive::Bound::new(error_m, max_spacing_m)?)?
        }
        Amount::Count(_) | Amount::PerSquareMetre(_) => {
            let count = share.count(config)?;
            match config.spacing {
                Spacing::Random => share.random(count),
                Spacing::Stratified => share.stratified(count),
                Spacing::PoissonDisk => {
                    let (points, distance) = poisson::sample(&share, count)?;
                    disk_m = Some(distance);
                    points
                }
            }
        }
    };
    Ok(Samples { points, area_m2: share.area_m2, skipped_m2: share.skipped_m2, disk_m })
}

/// The triangles laid end to end, each as long as its share of the points.
struct Share<'a> {
    model: &'a PriorModel,
    config: &'a SampleConfig,
    /// End of each triangle's part: sums of area times weight.
    ends: Vec<f64>,
    area_m2: f64,
    skipped_m2: Vec<(SurfaceClass, f64)>,
}

impl<'a> Share<'a> {
    fn new(model: &'a PriorModel, config: &'a SampleConfig) -> Result<Self, PriorsError> {
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

    /// Area times weight of the whole.
    fn total(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }

    fn count(&self, config: &SampleConfig) -> Result<usize, PriorsError> {
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

    /// Points per m² on a class of weight 1.
    fn density(&self, count: usize) -> f64 {
        count as f64 / self.total()
    }

    /// The triangle whose part a position in [0, 1) of the whole falls into.
    fn triangle(&self, at: f64) -> usize {
        let target = at * self.total();
        // Rounding may put the very last position behind the last end.
        let found = self.ends.partition_point(|&end| end <= target);
        if found < self.ends.len() { found } else { self.ends.partition_point(|&end| end < self.total()) }
    }

    fn point(&self, triangle: usize, place: [f64; 2], density: f64) -> Sample {
        let weight = self.config.weight(self.model, triangle);
        self.model.sample_at(
            triangle,
            on_triangle(self.model.mesh().corners(triangle), place),
            (weight * density).sqrt().recip(),
        )
    }

    /// The i-th of independent points.
    fn independent(&self, index: u64, density: f64) -> Sample {
        let number = |purpose| self.config.stream(purpose).uniform(index);
        let triangle = self.triangle(number(Purpose::Triangle));
        self.point(triangle, [number(Purpose::First), number(Purpose::Second)], density)
    }

    fn random(&self, count: usize) -> Vec<Sample> {
        let density = self.density(count);
        let mut points: Vec<Sample> = (0..count as u64).into_par_iter().map(|i| self.independent(i, density)).collect();
        points.par_sort_by_key(|point| point.triangle);
        points
    }

    fn stratified(&self, count: usize) -> Vec<Sample> {
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

impl SampleConfig {
    /// The n-th of evenly spread places in a unit square: Roberts' R2 sequence, begun elsewhere for
    /// every triangle.
    fn even_place(&self, triangle: usize, n: usize) -> [f64; 2] {
        const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];
        let start = |axis: u64| self.stream(Purpose::Offset).uniform(2 * triangle as u64 + axis);
        [(start(0) + n as f64 * STEP[0]).fract(), (start(1) + n as f64 * STEP[1]).fract()]
    }
}

impl PriorModel {
    fn sample_at(&self, triangle: usize, position: Vector, spacing_m: f64) -> Sample {
        let surface = self.mesh().surface(triangle);
        Sample {
            position,
            normal: self.normal(triangle).map(|c| c as f32),
            spacing_m: spacing_m as f32,
            triangle: triangle as u32,
            object: surface.object,
            class: surface.class,
        }
    }
}

/// A place of the unit square on a triangle: half of the square is folded over the other.
fn on_triangle([a, b, c]: [Vector; 3], [u, v]: [f64; 2]) -> Vector {
    let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
    [0, 1, 2].map(|i| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]))
}

fn positive(name: &'static str, value: f64) -> Result<f64, PriorsError> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(PriorsError::Config { name, value, expected: "a positive number" })
    }
}

#[cfg(test)]
mod tests;
