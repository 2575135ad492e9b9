//! What the classes of surfaces count in a sample.

use city::SurfaceClass;

use super::positive;
use crate::PriorsError;

/// A weight per class: how many points its surfaces get per area, beside a class of weight 1.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassWeights {
    weights: Vec<f64>,
}

impl ClassWeights {
    /// Every class alike.
    pub fn equal() -> Self {
        Self { weights: SurfaceClass::all().map(|_| 1.0).collect() }
    }

    /// What can be seen from outside: grounds, closures and interiors are left out. Grounds take a
    /// quarter of an area-weighted sample of an LoD2 model, and almost none of it is ever seen.
    pub fn visible() -> Self {
        [SurfaceClass::Ground, SurfaceClass::Closure, SurfaceClass::Interior]
            .into_iter()
            .fold(Self::equal(), |weights, class| weights.replaced(class, 0.0))
    }

    /// Sets the weight of a class; 0 leaves it out.
    ///
    /// # Errors
    /// A weight that is negative or not finite.
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

    /// The weight of a class.
    pub fn get(&self, class: SurfaceClass) -> f64 {
        self.weights.get(class as usize).copied().unwrap_or(0.0)
    }
}
