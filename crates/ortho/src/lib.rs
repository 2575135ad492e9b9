//! True orthos: images laid on a surface model, each cell with what its own point looks like, hidden cells marked.
//!
//! [`Eyeline`] says in which direction of the grid an image's sensor stands, [`Surface::hides`] whether something of the surface stands
//! between a point and the sensor. Of several images that see a cell, [`best_view`] takes the one that looks down most
//! steeply, and [`balance`] brings their grey values together.

mod balance;

pub use balance::{Balance, BalanceError, Pair, balance};

/// What an image has to say about a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sight {
    /// Its point is outside the image, or the image has no data there.
    Outside,
    /// Something stands before its point.
    Hidden,
    /// Its point is seen, under this angle to the vertical, degrees.
    Seen {
        /// The angle.
        incidence_deg: f64,
    },
}

/// The view that sees a cell most steeply; of equals the first.
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
