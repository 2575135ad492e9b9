//! Samples points on the surfaces of a model.
//!
//! The probability of a point to lie on a triangle is proportional to the area of the triangle
//! times the weight of its class. Within a triangle the distribution is uniform. Each point has the
//! local spacing s = 1/√(points per m²), from which splats get their size. A point does not depend
//! on the points after it, so that the result is the same for any number of threads.

mod adaptive;
mod config;
mod creases;
mod limits;
mod point;
mod poisson;
mod share;
mod weights;

use city::SurfaceClass;

use crate::{PriorModel, PriorsError};
use share::Share;

pub use adaptive::{ErrorCurve, error_curve};
pub use config::{Amount, SampleConfig, Spacing};
pub use point::Sample;
pub use weights::ClassWeights;

/// Points on a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// Points, ordered by triangle unless they are Poisson disks.
    pub points: Vec<Sample>,
    /// Sampled area, m².
    pub area_m2: f64,
    /// Area of the classes of weight 0, m²; classes without area are not listed.
    pub skipped_m2: Vec<(SurfaceClass, f64)>,
    /// Distance of Poisson disks on classes of weight 1, metres.
    pub disk_m: Option<f64>,
}

/// Spreads points over a model.
///
/// # Errors
/// - [`PriorsError::Config`] when a density, error or spacing is not a positive number.
/// - [`PriorsError::NothingToSample`] when no surface is left.
/// - [`PriorsError::TooMany`] when more than 10⁸ points are needed.
///
/// # Examples
/// ```
/// use city::{MeshSurface, ModelPoint, SurfaceClass, TriangleMesh};
/// use priors::{Amount, PriorModel, SampleConfig, sample};
///
/// let mesh = TriangleMesh {
///     origin: ModelPoint::default(),
///     positions: vec![[0.0, 0.0, 5.0], [4.0, 0.0, 5.0], [0.0, 4.0, 5.0]],
///     triangles: vec![[0, 1, 2]],
///     surface_of: vec![0],
///     surfaces: vec![MeshSurface { object: 0, class: SurfaceClass::Roof }],
/// };
/// let model = PriorModel::new(mesh, &[true])?;
/// let config = SampleConfig { amount: Amount::Count(100), ..SampleConfig::default() };
/// let samples = sample(&model, &config)?;
/// assert_eq!(samples.points.len(), 100);
/// assert!((samples.area_m2 - 8.0).abs() < 1e-12);
/// # Ok::<(), priors::PriorsError>(())
/// ```
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

#[cfg(test)]
mod tests;
