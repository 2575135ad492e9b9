//! Options for sampling: the number of points, their distribution, and the weights of classes.

use numeric::RandomByIndex;
use serde::{Deserialize, Serialize};

use super::weights::ClassWeights;
use crate::PriorModel;

/// Number of points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Amount {
    /// Number of points on the whole model.
    Count(usize),
    /// Number of points per square metre on classes of weight 1.
    PerSquareMetre(f64),
    /// As many points as a geometric error requires.
    ///
    /// A flat disk around a point, with the spacing as radius, stays within the error of the
    /// surface, if the surface is convex and flat or evenly curved. Large planes get few points,
    /// edges and small parts get many. The points are stratified.
    Adaptive {
        /// Largest geometric error, metres.
        error_m: f64,
        /// Largest spacing, metres, which large planes get.
        max_spacing_m: f64,
    },
}

/// Distribution of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Spacing {
    /// Independent points, as in the paper.
    Random,
    /// The number of points of a triangle is its share, rounded up or down, and its points follow a
    /// low-discrepancy sequence.
    #[default]
    Stratified,
    /// Points on the same side of a wall are at least a distance apart that follows from the
    /// density.
    PoissonDisk,
}

impl Spacing {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 3] = [
        ("random", Self::Random, "Independent points"),
        ("stratified", Self::Stratified, "Even shares, low discrepancy"),
        ("poisson", Self::PoissonDisk, "A least distance"),
    ];
}

/// Options for sampling a model.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleConfig {
    /// Number of points.
    pub amount: Amount,
    /// Distribution of the points.
    pub spacing: Spacing,
    /// Weight of each class.
    pub weights: ClassWeights,
    /// Whether objects that are not buildings are sampled too.
    pub everything: bool,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl Default for SampleConfig {
    /// One million stratified points on buildings, without grounds, closures and interiors.
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

/// Purpose of a random stream.
#[derive(Debug, Clone, Copy)]
pub(super) enum Purpose {
    Triangle = 0,
    First = 1,
    Second = 2,
    Offset = 3,
    Share = 4,
}

impl SampleConfig {
    /// Returns the random stream for a purpose.
    pub(super) fn stream(&self, purpose: Purpose) -> RandomByIndex {
        RandomByIndex::new(self.seed, purpose as u64)
    }

    /// Returns the weight of the area of a triangle; 0 excludes it.
    pub(super) fn weight(&self, model: &PriorModel, triangle: usize) -> f64 {
        let inside = self.everything || model.is_building(triangle);
        if inside && model.normal(triangle) != [0.0; 3] {
            self.weights.get(model.mesh().surface(triangle).class)
        } else {
            0.0
        }
    }

    /// Returns the n-th place of an evenly spread sequence in the unit square.
    ///
    /// The sequence is Roberts' R2, with a random start for every triangle.
    pub(super) fn even_place(&self, triangle: usize, n: usize) -> [f64; 2] {
        const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];
        let start = |axis: u64| self.stream(Purpose::Offset).uniform(2 * triangle as u64 + axis);
        [(start(0) + n as f64 * STEP[0]).fract(), (start(1) + n as f64 * STEP[1]).fract()]
    }
}
