//! Weights of the classes of surfaces in a sample.

use city::SurfaceClass;

use super::limits::positive;
use crate::PriorsError;

/// A weight per class: the number of points per area, relative to a class of weight 1.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassWeights {
    weights: Vec<f64>,
}

impl ClassWeights {
    /// Returns the weight 1 for every class.
    pub fn equal() -> Self {
        Self { weights: SurfaceClass::all().map(|_| 1.0).collect() }
    }

    /// Returns the weight 1 for classes that are visible from outside, and 0 for grounds, closures
    /// and interiors.
    ///
    /// About a quarter of the area of an LoD2 model is ground, and almost none of it is ever seen.
    pub fn visible() -> Self {
        [SurfaceClass::Ground, SurfaceClass::Closure, SurfaceClass::Interior]
            .into_iter()
            .fold(Self::equal(), |weights, class| weights.replaced(class, 0.0))
    }

    /// Sets the weight of a class; 0 excludes it.
    ///
    /// # Errors
    /// [`PriorsError::Config`] when the weight is negative or not finite.
    pub fn with(self, class: SurfaceClass, weight: f64) -> Result<Self, PriorsError> {
        if weight != 0.0 {
            positive("the weight of a class", weight)?;
        }
        Ok(self.replaced(class, weight))
    }

    fn replaced(mut self, class: SurfaceClass, weight: f64) -> Self {
        if let Some(known) = self.weights.get_mut(class as usize) {
            *known = weight;
        }
        self
    }

    /// Returns the weight of a class.
    pub fn get(&self, class: SurfaceClass) -> f64 {
        self.weights.get(class as usize).copied().unwrap_or(0.0)
    }
}
