//! Completeness of the objects above the terrain, by footprint and by volume (the measures of
//! core3d-metrics).
//!
//! A cell stands if its surface is more than a threshold above the terrain, in the reference and in
//! the test alike. A void of the test does not stand. Footprints are areas. Volumes are the heights
//! above the terrain over the standing cells. The shared volume uses the lower of both heights
//! where both stand. recall = shared / reference, precision = shared / test, IoU = shared /
//! (reference + test − shared).

use crate::measures::terrain::TerrainSource;
use raster::Grid;
use serde::Serialize;

/// Sizes of two sets and of their intersection, in square metres or cubic metres.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Overlap {
    /// Size in the reference.
    pub reference: f64,
    /// Size in the test.
    pub test: f64,
    /// Size of the intersection.
    pub shared: f64,
}

impl Overlap {
    /// Returns the share of the reference that is found, or `None` if there is nothing to find.
    pub fn recall(&self) -> Option<f64> {
        share(self.shared, self.reference)
    }

    /// Returns the share of the test that is right, or `None` if the test has nothing.
    pub fn precision(&self) -> Option<f64> {
        share(self.shared, self.test)
    }

    /// Returns the intersection over union, or `None` if neither has anything.
    pub fn iou(&self) -> Option<f64> {
        share(self.shared, self.reference + self.test - self.shared)
    }
}

fn share(part: f64, whole: f64) -> Option<f64> {
    (whole > 0.0).then(|| part / whole)
}

/// Completeness of the objects above the terrain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Standing {
    /// Lowest height above the terrain of a standing cell, metres.
    pub threshold_m: f64,
    /// Source of the terrain.
    pub terrain: TerrainSource,
    /// Footprints, m².
    pub footprint: Overlap,
    /// Volumes, m³.
    pub volume: Overlap,
}

/// Compares the standing objects at the cells for which `counts` is true and that have a terrain
/// and a reference.
pub(crate) fn standing(
    (reference, test): (&Grid<f32>, &Grid<f32>),
    (terrain, source): (&Grid<f32>, TerrainSource),
    cell_area_m2: f64,
    threshold_m: f64,
    counts: impl Fn(usize) -> bool,
) -> Standing {
    let (mut footprint, mut volume) = (Overlap::default(), Overlap::default());
    let heights = reference.data().iter().zip(test.data()).zip(terrain.data()).enumerate();
    for (i, ((&reference, &test), &ground)) in heights {
        let above = f64::from(reference) - f64::from(ground);
        if !above.is_finite() || !counts(i) {
            continue;
        }
        let stands = |height: f64| if height > threshold_m { height } else { 0.0 };
        // The comparison in `stands` is false for a void.
        let (of_reference, of_test) = (stands(above), stands(f64::from(test) - f64::from(ground)));
        for (overlap, of_reference, of_test) in [
            (&mut footprint, f64::from(of_reference > 0.0), f64::from(of_test > 0.0)),
            (&mut volume, of_reference, of_test),
        ] {
            overlap.reference += of_reference * cell_area_m2;
            overlap.test += of_test * cell_area_m2;
            overlap.shared += of_reference.min(of_test) * cell_area_m2;
        }
    }
    Standing { threshold_m, terrain: source, footprint, volume }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_roof_half_found_and_half_too_high() {
        let grid = |cells: [f32; 6]| Grid::from_vec(6, 1, cells.to_vec()).unwrap();
        let reference = grid([10.0, 10.0, 10.0, 0.5, 0.0, f32::NAN]);
        let test = grid([12.0, f32::NAN, 1.0, 4.0, 0.0, 9.0]);
        let terrain = grid([0.0; 6]);
        let found = standing((&reference, &test), (&terrain, TerrainSource::Given), 2.0, 2.0, |_| true);
        assert_eq!(found.footprint, Overlap { reference: 6.0, test: 4.0, shared: 2.0 });
        assert_eq!(found.volume, Overlap { reference: 60.0, test: 32.0, shared: 20.0 });
        assert_eq!(found.footprint.recall(), Some(1.0 / 3.0));
        assert_eq!(found.footprint.precision(), Some(0.5));
        assert_eq!(found.footprint.iou(), Some(0.25));
        let nothing = standing((&reference, &test), (&terrain, TerrainSource::Given), 2.0, 2.0, |_| false);
        assert_eq!((nothing.volume.iou(), nothing.volume.recall()), (None, None));
    }
}
