//! The shift on which all of the model agrees, before any part of it is trusted alone.
//!
//! Every spot of the model votes: its correlation with the image is computed at each whole-pixel
//! shift, and the mean over all spots is taken. A roof among many that look alike tells no place,
//! and neither do grey values that a season has changed; what all of them have in common does.
//!
//! A spot is compared with the pixels at the places of its own cells. A picture that is laid with
//! a wrong pointing would have the borders and the hidden cells of another place.

use camera::ImagePoint;
use raster::{Grid, Window};
use rayon::prelude::*;
use sweep::pointing::correlations_at_shifts;

use super::error::RegisterError;
use crate::ortho::{OrthoImage, window_of};

/// Every so many columns and rows of a spot are compared. Neighbouring pixels of an image show
/// nearly the same.
pub(super) const STEP: usize = 2;
/// Least number of cells that are compared, those of the least chip (15 × 15) at this step.
const CELLS_MIN: usize = 15 * 15 / (STEP * STEP);
/// Mean correlation that is a shift, its standard errors. Of foreign images the best of all shifts
/// reached 7 (ten places of `benches/evidence/registration.py`), more than chance allows, because
/// spots overlap; of images of the same place it had 14 and more.
const SIGNIFICANT: f64 = 10.0;
/// Most shifts that are looked into. Crowns under another sun look like the same crowns beside
/// their places, and stripes like the stripes beside them.
const SHIFTS_MAX: usize = 3;
/// Votes that are counted at once: those of a wide search take megabytes each.
const COUNTED: usize = 16;

/// A spot of the model, and the image around it.
pub(super) struct Voter<'a> {
    /// Pictures of the spot, with NaN where they may not be compared.
    chips: &'a [Grid<f32>],
    /// Cells of the pictures, and the pixel of the image where each is expected.
    cells: Vec<(usize, usize)>,
    /// Mean over the bands of the image.
    pixels: Grid<f32>,
}

impl<'a> Voter<'a> {
    /// Reads the pixels of an image up to `reach` pixels around where it shows a spot; `None` where
    /// it shows none of it.
    pub(super) fn read(
        chips: &'a [Grid<f32>],
        places: &[Option<ImagePoint>],
        image: &OrthoImage,
        reach: usize,
    ) -> Result<Option<Self>, RegisterError> {
        let Some(window) = window_of(places).map(|window| window.grown(reach)) else { return Ok(None) };
        let pixels = grey(image, window)?;
        let pixel = |(cell, place): (usize, &Option<ImagePoint>)| {
            let place = place.as_ref()?;
            let [x, y] = [place.sample.round() as i64 - window.x, place.line.round() as i64 - window.y];
            Some((cell, y as usize * window.width + x as usize))
        };
        let cells = places.iter().enumerate().filter_map(pixel).collect();
        Ok(Some(Self { chips, cells, pixels }))
    }

    /// Returns the correlation at every shift, row by row, less the mean over all shifts; 0 where
    /// too little is seen, `None` where the spot tells nothing.
    fn vote(&self, reach: usize) -> Option<Vec<f64>> {
        let votes: Vec<Vec<f64>> = self.chips.iter().filter_map(|chip| self.vote_of(chip, reach)).collect();
        let mean = |k: usize| votes.iter().map(|vote| vote[k]).sum::<f64>() / votes.len() as f64;
        let first = votes.first()?;
        Some((0..first.len()).map(mean).collect())
    }

    fn vote_of(&self, chip: &Grid<f32>, reach: usize) -> Option<Vec<f64>> {
        let known = self.cells.iter().map(|(cell, pixel)| (f64::from(chip.data()[*cell]), *pixel));
        let known: Vec<(f64, usize)> = known.filter(|(grey, _)| grey.is_finite()).collect();
        if known.len() < CELLS_MIN {
            return None;
        }
        let scores = correlations_at_shifts(&known, &self.pixels, reach);
        let count = scores.iter().flatten().count();
        let mean = scores.iter().flatten().sum::<f64>() / count as f64;
        (count > 0).then(|| scores.iter().map(|score| score.map_or(0.0, |score| score - mean)).collect())
    }
}

/// Returns the shifts, columns and rows of whole pixels within `reach`, at which the image shows
/// more of the model than at all shifts around them, and that for certain: at most [`SHIFTS_MAX`],
/// the one that shows most first.
pub(super) fn common_shifts(voters: &[Voter<'_>], reach: usize) -> Vec<[f64; 2]> {
    let side = 2 * reach + 1;
    let (mut count, mut means, mut squares) = (0.0, Grid::filled(side, side, 0.0), vec![0.0; side * side]);
    for some in voters.chunks(COUNTED) {
        let votes: Vec<Vec<f64>> = some.par_iter().filter_map(|voter| voter.vote(reach)).collect();
        for vote in votes {
            count += 1.0;
            means.data_mut().iter_mut().zip(&vote).for_each(|(sum, vote)| *sum += vote);
            squares.iter_mut().zip(&vote).for_each(|(sum, vote)| *sum += vote * vote);
        }
    }
    means.data_mut().iter_mut().for_each(|mean| *mean /= count);
    let inside = (1..side - 1).flat_map(|y| (1..side - 1).map(move |x| (x, y)));
    let is_significant = |at: (usize, usize)| {
        let mean = means[at];
        let variance = (squares[at.1 * side + at.0] - count * mean * mean) / (count - 1.0);
        mean > SIGNIFICANT * (variance / count).sqrt()
    };
    let mut peaks: Vec<(usize, usize)> = inside.filter(|at| means.is_peak(*at) && is_significant(*at)).collect();
    peaks.sort_by(|a, b| means[*b].total_cmp(&means[*a]));
    peaks.iter().take(SHIFTS_MAX).map(|&(x, y)| [x, y].map(|at| at as f64 - reach as f64)).collect()
}

/// Returns the mean over the bands of a window of an image.
fn grey(image: &OrthoImage, window: Window) -> Result<Grid<f32>, RegisterError> {
    let bands = image.source.info().bands;
    let mut sum = Grid::filled(window.width, window.height, 0.0f32);
    for band in 1..=bands {
        let band = image.source.read_samples(band, window)?;
        sum.data_mut().iter_mut().zip(band.data()).for_each(|(sum, value)| *sum += value / bands as f32);
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use numeric::random::{hash64, unit_interval};

    use super::*;

    const CHIP: usize = 61;
    const REACH: usize = 20;
    /// Side of the pixels around a chip.
    const SIDE: usize = CHIP + 2 * REACH;
    const SPOTS: u64 = 80;

    fn noise(seed: u64, x: i64, y: i64) -> f64 {
        unit_interval(hash64(hash64(hash64(seed) ^ x as u64) ^ y as u64)) - 0.5
    }

    /// Chips of places with texture that is the same over two pixels; a fifth of the columns is
    /// hidden.
    fn chip(seed: u64) -> Grid<f32> {
        let cell = |i: usize| {
            let [x, y] = [i % CHIP, i / CHIP].map(|at| at as i64);
            if x % 5 == 0 { f32::NAN } else { noise(seed, x / 2, y / 2) as f32 }
        };
        Grid::from_vec(CHIP, CHIP, (0..CHIP * CHIP).map(cell).collect()).unwrap()
    }

    /// An image of such a place, moved by 7 columns and −9 rows, that shows so much of its texture
    /// under noise of the same spread.
    fn pixels(seed: u64, shown: f64) -> Grid<f32> {
        let pixel = |i: usize| {
            let [x, y] = [i % SIDE, i / SIDE].map(|at| at as i64 - REACH as i64);
            let (x, y) = (x - 7, y + 9);
            (shown * noise(seed, x.div_euclid(2), y.div_euclid(2)) + noise(seed + SPOTS, x, y)) as f32
        };
        Grid::from_vec(SIDE, SIDE, (0..SIDE * SIDE).map(pixel).collect()).unwrap()
    }

    fn shifts_of(shown: f64) -> Vec<[f64; 2]> {
        let chips: Vec<[Grid<f32>; 1]> = (0..SPOTS).map(|seed| [chip(seed)]).collect();
        let cells = (0..CHIP * CHIP).map(|i| (i, (i / CHIP + REACH) * SIDE + i % CHIP + REACH));
        let voter = |(seed, chips)| Voter { chips, cells: cells.clone().collect(), pixels: pixels(seed, shown) };
        let voters: Vec<Voter<'_>> = (0..SPOTS).zip(chips.iter().map(|chips| &chips[..])).map(voter).collect();
        common_shifts(&voters, REACH)
    }

    #[test]
    fn all_spots_together_know_a_shift_that_none_shows_clearly() {
        // A chip alone correlates by 0.1 to 0.2, and 0.6 is asked of one.
        assert_eq!(shifts_of(0.15), [[7.0, -9.0]]);
        assert_eq!(shifts_of(1.0), [[7.0, -9.0]]);
        assert!(shifts_of(0.0).is_empty(), "another place");
        assert!(common_shifts(&[], REACH).is_empty());
    }
}
