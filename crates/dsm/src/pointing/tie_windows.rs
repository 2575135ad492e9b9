//! Tie points and image radiometry of a scene that is too large to be read at once.
//!
//! Ties are searched for in windows of the ground, spread evenly over the scene. Each window is
//! read at full resolution and dropped. The windows also give the noise and contrast of each image,
//! which all its chunks then share.
//!
//! Ties are in pixels of the whole images. The heights seen in the first window with ties narrow
//! the search in the others.

use camera::ImagePoint;
use crs::MapProjection;
use geo::{Area, Polygon};
use numeric::Progress;
use raster::Window;
use rayon::prelude::*;
use reconstruct::{DsmGrid, HeightRange, ImagePair, ViewGeometry, shared_part};
use sweep::SweepView;
use sweep::pointing::{Tie, TieConfig};

use crate::error::DsmError;
use crate::images::image_pixels::read_view;
use crate::images::image_windows::GroundBox;
use crate::images::radiometry::ImageRadiometry;
use crate::images::scene_image::SceneImage;
use crate::planning::chunk_side::cores;
use crate::pointing::evidence::is_beyond_chance;
use crate::pointing::partners::ALL_MAX;
use crate::pointing::ties::{PairTies, TIES_MIN, heights_seen, match_pairs};

/// Side of a window on the ground, cells of the grid.
const SIDE: usize = 1024;
/// Number of places looked at. Denser ones are tried where footprints fill little of the grid. A
/// dozen windows determine a shift and an affine map over an image many times over.
const PLACES: [f64; 3] = [12.0, 24.0, 48.0];
/// Share of a place that both images of a pair show, for the place to count as seen.
const SEEN_SHARE: f64 = 0.5;
/// Number of places that some pair must see, or the next denser places are tried.
const SEEN_MIN: usize = 8;
/// Largest number of windows read.
const WINDOWS_MAX: usize = 16;
/// Side of a window where there are more pairs than [`ALL_MAX`], cells of the grid: dozens of
/// images show it, and all are read at once.
const SIDE_OF_BLOCK: usize = 512;
/// Windows in which each of so many pairs is matched. Together they try as many corners as a pair
/// that is read at once.
const PLACES_PER_PAIR: usize = 5;
/// Ties of a pair in one of these windows that are not there by chance. All its ties together are
/// judged once more.
const FEWEST: usize = 4;
/// Multiples of the golden ratio, without their whole parts, are spread evenly however many there
/// are.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;
/// Pixels read around a window, for the wide search after a gross pointing error.
const MARGIN: usize = 256;
/// Corners tried per pair and window, at least. All windows together try as many as a scene of
/// several times the size that is read at once.
const POINTS: usize = 240;
/// A part of an image less wide or high than this holds nothing to match, pixels.
const PART_MIN: usize = 128;
/// Heights may lie outside those of the first window with ties by three times their span and this,
/// metres.
const FAR_M: f64 = 1500.0;

/// A window of the grid and the pairs that are matched in it.
struct Place {
    window: Window,
    pairs: Vec<ImagePair>,
}

/// Returns the ties of the pairs, given best first, over heights in `search`, and the radiometry of
/// the images.
///
/// # Errors
/// [`DsmError::Image`] for an image that cannot be read, [`DsmError::Camera`], [`DsmError::Crs`],
/// [`DsmError::Cancelled`].
pub(crate) fn match_in_windows(
    images: &[SceneImage],
    grid: &DsmGrid,
    geometry: &ViewGeometry,
    pairs: &[ImagePair],
    search: HeightRange,
    progress: &dyn Progress,
) -> Result<(Vec<PairTies>, Vec<ImageRadiometry>), DsmError> {
    let projection = grid.projection()?;
    let all = TieConfig::default();
    let (places, points, least) = if pairs.len() <= ALL_MAX {
        let windows = places(images, grid, &projection, pairs, search)?;
        let points = POINTS.max(all.points / windows.len().max(1));
        (windows.into_iter().map(|window| Place { window, pairs: pairs.to_vec() }).collect(), points, TIES_MIN)
    } else {
        (places_of_pairs(grid, &projection, geometry, pairs)?, all.points / PLACES_PER_PAIR, FEWEST)
    };
    let config = TieConfig { points, ..all };
    let mut radiometry = vec![ImageRadiometry::default(); images.len()];
    let mut out: Vec<PairTies> = pairs.iter().map(|&pair| PairTies::new(pair, Vec::new())).collect();
    let mut range = search;
    progress.begin("matching tie points", places.len());
    for place in places {
        progress.check_cancelled()?;
        let mut windows = windows(images, &GroundBox::new(&grid.part(place.window), &projection, range)?)?;
        let is_matched = |i: usize| place.pairs.iter().any(|pair| pair.has(i));
        windows.iter_mut().enumerate().filter(|(i, _)| !is_matched(*i)).for_each(|(_, window)| *window = None);
        let views = read_parts(images, &windows)?;
        let is_there = |i: usize| windows[i].is_some();
        (0..images.len()).filter(|&i| is_there(i)).for_each(|i| radiometry[i].add_window(&views[i]));
        let here: Vec<ImagePair> =
            place.pairs.into_iter().filter(|p| is_there(p.first) && is_there(p.second)).collect();
        let found = match_pairs(&views, &here, range, (&config, least), &|| ());
        if range == search
            && let Some(seen) = found.iter().find_map(|f| heights_seen(&views, f))
        {
            let far = 3.0 * seen.span_m() + FAR_M;
            range = seen.grown(far, far).cut_to(search);
        }
        for pair in &found {
            if let Some(own) = out.iter_mut().find(|own| own.pair == pair.pair) {
                let whole = |ties: &[Tie]| in_whole_images(pair.pair, ties, &windows);
                own.ties.extend(whole(&pair.ties));
                own.corners.extend(whole(pair.as_found()));
                own.patches.extend(whole(&pair.patches));
            }
        }
        progress.step();
    }
    for pair in &mut out {
        let cameras = (&images[pair.pair.first].camera, &images[pair.pair.second].camera);
        if !is_beyond_chance(cameras, &pair.ties, range.middle_m(), TIES_MIN) {
            *pair = PairTies::new(pair.pair, Vec::new());
        }
    }
    Ok((out, radiometry))
}

/// Reads one window per image. An image without a window gives an absent view.
fn read_parts(images: &[SceneImage], windows: &[Option<Window>]) -> Result<Vec<SweepView>, DsmError> {
    let one = |(image, window): (&SceneImage, &Option<Window>)| match window {
        Some(window) => read_view(image, *window),
        None => Ok(SweepView::absent(image.camera.clone())),
    };
    images.par_iter().zip(windows).map(one).collect()
}

/// Returns ties found in windows in the frames of the whole images.
fn in_whole_images(pair: ImagePair, ties: &[Tie], windows: &[Option<Window>]) -> Vec<Tie> {
    let origin = |i: usize| windows[i].map_or(ImagePoint::new(0.0, 0.0), |w| ImagePoint::new(w.x as f64, w.y as f64));
    let (a, b) = (origin(pair.first), origin(pair.second));
    let moved = |t: &Tie| Tie {
        reference: ImagePoint::new(t.reference.sample + a.sample, t.reference.line + a.line),
        source: ImagePoint::new(t.source.sample + b.sample, t.source.line + b.line),
        ..*t
    };
    ties.iter().map(moved).collect()
}

/// Returns the parts of the images that may show a place.
fn windows(images: &[SceneImage], place: &GroundBox) -> Result<Vec<Option<Window>>, DsmError> {
    let one = |image: &SceneImage| {
        let window = place.window_in(image, MARGIN)?;
        Ok(window.filter(|w| w.width.min(w.height) >= PART_MIN))
    };
    images.iter().map(one).collect()
}

/// Returns windows of the grid for a block of many images, with the pairs that are matched in each:
/// every pair in [`PLACES_PER_PAIR`] of them where it shares enough ground.
///
/// The windows are tried in an order that jumps over the scene, so that those of a pair are spread
/// over what it shares.
fn places_of_pairs(
    grid: &DsmGrid,
    projection: &MapProjection,
    geometry: &ViewGeometry,
    pairs: &[ImagePair],
) -> Result<Vec<Place>, DsmError> {
    let mut windows = cores(grid.size, SIDE_OF_BLOCK);
    let jump = |i: usize| (i as f64 * GOLDEN_RATIO).fract();
    let mut order: Vec<usize> = (0..windows.len()).collect();
    order.sort_by(|a, b| jump(*a).total_cmp(&jump(*b)));
    windows = order.into_iter().map(|i| windows[i]).collect();
    let height = HeightRange::at(geometry.centre.height_m);
    let area_min = (PART_MIN as f64 * grid.gsd_m).powi(2);
    let mut have = vec![0; pairs.len()];
    let mut places = Vec::new();
    for window in windows {
        let ground = GroundBox::new(&grid.part(window), projection, height)?.outline(&geometry.frame);
        let seen: Vec<Option<Polygon<f64>>> = geometry.outlines.iter().map(|o| shared_part(o, &ground)).collect();
        let shared = |p: &ImagePair| shared_part(seen[p.first].as_ref()?, seen[p.second].as_ref()?);
        let mut here = Vec::new();
        for (pair, have) in pairs.iter().zip(&mut have).filter(|(_, have)| **have < PLACES_PER_PAIR) {
            if shared(pair).is_some_and(|part| part.unsigned_area() >= area_min) {
                *have += 1;
                here.push(*pair);
            }
        }
        if !here.is_empty() {
            places.push(Place { window, pairs: here });
        }
    }
    Ok(places)
}

/// Returns windows of the grid, evenly spread over the ground that some pair sees.
fn places(
    images: &[SceneImage],
    grid: &DsmGrid,
    projection: &MapProjection,
    pairs: &[ImagePair],
    search: HeightRange,
) -> Result<Vec<Window>, DsmError> {
    let middle = HeightRange::at(search.middle_m());
    let seen_by = |wanted: f64, share: f64| -> Result<Vec<Window>, DsmError> {
        let mut seen = Vec::new();
        for place in lattice(grid.size, wanted) {
            let ground = GroundBox::new(&grid.part(place), projection, middle)?;
            if is_seen(images, &ground, pairs, share)? {
                seen.push(place);
            }
        }
        Ok(seen)
    };
    let mut seen = Vec::new();
    for wanted in PLACES {
        seen = seen_by(wanted, SEEN_SHARE)?;
        if seen.len() >= SEEN_MIN {
            break;
        }
    }
    if seen.is_empty() {
        // Strips narrower than a window see no window whole.
        seen = seen_by(PLACES[PLACES.len() - 1], 0.0)?;
    }
    let every = seen.len().div_ceil(WINDOWS_MAX).max(1);
    Ok(seen.into_iter().step_by(every).collect())
}

/// Returns about `wanted` windows in the middles of the fields of a lattice over the grid. They
/// overlap as little as they can.
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

/// Returns whether both images of a pair see a share of a place, whose box has a single height, and
/// enough of it to be matched.
fn is_seen(images: &[SceneImage], place: &GroundBox, pairs: &[ImagePair], share: f64) -> Result<bool, DsmError> {
    let sees = |image: &SceneImage| {
        let span = place.span_in(image, 0)?;
        let inside = span.intersection(&image.whole());
        let is_enough = |inside: Window| {
            let pixels = |w: Window| w.width as f64 * w.height as f64;
            inside.width.min(inside.height) >= PART_MIN && pixels(inside) >= share * pixels(span)
        };
        Ok::<bool, DsmError>(inside.is_some_and(is_enough))
    };
    let seeing: Vec<bool> = images.iter().map(sees).collect::<Result<_, _>>()?;
    Ok(pairs.iter().any(|p| seeing[p.first] && seeing[p.second]))
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
}
