//! A source laid over a tile of the reference, and what its height planes cost.

use raster::{Window, bicubic_along, cubic_weights};

use super::census::{Census, Room as Apart, census_cost, overhang, picture_cost};
use super::kernels::{self, FULL};
use super::part::{CENSUS_REACH, Part};
use super::scale::census_scale;
use super::shift::{OVERHANG, Picture, shift_bicubic};
use super::voids::Voids;
use crate::geometry::LocalMap;
use crate::view::ViewLevel;

/// Pixels that the cubic interpolation takes in a row.
const CUBIC_TAPS: usize = 4;

/// A source laid over the tile, and the census of its shifted form for the current plane.
#[derive(Default)]
pub(super) struct Laid {
    map: Option<LocalMap>,
    picture: Vec<i16>,
    /// Where the census of a pixel that is moved here holds a void.
    voids: Voids,
    stride: usize,
    rows: usize,
    origin: [i64; 2],
    /// Where the part's first padded pixel lies for the current plane; `None` where the source is not seen.
    at: Option<(usize, usize)>,
    census: Census,
}

/// What a plane is computed with.
#[derive(Default)]
pub(super) struct Room {
    moved: Vec<i16>,
    rows: Vec<i16>,
    apart: Apart,
}

impl Laid {
    /// Resamples the source over the padded tile at the map's middle height, wide enough for all heights.
    pub(super) fn lay_over(
        &mut self,
        source: &ViewLevel<'_>,
        map: Option<LocalMap>,
        padded: Window,
        (h_lo, h_hi): (f64, f64),
        grey: &mut Vec<f32>,
    ) {
        self.map = map;
        let Some(map) = map else { return };
        let mut span = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for h in [h_lo, 0.5 * (h_lo + h_hi), h_hi] {
            if let Some(shift) = map.shift_at(h) {
                for (s, v) in span.iter_mut().zip(shift) {
                    *s = [s[0].min(v), s[1].max(v)];
                }
            }
        }
        if !span.iter().flatten().all(|v| v.is_finite()) {
            self.map = None;
            return;
        }
        // One pixel before and two after for the cubic, one more at each side for the curvature between the heights.
        let first = [span[0][0].floor() as i64 - 2, span[1][0].floor() as i64 - 2];
        let extent = |i: usize| (span[i][1].ceil() as i64 + 3 - first[i]) as usize;
        self.stride = padded.width + extent(0);
        self.rows = padded.height + extent(1);
        self.origin = first;
        grey.resize(self.stride * self.rows, 0.0);
        let x = (padded.x + first[0]) as f64;
        for (row, out) in grey.chunks_exact_mut(self.stride).enumerate() {
            let y = (padded.y + first[1] + row as i64) as f64;
            let (from, next) = (map.at([x, y], map.mid_height_m()), map.at([x + 1.0, y], map.mid_height_m()));
            bicubic_along(source.image, from, [next[0] - from[0], next[1] - from[1]], out);
        }
        let has_voids = kernels::quantise(grey, FULL * census_scale(source), OVERHANG, &mut self.picture);
        self.voids.mark(grey, self.stride, CUBIC_TAPS + 2 * CENSUS_REACH, has_voids);
    }

    /// Lays the part over the source at a height.
    pub(super) fn place(&mut self, height_m: f64, part: Part, room: &mut Room) {
        self.at = None;
        let Some([dx, dy]) = self.map.and_then(|m| m.shift_at(height_m)) else { return };
        let (fx, fy) = (dx.floor(), dy.floor());
        let x0 = fx as i64 - 1 - self.origin[0] + part.within[0];
        let y0 = fy as i64 - 1 - self.origin[1] + part.within[1];
        let is_inside = x0 >= 0
            && y0 >= 0
            && x0 as usize + part.width + 3 <= self.stride
            && y0 as usize + part.height + 3 <= self.rows;
        if !is_inside {
            return;
        }
        let at = (x0 as usize, y0 as usize);
        self.at = Some(at);
        let weights = (cubic_weights((dx - fx) as f32), cubic_weights((dy - fy) as f32));
        let weights = (weights.0.map(kernels::fixed), weights.1.map(kernels::fixed));
        let picture = Picture { data: &self.picture, stride: self.stride };
        room.moved.resize(part.area() + overhang(part.width), 0);
        shift_bicubic(picture, at, weights, (part.width, part.height), &mut room.rows, &mut room.moved);
    }

    /// Keeps the census of what was just placed.
    pub(super) fn grade(&mut self, part: Part, room: &Room) {
        if self.at.is_some() {
            self.census.fill(&room.moved, part.width, part.area());
        }
    }

    /// The costs of what was just placed against the reference, `worst` where this source has voids; tells whether it has any.
    pub(super) fn cost(&self, reference: &Census, part: Part, worst: u8, room: &mut Room, costs: &mut [u8]) -> bool {
        if self.at.is_some() {
            picture_cost(&room.moved, reference, part.width, &mut room.apart, costs);
        }
        self.hide(part, worst, costs)
    }

    /// The costs of the current plane between two sources that were graded, invalid where one of them is; tells whether there
    /// are such.
    pub(super) fn cost_between(&self, other: &Laid, part: Part, room: &mut Room, costs: &mut [u8]) -> bool {
        if self.at.is_some() && other.at.is_some() {
            census_cost(&other.census, &self.census, part.width, &mut room.apart, costs);
        }
        let is_hidden = self.hide(part, kernels::INVALID, costs);
        other.hide(part, kernels::INVALID, costs) || is_hidden
    }

    fn hide(&self, part: Part, worst: u8, costs: &mut [u8]) -> bool {
        let Some(at) = self.at else {
            costs.fill(worst);
            return true;
        };
        self.voids.hide(at, part, worst, costs)
    }
}
