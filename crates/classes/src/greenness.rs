//! A vegetation index of images whose values are not reflectances.
//!
//! ```text
//! NDVI = (g n − r) / (g n + r),   r = red − black,  n = near infrared − black
//! ```
//!
//! The black level of a band holds the path radiance and the dark current; it is that of the
//! darkest cells, which are shadows and water (Chavez 1988). Without it shadows are neither green
//! nor grey. The gain `g` makes up for the gains of the bands and for the sunlight, which is weaker
//! in the near infrared. It is the one that gives most roofs the index of roofing, because tiles,
//! gravel, metal and concrete are nearly as bright in both bands. On reflectances both do nothing
//! much.

use numeric::nearest_quantile;
use raster::Grid;

/// Share of the cells of a band that are no brighter than its black level. The very darkest are
/// outliers of the noise.
const BLACK_SHARE: f64 = 0.002;
/// Near infrared over red of the median roof: an index of 0.05.
const ROOF_RATIO: f32 = 1.1;
/// Fewest cells of roofs that tell the gain.
const ROOFS_MIN: usize = 400;
/// Range of gains that sensors and the sunlight explain.
const GAINS: [f32; 2] = [0.5, 2.5];

/// Red and near infrared of one image at the cells of a surface; NaN where it does not see them.
#[derive(Debug, Clone, Copy)]
pub struct SpectralCells<'a> {
    /// Values of the red band.
    pub red: &'a Grid<f32>,
    /// Values of the near-infrared band.
    pub nir: &'a Grid<f32>,
    /// Values of a black surface in red and near infrared.
    pub black: [f32; 2],
    /// Factor on the near infrared.
    pub nir_gain: f32,
}

impl SpectralCells<'_> {
    /// Returns red and near infrared above black, before the gain.
    fn above_black(&self, at: usize) -> [f32; 2] {
        [(self.red, self.black[0]), (self.nir, self.black[1])].map(|(band, black)| {
            let value = band.data()[at];
            // NaN stays NaN, which `max` would replace.
            if value < black { 0.0 } else { value - black }
        })
    }
}

/// Returns the black level of a band; 0 for a band without values.
pub fn black_level(band: &Grid<f32>) -> f32 {
    let mut known: Vec<f32> = band.data().iter().copied().filter(|v| v.is_finite()).collect();
    nearest_quantile(&mut known, BLACK_SHARE).unwrap_or(0.0)
}

/// Returns the gain with which the median of the roofs is as bright in both bands as roofing is; 1
/// where there are too few roofs.
pub fn nir_gain(cells: &SpectralCells<'_>, roofs: &Grid<bool>) -> f32 {
    let of_roofs = (0..roofs.data().len()).filter(|at| roofs.data()[*at]).map(|at| cells.above_black(at));
    let mut ratios: Vec<f32> =
        of_roofs.filter(|[red, nir]| *red > 0.0 && *nir > 0.0).map(|[red, nir]| nir / red).collect();
    if ratios.len() < ROOFS_MIN {
        return 1.0;
    }
    nearest_quantile(&mut ratios, 0.5).map_or(1.0, |ratio| (ROOF_RATIO / ratio).clamp(GAINS[0], GAINS[1]))
}

/// Returns the vegetation index of each cell, −1 to 1; NaN where the image has no value, and where
/// both bands are black.
pub fn vegetation_index(cells: &SpectralCells<'_>) -> Grid<f32> {
    let mut index = cells.red.map(|_| f32::NAN);
    for (at, value) in index.data_mut().iter_mut().enumerate() {
        let [red, nir] = cells.above_black(at);
        let nir = cells.nir_gain * nir;
        let sum = red + nir;
        *value = if sum > 0.0 { (nir - red) / sum } else { f32::NAN };
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Roofs, lawns and shadows as a sensor sees them whose near infrared is weak and whose bands
    /// have different black levels.
    #[test]
    fn black_levels_and_gains_do_not_change_the_index() {
        let reflectance = |k: usize| match k % 4 {
            0 => [0.0, 0.0],
            1 => [0.05, 0.5],
            2 => [0.01, 0.09],
            _ => [0.2, 0.22],
        };
        let band = |which: usize, gain: f32, black: f32| {
            let values = (0..4000).map(|k| black + gain * reflectance(k)[which]).collect();
            Grid::from_vec(80, 50, values).unwrap()
        };
        let (red, nir) = (band(0, 2000.0, 150.0), band(1, 1300.0, 60.0));
        let mut cells = SpectralCells { red: &red, nir: &nir, black: [&red, &nir].map(black_level), nir_gain: 1.0 };
        assert_eq!(cells.black, [150.0, 60.0]);
        let roofs = Grid::from_vec(80, 50, (0..4000).map(|k| k % 4 == 3).collect()).unwrap();
        cells.nir_gain = nir_gain(&cells, &roofs);
        let index = vegetation_index(&cells);
        let expected = [f32::NAN, 0.45 / 0.55, 0.08 / 0.1, 0.02 / 0.42];
        for (found, expected) in index.data().iter().zip(expected) {
            let is_close = (found - expected).abs() < 1e-3;
            assert!(is_close || expected.is_nan() && found.is_nan(), "{found} instead of {expected}");
        }
        let few = roofs.map(|_| false);
        assert_eq!(nir_gain(&cells, &few), 1.0);
    }

    #[test]
    fn cells_that_an_image_does_not_see_have_no_index() {
        let red = Grid::from_vec(3, 1, vec![f32::NAN, 5.0, 3.0]).unwrap();
        let nir = Grid::from_vec(3, 1, vec![9.0, f32::NAN, 9.0]).unwrap();
        let index = vegetation_index(&SpectralCells { red: &red, nir: &nir, black: [0.0; 2], nir_gain: 1.0 });
        assert!(index[(0, 0)].is_nan() && index[(1, 0)].is_nan());
        assert_eq!(index[(2, 0)], 0.5);
    }
}
