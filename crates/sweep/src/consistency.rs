//! Cross-view consistency: a height is kept when other views' own heights agree with it.
//!
//! A reference pixel at its height goes to the ground and into each source, whose own height there must be the same
//! within a tolerance. The tolerance is a length: the height by which the parallax between the two views changes by a
//! stated number of pixels (SkySplat's |Δh|/|h| < 0.2 breaks near and below height 0; SatMVS uses < 1 px and < 2.5 m).

use raster::{Grid, Window};
use rayon::prelude::*;

use crate::SweepError;
use crate::geometry::{TileMap, source_from_reference};
use crate::level::{HeightMap, paste, tiles};
use crate::view::View;

/// Parameters of the check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConsistencyConfig {
    /// Largest disagreement, pixels of parallax between the two views.
    pub tolerance_px: f64,
    /// Side of the tiles in which the chain is replaced by a local map.
    pub tile: usize,
    /// Largest error of that map, pixels.
    pub map_tolerance_px: f64,
}

impl Default for ConsistencyConfig {
    /// One pixel is the left–right threshold of CARS and S2P.
    fn default() -> Self {
        Self { tolerance_px: 1.0, tile: 64, map_tolerance_px: 0.1 }
    }
}

/// A view and its heights on one level.
#[derive(Debug, Clone, Copy)]
pub struct Heights<'a> {
    /// Its place among the views.
    pub index: usize,
    /// The view.
    pub view: &'a View,
    /// Its heights on the level.
    pub map: &'a HeightMap,
}

/// How many of `sources` agree with each pixel of the reference.
///
/// # Errors
/// A camera that fails inside the scene.
pub fn count_agreeing(
    reference: Heights<'_>,
    sources: &[Heights<'_>],
    level: u32,
    config: &ConsistencyConfig,
) -> Result<Grid<u8>, SweepError> {
    let map = reference.map;
    let (width, height) = (map.height_m.width(), map.height_m.height());
    let windows = tiles(Window::whole(width, height), config.tile);
    let parts: Vec<Grid<u8>> = windows
        .par_iter()
        .map(|w| {
            let mut counts = Grid::filled(w.width, w.height, 0);
            for s in sources {
                count_in_tile(reference, *s, level, *w, config, &mut counts)?;
            }
            Ok(counts)
        })
        .collect::<Result<_, SweepError>>()?;
    let mut out = Grid::filled(width, height, 0u8);
    for (w, part) in windows.iter().zip(&parts) {
        paste(&mut out, *w, part);
    }
    Ok(out)
}

fn count_in_tile(
    reference: Heights<'_>,
    source: Heights<'_>,
    level: u32,
    w: Window,
    config: &ConsistencyConfig,
    counts: &mut Grid<u8>,
) -> Result<(), SweepError> {
    let Some(range) = height_span(reference.map, w) else { return Ok(()) };
    let corners = [w.x as f64, w.y as f64, (w.x + w.width as i64 - 1) as f64, (w.y + w.height as i64 - 1) as f64];
    let exact = |p, h| source_from_reference(&reference.view.camera, &source.view.camera, level, p, h);
    // A source whose camera does not reach the tile has nothing to say there.
    let Ok(map) = TileMap::fit(corners, range, exact) else { return Ok(()) };
    let failed = |e| SweepError::Camera { view: source.index, source: e };
    let fits = map.max_error_px <= config.map_tolerance_px;
    let parallax = parallax_per_metre(&map);
    let tolerance_m = config.tolerance_px / parallax.max(f64::MIN_POSITIVE);
    for y in 0..w.height {
        for x in 0..w.width {
            let at = (w.x as usize + x, w.y as usize + y);
            let own = reference.map.height_m[at];
            if own.is_nan() {
                continue;
            }
            let height_m = reference.map.origin_m + f64::from(own);
            let p = [at.0 as f64, at.1 as f64];
            let q = if fits { map.at(p, height_m) } else { exact(p, height_m).map_err(failed)? };
            if agrees(source.map, q, height_m, tolerance_m) {
                counts[(x, y)] = counts[(x, y)].saturating_add(1);
            }
        }
    }
    Ok(())
}

/// Source pixels per metre of height.
fn parallax_per_metre(map: &TileMap) -> f64 {
    let h = map.mid_height_m();
    let (a, b) = (map.at([0.0, 0.0], h - 0.5), map.at([0.0, 0.0], h + 0.5));
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// Whether one of the four pixels around `q` has a height within the tolerance.
fn agrees(map: &HeightMap, q: [f64; 2], height_m: f64, tolerance_m: f64) -> bool {
    // Also for a position that is no number.
    if !(q[0] >= -1.0 && q[1] >= -1.0) {
        return false;
    }
    // The pixels to the right and below; casts of what is not negative round down.
    let (right, below) = ((q[0] + 1.0) as usize, (q[1] + 1.0) as usize);
    let wanted = height_m - map.origin_m;
    let mut rows = below.saturating_sub(1)..(below + 1).min(map.height_m.height());
    let columns = right.saturating_sub(1)..(right + 1).min(map.height_m.width());
    let near = |h: &f32| (f64::from(*h) - wanted).abs() <= tolerance_m;
    columns.start < columns.end && rows.any(|y| map.height_m.row(y)[columns.clone()].iter().any(near))
}

/// Least and greatest height in a window.
pub(crate) fn height_span(map: &HeightMap, w: Window) -> Option<(f64, f64)> {
    let (mut lo, mut hi) = (f32::INFINITY, f32::NEG_INFINITY);
    for y in 0..w.height {
        for h in &map.height_m.row(w.y as usize + y)[w.x as usize..][..w.width] {
            lo = lo.min(*h);
            hi = hi.max(*h);
        }
    }
    (lo <= hi).then(|| (map.origin_m + f64::from(lo), map.origin_m + f64::from(hi)))
}
