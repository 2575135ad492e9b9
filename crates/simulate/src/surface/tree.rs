//! A tree: its crown in either form, as one solid.

use nalgebra::Vector3;

use crate::SceneRay;
use crate::surface::crown::Crown;
use crate::surface::natural_crown::NaturalCrown;

/// The crown of a tree.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Tree {
    Dome(Crown),
    Natural(NaturalCrown),
}

impl Tree {
    pub(crate) fn centre_m(&self) -> [f64; 2] {
        match self {
            Self::Dome(crown) => crown.centre_m,
            Self::Natural(crown) => crown.centre_m,
        }
    }

    pub(crate) fn radius_m(&self) -> f64 {
        match self {
            Self::Dome(crown) => crown.radius_m,
            Self::Natural(crown) => crown.radius_m,
        }
    }

    pub(crate) fn top_m(&self) -> f64 {
        match self {
            Self::Dome(crown) => crown.top_m(),
            Self::Natural(crown) => crown.top_m,
        }
    }

    /// Returns the height of the upper side over a point, `None` beside the crown.
    pub(crate) fn height(&self, x: f64, y: f64) -> Option<f64> {
        match self {
            Self::Dome(crown) => crown.height(x, y),
            Self::Natural(crown) => crown.height(x, y),
        }
    }

    /// Returns where a ray enters, and the outward unit normal there.
    pub(crate) fn enter(&self, ray: &SceneRay, t_max: f64) -> Option<(f64, Vector3<f64>)> {
        match self {
            Self::Dome(crown) => crown.enter(ray, t_max),
            Self::Natural(crown) => crown.enter(ray, t_max),
        }
    }
}
