//! Tie points of two views: corners of one are searched for along their height trajectory in the
//! other.
//!
//! On a coarse pyramid level every height of the range is tried, in a band across the trajectory
//! that allows for the pointing error. A match must be better than every other place by a margin.
//! It is then followed down the pyramid to a fraction of a pixel, and kept if the search back from
//! the source returns to the corner.

use std::borrow::Cow;

use camera::{CameraError, ImagePoint, RpcCamera};
use raster::{Grid, Window, bicubic_along, level_from_level0, level0_from_level};
use rayon::prelude::*;

use super::coarse::Coarse;
use super::interest::corners;
use super::moments::remove_mean;
use super::pair::{Pair, Tie, TieConfig};
use super::patch::{NO_PIXELS, Patch, padded, parabola_peak};
use crate::geometry::source_column_row;
use crate::view::SweepView;

/// An image this many times smaller than the other one is searched from.
const SMALLER: usize = 2;
/// Distance within which a match is refined on each level, pixels of the level.
const REACH: i32 = 2;
/// Largest distance of the search back from the corner, pixels.
const RETURN_PX: f64 = 1.0;

/// Finds the tie points of a pair at heights in `range_m`, metres above the ellipsoid.
///
/// Points are spread over what both views see. Views of different sampling distances are matched at
/// the coarser one.
pub fn match_pair(reference: &SweepView, source: &SweepView, range_m: (f64, f64), config: &TieConfig) -> Vec<Tie> {
    let scaled = ScaledPair::of(&Pair { reference, source }, range_m);
    let pair = scaled.pair();
    let swapped = || {
        let found = match_scaled(&Pair { reference: pair.source, source: pair.reference }, range_m, config)?;
        let back = |tie: Tie| Tie { reference: tie.source, source: tie.reference, ..tie };
        Some(found.into_iter().map(back).collect::<Vec<Tie>>())
    };
    // The smaller of two images sees less ground that the other one does not see. And a camera may
    // fail far from the scene, where the other one does not.
    let area = |view: &SweepView| view.levels[0].width() * view.levels[0].height();
    let found = if SMALLER * area(pair.source) < area(pair.reference) {
        swapped().or_else(|| match_scaled(&pair, range_m, config))
    } else {
        match_scaled(&pair, range_m, config).or_else(swapped)
    };
    let found = found.unwrap_or_default();
    let full = |p: ImagePoint, skipped: usize| {
        let [sample, line] = [p.sample, p.line].map(|v| level0_from_level(v, skipped as u32));
        ImagePoint::new(sample, line)
    };
    let (in_reference, in_source) = scaled.skipped;
    let in_full =
        |tie: Tie| Tie { reference: full(tie.reference, in_reference), source: full(tie.source, in_source), ..tie };
    found.into_iter().map(in_full).collect()
}

/// Two views without the finest levels of the sharper one, so that pixels of both are about the
/// same size on the ground.
pub(super) struct ScaledPair<'a> {
    reference: Cow<'a, SweepView>,
    source: Cow<'a, SweepView>,
    /// Levels left out of the reference and of the source.
    pub(super) skipped: (usize, usize),
}

impl<'a> ScaledPair<'a> {
    pub(super) fn of(pair: &Pair<'a>, range_m: (f64, f64)) -> Self {
        let skipped = skipped_levels(pair, range_m);
        let (reference, source) = (scaled(pair.reference, skipped.0), scaled(pair.source, skipped.1));
        if skipped == (0, 0) {
            return Self { reference, source, skipped };
        }
        let noise = (shared_noise(&reference, &source), shared_noise(&source, &reference));
        let with = |view: Cow<'a, SweepView>, noise: f32| Cow::Owned(SweepView { noise, ..view.into_owned() });
        Self { reference: with(reference, noise.0), source: with(source, noise.1), skipped }
    }

    pub(super) fn pair(&self) -> Pair<'_> {
        Pair { reference: &self.reference, source: &self.source }
    }
}

/// Returns the noise of a view beside another one of the same ground and sampling distance.
///
/// The detail of a coarse sensor looks like noise to an estimate from one image. A sharper image
/// that was reduced shows how much of the texture is detail.
fn shared_noise(view: &SweepView, other: &SweepView) -> f32 {
    let contrast = |view: &SweepView| view.contrast.first().copied().filter(|c| *c > 0.0);
    let expected = contrast(view).zip(contrast(other)).map(|(own, theirs)| other.noise * own / theirs);
    expected.map_or(view.noise, |expected| view.noise.min(expected))
}

/// Finds the tie points of a pair of about the same sampling distance; `None` where the views do
/// not meet or a camera fails in the range.
fn match_scaled(pair: &Pair<'_>, range_m: (f64, f64), config: &TieConfig) -> Option<Vec<Tie>> {
    let shared = shared_window(pair, range_m, config.band_px)?;
    let side = shared.width.min(shared.height).min(shorter_side(&pair.source.levels[0]));
    let enough = |(level, image): &(usize, &Grid<f32>)| (side >> level).min(shorter_side(image)) >= config.coarse_side;
    let top = pair.reference.levels.iter().enumerate().take_while(enough).count().saturating_sub(1);
    let top = top.min(pair.source.levels.len() - 1);
    let part = on_level(shared, top, &pair.reference.levels[top]);
    let cell = ((part.width * part.height) as f64 / config.points as f64).sqrt().ceil().max(4.0) as usize;
    let noise = pair.reference.noise_at(top);
    let points = corners(&pair.reference.levels[top], part, cell, config.radius as usize + 2, noise);
    let coarse = Coarse::prepare(pair, top, range_m, config)?;
    Some(points.par_iter().filter_map(|&p| pair.follow(p, top, &coarse, config)).collect())
}

fn shorter_side(image: &Grid<f32>) -> usize {
    image.width().min(image.height())
}

/// Returns how many levels of the reference and of the source to leave out, so that pixels of both
/// are about the same size on the ground.
fn skipped_levels(pair: &Pair<'_>, range_m: (f64, f64)) -> (usize, usize) {
    let image = &pair.reference.levels[0];
    let middle = [0.5 * image.width() as f64, 0.5 * image.height() as f64];
    let height_m = 0.5 * (range_m.0 + range_m.1);
    let Ok(frame) = LocalFrame::at(&pair.reference.camera, &pair.source.camera, 0, middle, height_m) else {
        return (0, 0);
    };
    // Source pixels per reference pixel, as a side.
    let levels = frame.area().abs().sqrt().log2();
    if !levels.is_finite() {
        return (0, 0);
    }
    let skipped = |levels: f64, view: &SweepView| (levels.round().max(0.0) as usize).min(view.levels.len() - 1);
    (skipped(-levels, pair.reference), skipped(levels, pair.source))
}

/// Returns a view without its finest levels; its camera is that of the finest level left.
fn scaled(view: &SweepView, skipped: usize) -> Cow<'_, SweepView> {
    if skipped == 0 {
        return Cow::Borrowed(view);
    }
    Cow::Owned(SweepView {
        camera: view.camera.rescaled(1.0 / f64::from(1u32 << skipped)),
        levels: view.levels[skipped..].to_vec(),
        noise: view.noise_at(skipped),
        contrast: view.contrast[skipped..].to_vec(),
        first: view.first.map(|at| at >> skipped),
    })
}

/// Returns the window of the reference at full resolution that the source may see at some height,
/// grown by the pointing error; `None` when it sees none of it.
pub(super) fn shared_window(pair: &Pair<'_>, range_m: (f64, f64), band_px: f64) -> Option<Window> {
    /// Fields of the lattice of places that are tried, on a side.
    const FIELDS: usize = 24;
    /// Pieces of a height trajectory that count as straight.
    const PIECES: usize = 4;
    let image = &pair.reference.levels[0];
    let source = &pair.source.levels[0];
    let limits = [source.width() as f64 + band_px, source.height() as f64 + band_px];
    let height_m = |i: usize| range_m.0 + (range_m.1 - range_m.0) * i as f64 / PIECES as f64;
    let sees = |at: [f64; 2]| {
        let places: Vec<[f64; 2]> = (0..=PIECES).filter_map(|i| pair.chain(at, 0, height_m(i)).ok()).collect();
        places.iter().zip(places.iter().skip(1).chain(places.last())).any(|(a, b)| crosses(*a, *b, -band_px, limits))
    };
    let place = |i: usize, size: usize| i as f64 * (size.max(1) - 1) as f64 / FIELDS as f64;
    let mut span: Option<[usize; 4]> = None;
    for j in 0..=FIELDS {
        for i in 0..=FIELDS {
            if sees([place(i, image.width()), place(j, image.height())]) {
                let [x0, x1, y0, y1] = span.unwrap_or([i, i, j, j]);
                span = Some([x0.min(i), x1.max(i), y0.min(j), y1.max(j)]);
            }
        }
    }
    // What is seen begins at most a field beyond the places that are.
    let ends = |from: usize, to: usize, size: usize| {
        let (from, to) = (place(from.saturating_sub(1), size).floor(), place((to + 1).min(FIELDS), size).ceil());
        (from as usize, to as usize + 1 - from as usize)
    };
    let [x0, x1, y0, y1] = span?;
    let ((x, width), (y, height)) = (ends(x0, x1, image.width()), ends(y0, y1, image.height()));
    Some(Window { x: x as i64, y: y as i64, width, height })
}

/// Returns whether a straight piece enters the rectangle from `low` on both axes to `high`.
fn crosses(from: [f64; 2], to: [f64; 2], low: f64, high: [f64; 2]) -> bool {
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let step = to[axis] - from[axis];
        if step == 0.0 {
            if !(low..=high[axis]).contains(&from[axis]) {
                return false;
            }
            continue;
        }
        let (a, b) = ((low - from[axis]) / step, (high[axis] - from[axis]) / step);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave
}

/// Returns a window of the full resolution on a level, inside the image of the level.
fn on_level(window: Window, level: usize, image: &Grid<f32>) -> Window {
    let ends = |from: i64, length: usize, size: usize| {
        let (low, high) = (from as usize >> level, (from as usize + length).div_ceil(1 << level).min(size));
        (low as i64, high.saturating_sub(low))
    };
    let (x, width) = ends(window.x, window.width, image.width());
    let (y, height) = ends(window.y, window.height, image.height());
    Window { x, y, width, height }
}

impl Pair<'_> {
    /// Follows a corner from the coarse level down to full resolution and back.
    fn follow(&self, p: [usize; 2], top: usize, coarse: &Coarse, config: &TieConfig) -> Option<Tie> {
        let at = [p[0] as f64, p[1] as f64];
        let own = Patch::around(&self.reference.levels[top], at, config.radius, self.reference.noise_at(top))?;
        let (height_m, place) = coarse.search(p, &own, config)?;
        let predicted = self.chain(at, top, height_m).ok()?;
        let top_scale = f64::from(1u32 << top);
        let mut offset = [(place[0] - predicted[0]) * top_scale, (place[1] - predicted[1]) * top_scale];
        let full = [level0_from_level(at[0], top as u32), level0_from_level(at[1], top as u32)];
        let mut correlation = 0.0;
        for level in (0..=top).rev() {
            let scale = f64::from(1u32 << level);
            let at = [level_from_level0(full[0], level as u32), level_from_level0(full[1], level as u32)];
            let start = [offset[0] / scale, offset[1] / scale];
            let (refined, c) = self.refine(at, level, height_m, (start, REACH), config)?;
            offset = [refined[0] * scale, refined[1] * scale];
            correlation = c;
        }
        if correlation < config.correlation {
            return None;
        }
        let predicted = self.chain(full, 0, height_m).ok()?;
        let found = [predicted[0] + offset[0], predicted[1] + offset[1]];
        let back = Pair { reference: self.source, source: self.reference };
        let back_predicted = back.chain(found, 0, height_m).ok()?;
        let start = [full[0] - back_predicted[0], full[1] - back_predicted[1]];
        let (end, _) = back.refine(found, 0, height_m, (start, REACH), config)?;
        ((end[0] - start[0]).hypot(end[1] - start[1]) < RETURN_PX).then_some(Tie {
            reference: ImagePoint::new(full[0], full[1]),
            source: ImagePoint::new(found[0], found[1]),
            correlation,
        })
    }

    /// Finds the offset of best correlation within `reach` pixels of `start`, to a fraction of a
    /// pixel, and the correlation.
    ///
    /// `at` is a position on the level in the reference; offsets are source pixels from its
    /// projection at `height_m`. The source is resampled once in the frame of the reference, so
    /// that every place tried is a part of what was resampled.
    pub(super) fn refine(
        &self,
        at: [f64; 2],
        level: usize,
        height_m: f64,
        (start, reach_px): ([f64; 2], i32),
        config: &TieConfig,
    ) -> Option<([f64; 2], f32)> {
        let places = 2 * reach_px as usize + 1;
        let own = Patch::around(&self.reference.levels[level], at, config.radius, self.reference.noise_at(level))?;
        let frame = LocalFrame::at(&self.reference.camera, &self.source.camera, level, at, height_m).ok()?;
        let centre = self.chain(at, level, height_m).ok()?;
        let from = [centre[0] + start[0], centre[1] + start[1]];
        let reach = config.radius + reach_px;
        let (side, whole) = (2 * config.radius as usize + 1, 2 * reach as usize + 1);
        let mut resampled = Grid::filled(whole + padded(side) - side, whole, f32::NAN);
        for j in 0..resampled.height() {
            let line = frame.place(from, -reach, j as i32 - reach);
            bicubic_along(&self.source.levels[level], line, frame.column_step(), &mut resampled.row_mut(j)[..whole]);
        }
        remove_mean(resampled.data_mut());
        let scores = own.correlations(resampled, self.source.noise_at(level));
        let mut best = (NO_PIXELS, 0usize, 0usize);
        for (j, i) in (0..places).flat_map(|j| (0..places).map(move |i| (j, i))) {
            if scores[(i, j)] > best.0 {
                best = (scores[(i, j)], i, j);
            }
        }
        let (score, i, j) = best;
        // A best place at the rim is a slope and not a peak.
        if !(1..places - 1).contains(&i) || !(1..places - 1).contains(&j) {
            return None;
        }
        let dx = parabola_peak(scores[(i - 1, j)], score, scores[(i + 1, j)]);
        let dy = parabola_peak(scores[(i, j - 1)], score, scores[(i, j + 1)]);
        let steps = |i: usize, d: f64| f64::from(i as i32 - reach_px) + d;
        Some((frame.moved(start, steps(i, dx), steps(j, dy)), score))
    }
}

/// Linear map from reference to source pixels around a point.
struct LocalFrame([[f64; 2]; 2]);

impl LocalFrame {
    fn at(
        reference: &RpcCamera,
        source: &RpcCamera,
        level: usize,
        [u, v]: [f64; 2],
        height_m: f64,
    ) -> Result<Self, CameraError> {
        let chain = |p| source_column_row(reference, source, level as u32, p, height_m);
        // Eight pixels are wide enough for exact differences and narrow enough to be local.
        let d = 8.0;
        let (l, r, t, b) = (chain([u - d, v])?, chain([u + d, v])?, chain([u, v - d])?, chain([u, v + d])?);
        let row = |i: usize| [(r[i] - l[i]) / (2.0 * d), (b[i] - t[i]) / (2.0 * d)];
        Ok(Self([row(0), row(1)]))
    }

    /// Returns a source position moved by whole reference columns and rows.
    fn place(&self, centre: [f64; 2], i: i32, j: i32) -> [f64; 2] {
        self.moved(centre, f64::from(i), f64::from(j))
    }

    /// Returns the number of source pixels in a reference pixel.
    fn area(&self) -> f64 {
        let [[a, b], [c, d]] = self.0;
        a * d - b * c
    }

    /// Returns the step in the source from one reference column to the next.
    fn column_step(&self) -> [f64; 2] {
        [self.0[0][0], self.0[1][0]]
    }

    /// Returns a source position moved by reference columns `i` and rows `j`.
    fn moved(&self, centre: [f64; 2], i: f64, j: f64) -> [f64; 2] {
        let [[a, b], [c, d]] = self.0;
        [centre[0] + a * i + b * j, centre[1] + c * i + d * j]
    }
}
