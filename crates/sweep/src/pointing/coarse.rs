//! The search for a patch along its whole height trajectory on a coarse pyramid level.
//!
//! The source is laid over the reference once, so that every height is a shift, and the moments of all its patches are
//! known before the first is compared.

use raster::{Grid, bicubic_along};

use super::moments::{patch_moments, remove_mean};
use super::patch::Patch;
use super::ties::{Pair, TieConfig};
use crate::geometry::TileMap;
use crate::view::QUANTISATION_VARIANCE;

/// A source laid over the reference, ready to be searched.
pub(crate) struct Coarse {
    map: TileMap,
    range_m: (f64, f64),
    /// Reference position of the laid picture's first pixel.
    origin: [i64; 2],
    picture: Grid<f32>,
    /// `1 / deviation` of the patch centred `radius` pixels further on; NaN where invalid or flat.
    inverse_deviation: Grid<f32>,
    /// Steps of about a pixel along the trajectory.
    steps: usize,
    /// Unit vector across the trajectory, reference pixels, and how many pixels to search on each side.
    across: [f64; 2],
    band: i32,
}

/// A place tried: its correlation, height, and position in the laid picture's frame.
struct Candidate {
    correlation: f32,
    height_m: f64,
    place: [i64; 2],
}

impl Coarse {
    pub(crate) fn prepare(pair: &Pair<'_>, level: usize, range_m: (f64, f64), config: &TieConfig) -> Option<Self> {
        let reference = &pair.reference.levels[level];
        let source = &pair.source.levels[level];
        let corners = [0.0, 0.0, reference.width() as f64 - 1.0, reference.height() as f64 - 1.0];
        let map = TileMap::fit(corners, range_m, |p, h| pair.chain(p, level, h)).ok()?;
        let (from, to) = (map.shift_at(range_m.0)?, map.shift_at(range_m.1)?);
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0].hypot(along[1]);
        let across = if length > 0.0 { [-along[1] / length, along[0] / length] } else { [0.0, 1.0] };
        let (origin, mut picture) = lay_over(source, &map)?;
        remove_mean(picture.data_mut());
        let inverse_deviation = deviations(&picture, config.radius as usize, pair.source.noise_at(level));
        let band = (config.band_px / f64::from(1u32 << level)).ceil() as i32;
        Some(Self { map, range_m, origin, picture, inverse_deviation, steps: length.ceil() as usize, across, band })
    }

    /// The height and source position of the best match, if it stands out from every other place.
    pub(crate) fn search(&self, p: [usize; 2], own: &Patch, config: &TieConfig) -> Option<(f64, [f64; 2])> {
        let mut found = Vec::new();
        for i in 0..=self.steps {
            let height_m = self.range_m.0 + (self.range_m.1 - self.range_m.0) * i as f64 / self.steps.max(1) as f64;
            let Some(shift) = self.map.shift_at(height_m) else { continue };
            for b in -self.band..=self.band {
                let at = |axis: usize| p[axis] as f64 + shift[axis] + self.across[axis] * f64::from(b);
                let place = [at(0).round() as i64, at(1).round() as i64];
                if let Some(correlation) = self.correlation(own, place, config.radius) {
                    found.push(Candidate { correlation, height_m, place });
                }
            }
        }
        let best = found.iter().max_by(|a, b| a.correlation.total_cmp(&b.correlation))?;
        // Places within two pixels are the same peak.
        let apart = |c: &&Candidate| (c.place[0] - best.place[0]).abs().max((c.place[1] - best.place[1]).abs()) > 2;
        let rival = found.iter().filter(apart).map(|c| c.correlation).fold(-1.0f32, f32::max);
        let stands_out = best.correlation >= config.correlation && best.correlation - rival >= config.margin;
        let place = [best.place[0] as f64, best.place[1] as f64];
        stands_out.then(|| (best.height_m, self.map.at(place, self.map.mid_height_m())))
    }

    /// Correlation of a patch with the laid picture around a place; `None` outside or on invalid pixels.
    fn correlation(&self, own: &Patch, place: [i64; 2], radius: i32) -> Option<f32> {
        let side = 2 * radius as usize + 1;
        let x = usize::try_from(place[0] - self.origin[0] - i64::from(radius)).ok()?;
        let y = usize::try_from(place[1] - self.origin[1] - i64::from(radius)).ok()?;
        let inverse = *self.inverse_deviation.get(x, y)?;
        if inverse.is_nan() {
            return None;
        }
        // Four sums side by side are one vector.
        let (mut sums, mut rest) = ([0.0f32; 4], 0.0f32);
        for (j, row) in own.values().chunks_exact(side).enumerate() {
            let (own, own_rest) = row.as_chunks::<4>();
            let (other, other_rest) = self.picture.row(y + j)[x..x + side].as_chunks::<4>();
            for (a, b) in own.iter().zip(other) {
                sums.iter_mut().zip(a.iter().zip(b)).for_each(|(s, (a, b))| *s += a * b);
            }
            rest += own_rest.iter().zip(other_rest).map(|(a, b)| a * b).sum::<f32>();
        }
        Some((sums.iter().sum::<f32>() + rest) * inverse / side as f32)
    }
}

/// The source resampled to the reference's frame at the map's middle height, with the place of its first pixel.
fn lay_over(source: &Grid<f32>, map: &TileMap) -> Option<([i64; 2], Grid<f32>)> {
    let (w, h) = (source.width() as f64 - 1.0, source.height() as f64 - 1.0);
    let mut span = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for corner in [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]] {
        let p = map.reference_from_source(corner)?;
        for (s, v) in span.iter_mut().zip(p) {
            *s = [s[0].min(v), s[1].max(v)];
        }
    }
    let origin = [span[0][0].floor() as i64, span[1][0].floor() as i64];
    // A map that blows the picture up is not one between two views of the same ground.
    let area = (span[0][1] - span[0][0] + 2.0) * (span[1][1] - span[1][0] + 2.0);
    if !area.is_finite() || area > 16.0 * (w + 1.0) * (h + 1.0) {
        return None;
    }
    let extent = |i: usize| (span[i][1].ceil() as i64 - origin[i] + 1) as usize;
    let mut out = Grid::filled(extent(0), extent(1), f32::NAN);
    for y in 0..out.height() {
        let at = |x: i64| map.at([x as f64, (origin[1] + y as i64) as f64], map.mid_height_m());
        let (from, next) = (at(origin[0]), at(origin[0] + 1));
        bicubic_along(source, from, [next[0] - from[0], next[1] - from[1]], out.row_mut(y));
    }
    Some((origin, out))
}

/// `1 / deviation` of every whole patch of the picture; NaN where it is invalid or no stronger than the noise.
fn deviations(picture: &Grid<f32>, radius: usize, noise: f32) -> Grid<f32> {
    let side = 2 * radius + 1;
    if picture.width() < side || picture.height() < side {
        return Grid::filled(0, 0, f32::NAN);
    }
    let (w, h) = (picture.width() + 1 - side, picture.height() + 1 - side);
    let mut mean = vec![0.0; w * h];
    let mut out = Grid::filled(w, h, f32::NAN);
    let mut line = vec![0.0; 2 * picture.width()];
    patch_moments(picture.data(), picture.width(), side, QUANTISATION_VARIANCE, &mut line, &mut mean, out.data_mut());
    out.data_mut().iter_mut().filter(|v| **v * noise >= 1.0).for_each(|v| *v = f32::NAN);
    out
}
