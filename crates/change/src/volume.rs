//! Volumes of change over sets of cells.

use serde::Serialize;

use crate::detect::{Change, ChangeRegion};

/// Volumes of change over a set of cells, with standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct Volume {
    /// Area of the cells with a difference, square metres.
    pub area_m2: f64,
    /// Area of the cells without one, square metres: they are not part of any volume.
    pub unknown_m2: f64,
    /// Volume gained in regions of change, cubic metres.
    pub gain_m3: f64,
    /// Its standard deviation, cubic metres.
    pub gain_sigma_m3: f64,
    /// Volume lost in regions of change, cubic metres, as a positive number.
    pub loss_m3: f64,
    /// Its standard deviation, cubic metres.
    pub loss_sigma_m3: f64,
    /// Sum of all differences, in regions of change or not, cubic metres.
    pub net_m3: f64,
    /// Its standard deviation, cubic metres.
    pub net_sigma_m3: f64,
}

/// Sums over one kind of cells.
#[derive(Default)]
struct Sums {
    cells: usize,
    height_m: f64,
    variance_m2: f64,
}

impl Sums {
    fn add(&mut self, difference_m: f64, sigma_m: f64) {
        self.cells += 1;
        self.height_m += difference_m;
        self.variance_m2 += sigma_m * sigma_m;
    }

    /// Returns volume and standard deviation, cubic metres. `walls_m3` is the deviation by the
    /// walls of the regions.
    fn volume(&self, change: &Change, walls_m3: f64) -> (f64, f64) {
        let area_m2 = self.cells as f64 * change.correlation.cell_area_m2;
        let sigma_m = change.mean_sigma_m(self.cells, self.variance_m2);
        (self.height_m * change.correlation.cell_area_m2, walls_m3.hypot(sigma_m * area_m2))
    }
}

/// Returns the volumes over cells, given by their indices into the rasters.
///
/// Gain and loss are summed over the regions of change only: sums of positive differences would be
/// above zero for noise alone. The net volume is the sum of all differences. The overreach of walls
/// is taken off all cells of a region alike.
pub fn volume_of(change: &Change, cells: impl IntoIterator<Item = usize>) -> Volume {
    let (mut gain, mut loss, mut all, mut unknown) = (Sums::default(), Sums::default(), Sums::default(), 0usize);
    let mut cells_of = vec![0usize; change.regions.len()];
    for at in cells {
        let (difference, sigma) = (f64::from(change.difference.data()[at]), f64::from(change.sigma.data()[at]));
        if !(difference.is_finite() && sigma.is_finite()) {
            unknown += 1;
            continue;
        }
        let number = (change.numbers.data()[at] as usize).wrapping_sub(1);
        let Some(region) = change.regions.get(number) else {
            all.add(difference, sigma);
            continue;
        };
        cells_of[number] += 1;
        let kept = difference * region.volume_m3 / (region.volume_m3 + region.overreach_m3);
        all.add(kept, sigma);
        if region.mean_m > 0.0 { gain.add(kept, sigma) } else { loss.add(kept, sigma) }
    }
    let walls = |counts: fn(&ChangeRegion) -> bool| -> f64 {
        let parts = change.regions.iter().zip(&cells_of).filter(|(region, _)| counts(region));
        let part = |(region, cells): (&ChangeRegion, &usize)| {
            (region.wall_sigma_m3 * *cells as f64 / region.cells.len().max(1) as f64).powi(2)
        };
        parts.map(part).sum::<f64>().sqrt()
    };
    let cell_area_m2 = change.correlation.cell_area_m2;
    let (gain_m3, gain_sigma_m3) = gain.volume(change, walls(|region| region.mean_m > 0.0));
    let (loss_m3, loss_sigma_m3) = loss.volume(change, walls(|region| region.mean_m <= 0.0));
    let (net_m3, net_sigma_m3) = all.volume(change, walls(|_| true));
    Volume {
        area_m2: all.cells as f64 * cell_area_m2,
        unknown_m2: unknown as f64 * cell_area_m2,
        gain_m3,
        gain_sigma_m3,
        loss_m3: 0.0 - loss_m3,
        loss_sigma_m3,
        net_m3,
        net_sigma_m3,
    }
}
