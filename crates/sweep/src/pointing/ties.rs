//! Tie points of two views: corners of one are searched for along their height trajectory in the
//! other.
//!
//! On a coarse pyramid level every height of the range is tried, in a band across the trajectory
//! that allows for the pointing error. A match must be better than every other place by a margin.
//! It is then followed down the pyramid to a fraction of a pixel, and kept if the search back from
//! the source returns to the corner.

use camera::{CameraError, ImagePoint, RpcCamera};
use raster::{Grid, bicubic_along, level_from_level0, level0_from_level};
use rayon::prelude::*;

use super::coarse::Coarse;
use super::interest::corners;
use super::moments::remove_mean;
use super::pair::{Pair, Tie, TieConfig};
use super::patch::{Patch, padded, parabola_peak};
use crate::geometry::source_column_row;
use crate::view::SweepView;

/// Largest distance of the search back from the corner, pixels.
const RETURN_PX: f64 = 1.0;

/// Finds the tie points of a pair at heights in `range_m`, metres above the ellipsoid.
pub fn match_pair(reference: &SweepView, source: &SweepView, range_m: (f64, f64), config: &TieConfig) -> Vec<Tie> {
    let top = coarse_level(reference, config).min(source.levels.len() - 1);
    let image = &reference.levels[top];
    let cell = ((image.width() * image.height()) as f64 / config.points as f64).sqrt().ceil().max(4.0) as usize;
    let points = corners(image, cell, config.radius as usize + 2, reference.noise_at(top));
    let pair = Pair { reference, source };
    let Some(coarse) = Coarse::prepare(&pair, top, range_m, config) else { return Vec::new() };
    points.par_iter().filter_map(|&p| pair.follow(p, top, &coarse, config)).collect()
}

/// Returns the coarsest level that is large enough for the search.
fn coarse_level(view: &SweepView, config: &TieConfig) -> usize {
    let enough = |g: &&Grid<f32>| g.width().min(g.height()) >= config.coarse_side;
    view.levels.iter().take_while(enough).count().saturating_sub(1)
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
            let (refined, c) = self.refine(at, level, height_m, start, config)?;
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
        let (end, _) = back.refine(found, 0, height_m, start, config)?;
        ((end[0] - start[0]).hypot(end[1] - start[1]) < RETURN_PX).then_some(Tie {
            reference: ImagePoint::new(full[0], full[1]),
            source: ImagePoint::new(found[0], found[1]),
            correlation,
        })
    }

    /// Finds the offset of best correlation within two pixels of `start`, to a fraction of a pixel,
    /// and the correlation.
    ///
    /// `at` is a position on the level in the reference; offsets are source pixels from its
    /// projection at `height_m`. The source is resampled once in the frame of the reference, so
    /// that every place tried is a part of that picture.
    fn refine(
        &self,
        at: [f64; 2],
        level: usize,
        height_m: f64,
        start: [f64; 2],
        config: &TieConfig,
    ) -> Option<([f64; 2], f32)> {
        const REACH: i32 = 2;
        const SIDE: usize = 2 * REACH as usize + 1;
        let own = Patch::around(&self.reference.levels[level], at, config.radius, self.reference.noise_at(level))?;
        let frame = LocalFrame::at(&self.reference.camera, &self.source.camera, level, at, height_m).ok()?;
        let centre = self.chain(at, level, height_m).ok()?;
        let from = [centre[0] + start[0], centre[1] + start[1]];
        let reach = config.radius + REACH;
        let (side, whole) = (2 * config.radius as usize + 1, 2 * reach as usize + 1);
        let mut picture = Grid::filled(whole + padded(side) - side, whole, f32::NAN);
        for j in 0..picture.height() {
            let line = frame.place(from, -reach, j as i32 - reach);
            bicubic_along(&self.source.levels[level], line, frame.column_step(), &mut picture.row_mut(j)[..whole]);
        }
        remove_mean(picture.data_mut());
        let noise = self.source.noise_at(level);
        let mut scores = [[-1.0f32; SIDE]; SIDE];
        let mut best = (-1.0f32, 0usize, 0usize);
        for (j, row) in scores.iter_mut().enumerate() {
            for (i, score) in row.iter_mut().enumerate() {
                *score = own.correlation_at(&picture, (i, j), noise).unwrap_or(-1.0);
                if *score > best.0 {
                    best = (*score, i, j);
                }
            }
        }
        let (score, i, j) = best;
        // A best place at the rim is a slope and not a peak.
        if !(1..SIDE - 1).contains(&i) || !(1..SIDE - 1).contains(&j) {
            return None;
        }
        let dx = parabola_peak(scores[j][i - 1], score, scores[j][i + 1]);
        let dy = parabola_peak(scores[j - 1][i], score, scores[j + 1][i]);
        let steps = |i: usize, d: f64| f64::from(i as i32 - REACH) + d;
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
