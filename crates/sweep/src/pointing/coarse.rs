//! The search for a patch along its height trajectory on a coarse pyramid level.
//!
//! The source is resampled over the reference once, so that every height is a shift. The moments of
//! all its patches are computed once too, before the first comparison.

use raster::{Grid, Window, bicubic_along};

use super::moments::{inverse_deviations, remove_mean};
use super::pair::{Pair, TieConfig};
use super::patch::{Patch, padded};
use crate::geometry::{LocalMap, PixelBox};
use crate::view::QUANTISATION_VARIANCE;

/// A source resampled over the reference, ready to be searched.
pub(crate) struct Coarse {
    /// Map from reference to source positions on the level.
    map: LocalMap,
    /// Reference column and row of the image's first pixel.
    origin: [i64; 2],
    /// The resampled source, 0 where invalid, with columns of zeros behind it that patches read.
    image: Grid<f32>,
    /// `1 / deviation` of the patch whose first pixel is here; NaN where invalid or flat.
    inverse_deviation: Grid<f32>,
    /// Heights about a pixel of parallax apart, each with the offsets at which a patch may lie: on
    /// the trajectory and to its sides.
    places: Vec<(f64, Vec<[i64; 2]>)>,
    /// Row offset of the topmost places, and for each row from there on the column offset of its
    /// first place and the number of columns up to its last one.
    rows: (i64, Vec<(i64, usize)>),
}

/// A place tried, in the frame of the reference.
struct Candidate {
    correlation: f32,
    height_m: f64,
    place: [i64; 2],
}

impl Coarse {
    /// Prepares the search on a level over a range of heights; `None` if the views do not meet.
    pub(crate) fn prepare(pair: &Pair<'_>, level: usize, range_m: (f64, f64), config: &TieConfig) -> Option<Self> {
        let reference = &pair.reference.levels[level];
        let source = &pair.source.levels[level];
        let area = PixelBox::of_window(Window::whole(reference.width(), reference.height()));
        let map = LocalMap::fit(area, range_m, |p, h| pair.chain(p, level, h)).ok()?;
        let band = (config.band_px / f64::from(1u32 << level)).ceil() as i32;
        let places = places(&map, range_m, band)?;
        let side = 2 * config.radius as usize + 1;
        let (origin, mut image) = warped(source, &map, padded(side) - side)?;
        remove_mean(image.data_mut());
        let inverse_deviation = inverse_deviations(&image, side, pair.source.noise_at(level), QUANTISATION_VARIANCE);
        image.data_mut().iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = 0.0);
        let rows = rows(&places);
        Some(Self { map, origin, image, inverse_deviation, places, rows })
    }

    /// Returns the height and source position of the best match of a patch around `p`, if it beats
    /// every other place by the margin.
    pub(crate) fn search(&self, p: [usize; 2], own: &Patch, config: &TieConfig) -> Option<(f64, [f64; 2])> {
        let correlations = self.correlations(p, own, config.radius);
        let mut found = Vec::with_capacity(self.places.iter().map(|(_, places)| places.len()).sum());
        for (height_m, places) in &self.places {
            for offset in places {
                let (first, row) = &correlations[(offset[1] - self.rows.0) as usize];
                let correlation = row[(offset[0] - first) as usize];
                if !correlation.is_nan() {
                    let place = [p[0] as i64 + offset[0], p[1] as i64 + offset[1]];
                    found.push(Candidate { correlation, height_m: *height_m, place });
                }
            }
        }
        let best = found.iter().max_by(|a, b| a.correlation.total_cmp(&b.correlation))?;
        // Places within two pixels belong to the same peak.
        let apart = |c: &&Candidate| (c.place[0] - best.place[0]).abs().max((c.place[1] - best.place[1]).abs()) > 2;
        let rival = found.iter().filter(apart).map(|c| c.correlation).fold(-1.0f32, f32::max);
        let stands_out = best.correlation >= config.correlation && best.correlation - rival >= config.margin;
        let place = [best.place[0] as f64, best.place[1] as f64];
        stands_out.then(|| (best.height_m, self.map.at(place, self.map.mid_height_m())))
    }

    /// Computes the correlations of a patch around `p` with the image: for each row of places the
    /// first column offset and the correlations from there on. NaN outside the image and on
    /// invalid pixels.
    fn correlations(&self, p: [usize; 2], own: &Patch, radius: i32) -> Vec<(i64, Vec<f32>)> {
        let side = 2 * radius as usize + 1;
        let columns = (self.image.width() + 1).saturating_sub(padded(side)) as i64;
        let corner = [0, 1].map(|axis| p[axis] as i64 - self.origin[axis] - i64::from(radius));
        let (top, rows) = &self.rows;
        let scores = |(row, &(first, count)): (i64, &(i64, usize))| {
            let mut scores = vec![f32::NAN; count];
            let from = corner[0] + first;
            let (low, high) = (from.max(0), (from + count as i64).min(columns));
            if low < high && (0..self.inverse_deviation.height() as i64).contains(&row) {
                let within = &mut scores[(low - from) as usize..(high - from) as usize];
                own.products(&self.image, (low as usize, row as usize), within);
                let inverse = &self.inverse_deviation.row(row as usize)[low as usize..];
                within.iter_mut().zip(inverse).for_each(|(score, inverse)| *score = *score * inverse / side as f32);
            }
            (first, scores)
        };
        (corner[1] + top..).zip(rows).map(scores).collect()
    }
}

/// Returns the first row offset of the places, and for each row from it to the last one the first
/// column offset and the number of columns up to the last one.
fn rows(places: &[(f64, Vec<[i64; 2]>)]) -> (i64, Vec<(i64, usize)>) {
    let all = || places.iter().flat_map(|(_, places)| places);
    let (top, bottom) = all().fold((i64::MAX, i64::MIN), |(a, b), [_, row]| (a.min(*row), b.max(*row)));
    let mut rows = vec![(0, 0); usize::try_from(bottom.saturating_sub(top)).map_or(0, |last| last + 1)];
    for &[column, row] in all() {
        let (first, count) = &mut rows[(row - top) as usize];
        let last = if *count == 0 { column } else { column.max(*first + *count as i64 - 1) };
        *first = if *count == 0 { column } else { column.min(*first) };
        *count = (last - *first) as usize + 1;
    }
    (top, rows)
}

/// Returns the offsets along the height trajectory, in steps of about a pixel, with up to `band`
/// pixels to either side.
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

/// Resamples the source to the frame of the reference at the map's middle height, with `more` void
/// columns behind it. Returns the reference position of the first pixel and the image.
fn warped(source: &Grid<f32>, map: &LocalMap, more: usize) -> Option<([i64; 2], Grid<f32>)> {
    let (w, h) = (source.width() as f64 - 1.0, source.height() as f64 - 1.0);
    let mut span = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for corner in [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]] {
        let p = map.reference_from_source(corner)?;
        for (s, v) in span.iter_mut().zip(p) {
            *s = [s[0].min(v), s[1].max(v)];
        }
    }
    let origin = [span[0][0].floor() as i64, span[1][0].floor() as i64];
    // A map that enlarges the image this much does not connect two views of the same ground.
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
