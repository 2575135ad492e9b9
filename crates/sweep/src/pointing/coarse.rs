//! The search for a patch along its whole height trajectory on a coarse pyramid level.
//!
//! The source is laid over the reference once, so that every height is a shift, and the moments of all its patches are
//! known before the first is compared.

use raster::{Grid, bicubic_along};

use super::moments::{patch_moments, remove_mean};
use super::pair::{Pair, TieConfig};
use super::patch::{Patch, padded};
use crate::geometry::LocalMap;
use crate::view::QUANTISATION_VARIANCE;

/// A source laid over the reference, ready to be searched.
pub(crate) struct Coarse {
    map: LocalMap,
    /// Reference position of the laid picture's first pixel.
    origin: [i64; 2],
    /// As many columns of zeros behind it as a patch reads; 0 where invalid.
    picture: Grid<f32>,
    /// `1 / deviation` of the patch centred `radius` pixels further on; NaN where invalid or flat.
    inverse_deviation: Grid<f32>,
    /// Heights about a pixel apart, with where a patch may lie from its own place: along the trajectory, and to its sides.
    places: Vec<(f64, Vec<[i64; 2]>)>,
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
        let map = LocalMap::fit(corners, range_m, |p, h| pair.chain(p, level, h)).ok()?;
        let band = (config.band_px / f64::from(1u32 << level)).ceil() as i32;
        let places = places(&map, range_m, band)?;
        let side = 2 * config.radius as usize + 1;
        let (origin, mut picture) = lay_over(source, &map, padded(side) - side)?;
        remove_mean(picture.data_mut());
        let inverse_deviation = deviations(&picture, side, pair.source.noise_at(level));
        picture.data_mut().iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = 0.0);
        Some(Self { map, origin, picture, inverse_deviation, places })
    }

    /// The height and source position of the best match, if it stands out from every other place.
    pub(crate) fn search(&self, p: [usize; 2], own: &Patch, config: &TieConfig) -> Option<(f64, [f64; 2])> {
        let mut found = Vec::with_capacity(self.places.iter().map(|(_, places)| places.len()).sum());
        for (height_m, places) in &self.places {
            for offset in places {
                let place = [p[0] as i64 + offset[0], p[1] as i64 + offset[1]];
                if let Some(correlation) = self.correlation(own, place, config.radius) {
                    found.push(Candidate { correlation, height_m: *height_m, place });
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
        let x = usize::try_from(place[0] - self.origin[0] - i64::from(radius)).ok()?;
        let y = usize::try_from(place[1] - self.origin[1] - i64::from(radius)).ok()?;
        let inverse = *self.inverse_deviation.get(x, y)?;
        (!inverse.is_nan()).then(|| own.product_at(&self.picture, (x, y)) * inverse / (2 * radius + 1) as f32)
    }
}

/// Where the height trajectory leads, in steps of about a pixel: whole pixels from a patch's own place, up to `band` to its sides.
fn places(map: &LocalMap, range_m: (f64, f64), band: i32) -> Option<Vec<(f64, Vec<[i64; 2]>)>> {
    let (from, to) = (map.shift_at(range_m.0)?, map.shift_at(range_m.1)?);
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]);
    let across = if length > 0.0 { [-along[1] / length, along[0] / length] } else { [0.0, 1.0] };
    let steps = length.ceil() as usize;
    let height_m = |i: usize| range_m.0 + (range_m.1 - range_m.0) * i as f64 / steps.max(1) as f64;
    let beside = |h: f64| {
        let shift = map.shift_at(h)?;
        let at = |b: i32| [0, 1].map(|axis| (shift[axis] + across[axis] * f64::from(b)).round() as i64);
        Some((h, (-band..=band).map(at).collect()))
    };
    Some((0..=steps).filter_map(|i| beside(height_m(i))).collect())
}

/// The source resampled to the reference's frame at the map's middle height and `more` void columns behind it, with the place of
/// its first pixel.
fn lay_over(source: &Grid<f32>, map: &LocalMap, more: usize) -> Option<([i64; 2], Grid<f32>)> {
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
    let columns = extent(0);
    let mut out = Grid::filled(columns + more, extent(1), f32::NAN);
    for y in 0..out.height() {
        let at = |x: i64| map.at([x as f64, (origin[1] + y as i64) as f64], map.mid_height_m());
        let (from, next) = (at(origin[0]), at(origin[0] + 1));
        bicubic_along(source, from, [next[0] - from[0], next[1] - from[1]], &mut out.row_mut(y)[..columns]);
    }
    Some((origin, out))
}

/// `1 / deviation` of every whole patch of the picture; NaN where it is invalid or no stronger than the noise.
fn deviations(picture: &Grid<f32>, side: usize, noise: f32) -> Grid<f32> {
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
