//! Tie points of a scene too large to be read at once: they are looked for in windows of its ground, spread evenly, each
//! read at full resolution and let go. What the windows show also tells each image's noise and contrast, which all its
//! chunks then share.
//!
//! Ties are given in pixels of the whole images. The heights seen in the first window with ties narrow the search of the rest.

use camera::ImagePoint;
use numeric::upper_median;
use raster::Window;
use rayon::prelude::*;
use sweep::SweepView;
use sweep::pointing::TieConfig;

use crate::dsm::pictures;
use crate::dsm::pointing::{PairTies, heights_seen, match_pairs};
use crate::dsm::scene::{Opened, read_view};
use crate::dsm::setup::{OutputGrid, image_span, image_window};
use crate::error::PipelineError;
use numeric::Progress;

/// Side of a window on the ground, cells of the grid.
const SIDE: usize = 1024;
/// Places looked at, and how many of them some pair must see; denser ones are tried where footprints fill little of
/// the grid. A dozen windows tell a shift and an affine map over an image many times over.
const PLACES: [f64; 3] = [12.0, 24.0, 48.0];
const SEEN_MIN: usize = 8;
/// Windows looked at, at most.
const WINDOWS_MAX: usize = 16;
/// Pixels read around a window: the wide search for a gross pointing error needs these.
const MARGIN: usize = 256;
/// Corners tried per pair and window: as many in all as in a scene of several times the size that is read at once.
const POINTS: usize = 240;
/// A part of an image less wide or high than this holds nothing to match, pixels.
const PART_MIN: usize = 128;
/// Heights may lie as far outside what the first window shows as three times its own span and this, metres.
const FAR_M: f64 = 1500.0;

/// What an image's windows tell of it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Character {
    /// Standard deviation of the noise at full resolution, one of each window.
    noise: Vec<f32>,
    /// Typical difference of neighbouring pixels on each level, one of each window.
    contrast: Vec<Vec<f32>>,
    /// Whether some window has contrast.
    has_picture: bool,
}

impl Character {
    fn learn(&mut self, view: &SweepView) {
        self.has_picture |= !pictures::is_blank(view);
        self.noise.push(view.noise);
        self.contrast.resize(self.contrast.len().max(view.contrast.len()), Vec::new());
        self.contrast.iter_mut().zip(&view.contrast).for_each(|(all, c)| all.push(*c));
    }

    /// Whether windows were seen and none has contrast.
    pub(crate) fn is_blank(&self) -> bool {
        !self.noise.is_empty() && !self.has_picture
    }

    /// Gives a view of a part of the image the noise and contrast of the whole.
    pub(crate) fn lend(&self, view: &mut SweepView) {
        if let Some(noise) = median(&self.noise) {
            view.noise = noise;
        }
        for (own, all) in view.contrast.iter_mut().zip(&self.contrast) {
            *own = median(all).unwrap_or(*own);
        }
    }
}

fn median(values: &[f32]) -> Option<f32> {
    upper_median(&mut values.to_vec())
}

/// Ties of the pairs, best pair first, over heights in `search`, and the images' characters.
///
/// # Errors
/// An image that cannot be read, a camera that fails.
pub(crate) fn match_in_windows(
    images: &[Opened],
    grid: &OutputGrid,
    pairs: &[(usize, usize)],
    search: (f64, f64),
    progress: &dyn Progress,
) -> Result<(Vec<PairTies>, Vec<Character>), PipelineError> {
    let places = places(images, grid, pairs, search)?;
    let all = TieConfig::default();
    let config = TieConfig { points: POINTS.max(all.points / places.len().max(1)), ..all };
    let mut characters = vec![Character::default(); images.len()];
    let mut out: Vec<PairTies> =
        pairs.iter().map(|&(reference, source)| PairTies { reference, source, ties: Vec::new() }).collect();
    let mut range = search;
    progress.begin("matching tie points", places.len());
    for place in places {
        let windows = windows(images, &grid.part(place)?, range)?;
        let views: Vec<SweepView> = images
            .par_iter()
            .zip(&windows)
            .map(|(o, w)| w.map_or_else(|| Ok(SweepView::absent(o.camera.clone())), |w| read_view(o, Some(w))))
            .collect::<Result<_, PipelineError>>()?;
        let is_there = |i: usize| windows[i].is_some();
        (0..images.len()).filter(|&i| is_there(i)).for_each(|i| characters[i].learn(&views[i]));
        let here: Vec<(usize, usize)> = pairs.iter().copied().filter(|p| is_there(p.0) && is_there(p.1)).collect();
        let found = match_pairs(&views, &here, range, &config, &|| ());
        if range == search
            && let Some(seen) = found.iter().find_map(|f| heights_seen(&views, f))
        {
            let far = 3.0 * (seen.1 - seen.0) + FAR_M;
            range = ((seen.0 - far).max(search.0), (seen.1 + far).min(search.1));
        }
        for pair in found {
            let own = out.iter_mut().find(|p| (p.reference, p.source) == (pair.reference, pair.source));
            let origin =
                |i: usize| windows[i].map_or(ImagePoint::default(), |w| ImagePoint::new(w.x as f64, w.y as f64));
            let (a, b) = (origin(pair.reference), origin(pair.source));
            let moved = pair.ties.iter().map(|t| sweep::pointing::Tie {
                reference: ImagePoint::new(t.reference.sample + a.sample, t.reference.line + a.line),
                source: ImagePoint::new(t.source.sample + b.sample, t.source.line + b.line),
                ..*t
            });
            own.into_iter().for_each(|p| p.ties.extend(moved.clone()));
        }
        progress.step();
    }
    Ok((out, characters))
}

/// The parts of the images that may show a place.
fn windows(images: &[Opened], place: &OutputGrid, range: (f64, f64)) -> Result<Vec<Option<Window>>, PipelineError> {
    let one = |o: &Opened| {
        let window = image_window(o, place, range, MARGIN)?;
        Ok(window.filter(|w| w.width.min(w.height) >= PART_MIN))
    };
    images.iter().map(one).collect()
}

/// Windows of the grid, evenly spread over the ground that some pair sees.
fn places(
    images: &[Opened],
    grid: &OutputGrid,
    pairs: &[(usize, usize)],
    search: (f64, f64),
) -> Result<Vec<Window>, PipelineError> {
    let middle = 0.5 * (search.0 + search.1);
    let mut seen = Vec::new();
    for wanted in PLACES {
        seen.clear();
        for place in lattice(grid.size, wanted) {
            if is_seen(images, &grid.part(place)?, pairs, middle)? {
                seen.push(place);
            }
        }
        if seen.len() >= SEEN_MIN {
            break;
        }
    }
    let every = seen.len().div_ceil(WINDOWS_MAX).max(1);
    Ok(seen.into_iter().step_by(every).collect())
}

/// About `wanted` windows in the middles of the fields of a lattice over the grid, which overlap as little as they can.
fn lattice((width, height): (usize, usize), wanted: f64) -> Vec<Window> {
    let fields = |along: usize, across: usize| {
        let n = (wanted * along as f64 / across as f64).sqrt().round().clamp(1.0, wanted) as usize;
        n.min(along.div_ceil(SIDE))
    };
    let (columns, rows) = (fields(width, height), fields(height, width));
    let start = |i: usize, n: usize, size: usize| {
        let centre = size * (2 * i + 1) / (2 * n);
        centre.saturating_sub(SIDE / 2).min(size.saturating_sub(SIDE)) as i64
    };
    let (w, h) = (SIDE.min(width), SIDE.min(height));
    let window = |c, r| Window { x: start(c, columns, width), y: start(r, rows, height), width: w, height: h };
    (0..rows).flat_map(|r| (0..columns).map(move |c| (c, r))).map(|(c, r)| window(c, r)).collect()
}

/// Whether both images of a pair see most of a place.
fn is_seen(
    images: &[Opened],
    place: &OutputGrid,
    pairs: &[(usize, usize)],
    height_m: f64,
) -> Result<bool, PipelineError> {
    let sees = |o: &Opened| {
        let span = image_span(o, place, (height_m, height_m), 0)?;
        let inside = span.intersection(&Window::whole(o.size.0, o.size.1));
        Ok::<bool, PipelineError>(inside.is_some_and(|i| 2 * i.width * i.height >= span.width * span.height))
    };
    let seeing: Vec<bool> = images.iter().map(sees).collect::<Result<_, _>>()?;
    Ok(pairs.iter().any(|p| seeing[p.0] && seeing[p.1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_spread_evenly_and_lie_inside() {
        for (size, expected) in [((20_000, 20_000), 9), ((40_000, 8_000), 16), ((700, 500), 1), ((1500, 3000), 6)] {
            let all = lattice(size, PLACES[0]);
            assert_eq!(all.len(), expected, "{size:?}");
            let whole = Window::whole(size.0, size.1);
            assert!(all.iter().all(|w| w.intersection(&whole) == Some(*w)), "{size:?}");
            assert!((1..all.len()).all(|i| all[..i].iter().all(|o| o != &all[i])), "{size:?}");
        }
    }

    #[test]
    fn an_image_is_blank_when_windows_were_seen_and_none_has_contrast() {
        let seen = |noise: &[f32], has_picture| Character { noise: noise.to_vec(), has_picture, ..Default::default() };
        assert!(!seen(&[], false).is_blank() && seen(&[0.0, 0.0], false).is_blank() && !seen(&[0.0], true).is_blank());
        assert_eq!((median(&[9.0, 1.0, 2.0]), median(&[])), (Some(2.0), None));
    }
}
