//! Cross-view consistency: how many other views have heights that agree with a pixel's height.
//!
//! A reference pixel at its height is projected to the ground and into each source. The source's
//! own height there must be the same within a tolerance. The tolerance is the height difference
//! that changes the parallax between the two views by a given number of pixels. (SkySplat's
//! |Δh|/|h| < 0.2 fails near and below height 0; SatMVS uses < 1 px and < 2.5 m.)

use multiversion::multiversion;
use raster::{Grid, Window};
use rayon::prelude::*;

use crate::error::SweepError;
use crate::geometry::{LocalMap, PixelBox, source_column_row};
use crate::height_map::{HeightMap, height_span};
use crate::tiles::{paste, tiles};
use crate::view::SweepView;

/// Parameters of the consistency check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConsistencyConfig {
    /// Largest disagreement, pixels of parallax between the two views.
    pub tolerance_px: f64,
    /// Side of the tiles in which a local map replaces the exact chain, pixels.
    pub tile: usize,
    /// Largest error of the local map, pixels.
    pub map_tolerance_px: f64,
}

impl Default for ConsistencyConfig {
    /// Returns a tolerance of one pixel, the left–right threshold of CARS and S2P.
    fn default() -> Self {
        Self { tolerance_px: 1.0, tile: 64, map_tolerance_px: 0.1 }
    }
}

/// A view and its heights on one level.
#[derive(Debug, Clone, Copy)]
pub struct Heights<'a> {
    /// Index among the views.
    pub index: usize,
    /// The view.
    pub view: &'a SweepView,
    /// Heights on the level.
    pub map: &'a HeightMap,
}

/// Numbers of sources by pixel of a reference. Pixels without a height have none.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceCounts {
    /// Sources whose height is that of the reference.
    pub agreeing: Grid<u8>,
    /// Sources whose images show the place, whether or not they have a height there.
    pub showing: Grid<u8>,
}

impl SourceCounts {
    fn none((width, height): (usize, usize)) -> Self {
        Self { agreeing: Grid::filled(width, height, 0), showing: Grid::filled(width, height, 0) }
    }
}

/// Counts the sources that agree with the height of each pixel of the reference, and those that
/// show its place.
///
/// # Errors
/// Returns [`SweepError::Camera`] if a camera fails inside the scene.
pub fn count_agreeing(
    reference: Heights<'_>,
    sources: &[Heights<'_>],
    level: u32,
    config: &ConsistencyConfig,
) -> Result<SourceCounts, SweepError> {
    let map = reference.map;
    let (width, height) = (map.height_m.width(), map.height_m.height());
    let windows = tiles(Window::whole(width, height), config.tile);
    let parts: Vec<SourceCounts> = windows
        .par_iter()
        .map(|w| {
            let mut counts = SourceCounts::none((w.width, w.height));
            for s in sources {
                count_in_tile(reference, *s, level, *w, config, &mut counts)?;
            }
            Ok(counts)
        })
        .collect::<Result<_, SweepError>>()?;
    let mut out = SourceCounts::none((width, height));
    for (w, part) in windows.iter().zip(&parts) {
        paste(&mut out.agreeing, *w, &part.agreeing);
        paste(&mut out.showing, *w, &part.showing);
    }
    Ok(out)
}

fn count_in_tile(
    reference: Heights<'_>,
    source: Heights<'_>,
    level: u32,
    w: Window,
    config: &ConsistencyConfig,
    counts: &mut SourceCounts,
) -> Result<(), SweepError> {
    let Some(range) = height_span(reference.map, w) else { return Ok(()) };
    let exact = |p, h| source_column_row(&reference.view.camera, &source.view.camera, level, p, h);
    // A source whose camera fails over the tile does not see it and agrees with nothing.
    let Ok(map) = LocalMap::fit(PixelBox::of_window(w), range, exact) else { return Ok(()) };
    let fits = map.max_error_px <= config.map_tolerance_px;
    let parallax = parallax_per_metre(&map);
    let tolerance_m = (config.tolerance_px / parallax.max(f64::MIN_POSITIVE)) as f32;
    let apart_m = (reference.map.origin_m - source.map.origin_m) as f32;
    let mut pixels = Pixels { right: vec![0; w.width], below: vec![0; w.width] };
    for y in 0..w.height {
        let gy = w.y as usize + y;
        let own = &reference.map.height_m.row(gy)[w.x as usize..][..w.width];
        if fits {
            pixels.follow(&map, [w.x as f64, gy as f64], own, reference.map.origin_m);
        } else {
            let failed = |e| SweepError::Camera { view: source.index, source: e };
            for (x, h) in own.iter().enumerate().filter(|(_, h)| !h.is_nan()) {
                let p = [(w.x as usize + x) as f64, gy as f64];
                pixels.put(x, exact(p, reference.map.origin_m + f64::from(*h)).map_err(failed)?);
            }
        }
        let at = pixels.right.iter().zip(&pixels.below);
        let counts = counts.agreeing.row_mut(y).iter_mut().zip(counts.showing.row_mut(y));
        for (((agreeing, showing), at), own) in counts.zip(at).zip(own).filter(|(_, own)| !own.is_nan()) {
            let (shows, agrees) = compare(&source.map.height_m, at, own + apart_m, tolerance_m);
            *showing = showing.saturating_add(u8::from(shows));
            *agreeing = agreeing.saturating_add(u8::from(agrees));
        }
    }
    Ok(())
}

/// Source positions of the pixels of a row, each as the pixel to its lower right.
struct Pixels {
    /// Column right of the position.
    right: Vec<i32>,
    /// Row below the position.
    below: Vec<i32>,
}

impl Pixels {
    /// Maps the row that begins at `first`, at its heights above the origin.
    fn follow(&mut self, map: &LocalMap, first: [f64; 2], height_m: &[f32], origin_m: f64) {
        follow_row(map, first, height_m, origin_m, &mut self.right, &mut self.below);
    }

    fn put(&mut self, x: usize, q: [f64; 2]) {
        (self.right[x], self.below[x]) = behind(q);
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn follow_row(map: &LocalMap, first: [f64; 2], height_m: &[f32], origin_m: f64, right: &mut [i32], below: &mut [i32]) {
    for (x, ((right, below), h)) in right.iter_mut().zip(below).zip(height_m).enumerate() {
        let q = map.at([first[0] + x as f64, first[1]], origin_m + f64::from(*h));
        (*right, *below) = behind(q);
    }
}

/// Returns the column right of a position and the row below it.
#[inline(always)]
fn behind(q: [f64; 2]) -> (i32, i32) {
    ((q[0] + 1.0).floor() as i32, (q[1] + 1.0).floor() as i32)
}

/// Returns the parallax, source pixels per metre of height.
fn parallax_per_metre(map: &LocalMap) -> f64 {
    let h = map.mid_height_m();
    let (a, b) = (map.at([0.0, 0.0], h - 0.5), map.at([0.0, 0.0], h + 0.5));
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// Returns whether a position lies in the map, and whether one of the four pixels around it has a
/// height within the tolerance of `wanted`. `right` and `below` name the last of them.
#[inline(always)]
fn compare(map: &Grid<f32>, (right, below): (&i32, &i32), wanted: f32, tolerance_m: f32) -> (bool, bool) {
    // A negative index becomes a huge one.
    let (right, below) = (*right as u32 as usize, *below as u32 as usize);
    if right > map.width() || below > map.height() {
        return (false, false);
    }
    let columns = right.saturating_sub(1)..(right + 1).min(map.width());
    let rows = below.saturating_sub(1)..(below + 1).min(map.height());
    let near = |h: f32| (h - wanted).abs() <= tolerance_m;
    if let (&[a, b], 2) = (&map.row(rows.start)[columns.clone()], rows.len()) {
        let [c, d] = [columns.start, columns.end - 1].map(|x| map.row(rows.end - 1)[x]);
        return (true, near(a) | near(b) | near(c) | near(d));
    }
    (true, rows.into_iter().any(|y| map.row(y)[columns.clone()].iter().any(|h| near(*h))))
}
