//! True orthos: images laid on a surface model, where every cell shows its own ground point.
//!
//! The crate `occlusion` finds the cells that the surface hides from an image. Of several images
//! that see a cell, [`best_view`] picks the one that looks down most steeply. [`balance`] brings
//! the grey values of the images together, and [`MosaicRule`] says how they become one.

mod balance;
mod blend;

pub use balance::{Balance, BalanceError, Pair, balance};
pub use blend::{MosaicRule, feather_weight, median_value};

/// How an image sees a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sight {
    /// The ground point is outside of the image, or the image has no data there.
    Outside,
    /// The surface hides the ground point.
    Hidden,
    /// The image sees the ground point.
    Seen {
        /// Angle of the line of sight from the vertical, degrees.
        incidence_deg: f64,
    },
}

/// Returns the index of the view that sees a cell most steeply; the first of equal ones.
///
/// ```
/// use ortho::{Sight, best_view};
///
/// let seen = |incidence_deg| Sight::Seen { incidence_deg };
/// assert_eq!(best_view([seen(20.0), Sight::Hidden, seen(8.0)]), Some(2));
/// ```
pub fn best_view(sights: impl IntoIterator<Item = Sight>) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for (view, sight) in sights.into_iter().enumerate() {
        if let Sight::Seen { incidence_deg } = sight
            && best.is_none_or(|(_, known)| incidence_deg < known)
        {
            best = Some((view, incidence_deg));
        }
    }
    best.map(|(view, _)| view)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steepest_view_that_sees_is_the_best() {
        let seen = |incidence_deg| Sight::Seen { incidence_deg };
        assert_eq!(best_view([Sight::Outside, seen(20.0), Sight::Hidden, seen(8.0), seen(8.0)]), Some(3));
        assert_eq!(best_view([Sight::Outside, Sight::Hidden]), None);
        assert_eq!(best_view([seen(f64::NAN)]), Some(0));
    }
}
