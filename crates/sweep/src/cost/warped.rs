//! A source resampled over a tile of the reference, and the costs of its height planes.

use raster::{Window, bicubic_along, cubic_weights};

use super::census::{Census, CensusScratch, census_cost, image_cost, overhang};
use super::kernels::{self, FULL};
use super::part::{MARGIN, Part};
use super::scale::census_scale;
use super::shift::{BicubicShift, Image, OVERHANG, shift_bicubic};
use super::voids::Voids;
use crate::geometry::LocalMap;
use crate::view::ViewLevel;

/// Pixels per row that the cubic interpolation reads.
const CUBIC_TAPS: usize = 4;

/// A source resampled over the tile at the middle height, and its state for the current plane.
#[derive(Default)]
pub(super) struct WarpedSource {
    /// Local map from the tile to the source; `None` if the source does not see the tile.
    map: Option<LocalMap>,
    /// The resampled image.
    image: Vec<i16>,
    /// Places whose census, after a shift, would read a void.
    voids: Voids,
    /// Columns of the image.
    stride: usize,
    /// Rows of the image.
    rows: usize,
    /// Column and row of the image's first pixel, relative to the tile with its margin.
    origin: [i64; 2],
    /// Place in the image of the part's first pixel for the current plane; `None` if the source
    /// does not see the part there.
    at: Option<(usize, usize)>,
    /// Census of the shifted image for the current plane.
    census: Census,
}

/// Scratch buffers for one plane.
#[derive(Default)]
pub(super) struct PlaneScratch {
    /// The shifted image.
    shifted: Vec<i16>,
    /// Rows of the interpolation.
    rows: Vec<i16>,
    /// Buffers of the census.
    census: CensusScratch,
}

impl WarpedSource {
    /// Resamples the source over the padded tile at the map's middle height, wide enough for shifts
    /// to all heights in metres from `h_lo` to `h_hi`.
    pub(super) fn warp(
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
        // The interpolation reads one pixel before and two behind. One more at each side allows for
        // the curvature between the three heights.
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
        let has_voids = kernels::quantise(grey, FULL * census_scale(source), OVERHANG, &mut self.image);
        if has_voids && grey.iter().all(|value| value.is_nan()) {
            // The source shows another place: its costs are invalid without being computed.
            self.map = None;
            return;
        }
        self.voids.mark(grey, self.stride, CUBIC_TAPS + 2 * MARGIN, has_voids);
    }

    /// Shifts the image so that the part lies over it at a height.
    pub(super) fn place(&mut self, height_m: f64, part: Part, scratch: &mut PlaneScratch) {
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
        scratch.shifted.resize(part.area() + overhang(part.width), 0);
        shift_bicubic(BicubicShift {
            image: Image { data: &self.image, stride: self.stride },
            at,
            column_weights: cubic_weights((dx - fx) as f32).map(kernels::fixed),
            row_weights: cubic_weights((dy - fy) as f32).map(kernels::fixed),
            size: (part.width, part.height),
            rows: &mut scratch.rows,
            out: &mut scratch.shifted,
        });
    }

    /// Keeps the census of the image that was just shifted.
    pub(super) fn grade(&mut self, part: Part, scratch: &PlaneScratch) {
        if self.at.is_some() {
            self.census.fill(&scratch.shifted, part.width, part.area());
        }
    }

    /// Computes the costs of the shifted image against the reference. Where the source has a void
    /// they are raised to `worst`; returns whether it has one.
    pub(super) fn cost(
        &self,
        reference: &Census,
        part: Part,
        worst: u8,
        scratch: &mut PlaneScratch,
        costs: &mut [u8],
    ) -> bool {
        if self.at.is_some() {
            image_cost(&scratch.shifted, reference, part.width, &mut scratch.census, costs);
        }
        self.hide(part, worst, costs)
    }

    /// Computes the costs of the current plane between two sources that were graded. They are
    /// invalid where one of the two has a void; returns whether there is one.
    pub(super) fn cost_between(
        &self,
        other: &WarpedSource,
        part: Part,
        scratch: &mut PlaneScratch,
        costs: &mut [u8],
    ) -> bool {
        if self.at.is_some() && other.at.is_some() {
            census_cost(&other.census, &self.census, part.width, &mut scratch.census, costs);
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
