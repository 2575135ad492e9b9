//! The choice of a few partners for an image, such that each part of it has enough of them.
//!
//! The images of a block do not all see the same ground: the best partners of an image may all lie
//! at one end of it. Places on a lattice over the image are therefore counted.

use geo::{BoundingRect, Contains, Point, Polygon};

/// Places on a side of the lattice over an outline.
const FIELDS: usize = 10;
/// Once the usual number of partners is chosen, a further one must help this share of the places.
const HELPED_MIN: f64 = 0.1;
/// At most this many times the usual number of partners is chosen.
const MOST_TIMES: usize = 2;

/// Places of an image that need partners.
pub struct Places(Vec<Point<f64>>);

impl Places {
    /// Returns the places of a lattice that lie in an outline.
    pub fn over(outline: &Polygon<f64>) -> Self {
        let Some(rect) = outline.bounding_rect() else { return Self(Vec::new()) };
        let along = |i: usize, from: f64, length: f64| from + (i as f64 + 0.5) / FIELDS as f64 * length;
        let at = |i: usize, j: usize| {
            Point::new(along(i, rect.min().x, rect.width()), along(j, rect.min().y, rect.height()))
        };
        let all = (0..FIELDS).flat_map(|j| (0..FIELDS).map(move |i| (i, j))).map(|(i, j)| at(i, j));
        Self(all.filter(|p| outline.contains(p)).collect())
    }

    /// Chooses partners from candidates with their outlines, the best ones first. The best `usual`
    /// ones are taken. Further ones are taken where places have fewer than `usual`.
    pub fn choose<'a>(
        &self,
        candidates: impl IntoIterator<Item = (usize, &'a Polygon<f64>)>,
        usual: usize,
    ) -> Vec<usize> {
        let mut have = vec![0; self.0.len()];
        let mut chosen = Vec::new();
        for (candidate, outline) in candidates {
            if chosen.len() == MOST_TIMES * usual {
                break;
            }
            let sees: Vec<bool> = self.0.iter().map(|p| outline.contains(p)).collect();
            let helped = sees.iter().zip(&have).filter(|(sees, have)| **sees && **have < usual).count();
            if chosen.len() < usual || helped as f64 >= HELPED_MIN * self.0.len() as f64 && helped > 0 {
                have.iter_mut().zip(&sees).for_each(|(have, sees)| *have += usize::from(*sees));
                chosen.push(candidate);
            }
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geo::Rect;

    fn choice(outlines: &[Polygon<f64>], usual: usize) -> Vec<usize> {
        let image = Rect::new((0.0, 0.0), (100.0, 100.0)).to_polygon();
        Places::over(&image).choose(outlines.iter().enumerate(), usual)
    }

    /// Returns outlines of the given extents in x and the same extent in y.
    fn strips(extents: impl IntoIterator<Item = (f64, f64)>, north: f64) -> Vec<Polygon<f64>> {
        extents.into_iter().map(|(west, east)| Rect::new((west, 0.0), (east, north)).to_polygon()).collect()
    }

    fn chosen(extents: &[(f64, f64)], usual: usize) -> Vec<usize> {
        choice(&strips(extents.iter().copied(), 100.0), usual)
    }

    #[test]
    fn images_of_the_same_ground_are_taken_by_merit() {
        assert_eq!(chosen(&[(-5.0, 104.0); 6], 4), [0, 1, 2, 3]);
        assert_eq!(chosen(&[(0.0, 95.0); 6], 4), [0, 1, 2, 3], "a rim of a lattice field is no reason for another");
    }

    #[test]
    fn each_part_gets_its_partners() {
        let halves = [(0.0, 50.0), (0.0, 50.0), (0.0, 50.0), (50.0, 100.0), (50.0, 100.0), (50.0, 100.0)];
        assert_eq!(chosen(&halves, 2), [0, 1, 3, 4]);
        let twentieths = strips((0..10).map(|i| (10.0 * f64::from(i), 10.0 * f64::from(i) + 10.0)), 50.0);
        assert_eq!(choice(&twentieths, 2), [0, 1], "a twentieth of the ground is not worth a partner");
        let tenths: Vec<(f64, f64)> = (0..10).map(|i| (10.0 * f64::from(i), 10.0 * f64::from(i) + 10.0)).collect();
        assert_eq!(chosen(&tenths, 2), [0, 1, 2, 3], "never more than twice the usual number");
    }
}
