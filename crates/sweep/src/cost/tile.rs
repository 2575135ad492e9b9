//! One tile of the reference: all height planes, all sources.

use multiversion::multiversion;
use raster::{Grid, Window, bicubic_along, cubic_weights};

use super::kernels::{self, Census, FULL};
use super::{Aggregation, CostConfig, SourceLevel};
use crate::SweepError;
use crate::geometry::{TileMap, source_from_reference};
use crate::prior::Prior;
use crate::ranges::Ranges;
use crate::simd::{OVERHANG, Picture, shift_bicubic, transposed};
use crate::view::QUANTISATION_VARIANCE;

/// A tile is not divided below this side: an RPC that is not smooth over eight pixels is broken.
const TILE_MIN: usize = 8;
/// … nor below this many heights.
const PLANES_MIN: i32 = 4;
/// The census looks at the eight neighbours, as MicMac's patches in cities do: the aggregation brings the support that they
/// lack, and roofs keep their edges.
const CENSUS_REACH: usize = 1;
/// Pixels that the cubic interpolation takes in a row.
const CUBIC_TAPS: usize = 4;
/// Planes that are computed before their costs go to the pixels: as many as bytes in a register.
const PLANES_AT_ONCE: usize = 16;
/// Bytes.
const CACHE_LINE: usize = 64;
/// The difference that counts fully, in typical differences of the image: half of them then take part in full. Measured
/// on simulated towns of one and of several dates and on the LiDAR truth of JAX_068, where 0.3 to 0.7 are alike.
const FULL_DIFFERENCE: f32 = 0.5;

/// The reference on the level being swept.
#[derive(Debug, Clone, Copy)]
pub struct Reference<'a> {
    /// Its image and camera.
    pub view: SourceLevel<'a>,
    /// The level of its pyramid.
    pub level: u32,
    /// The hypotheses of its pixels.
    pub ranges: &'a Ranges,
    /// What is known of its heights beforehand.
    pub prior: Option<Prior<'a>>,
}

/// Where a block's costs go: pixel `(x, y)` of `window` has its hypotheses at `offsets[y · width + x]`.
pub(crate) struct BlockCosts<'a> {
    pub(crate) window: Window,
    pub(crate) offsets: &'a [u32],
    /// With as many entries behind them that belong to no pixel as a register holds.
    pub(crate) costs: &'a mut [u8],
}

/// Buffers that a thread reuses from tile to tile.
#[derive(Default)]
pub(crate) struct TileScratch {
    reference: Census,
    reference_voids: Vec<u8>,
    sources: Vec<Laid>,
    grey: Vec<f32>,
    padded: Vec<i16>,
    rows: Vec<i16>,
    apart: [Vec<u8>; 4],
    pair_costs: Vec<Vec<u8>>,
    sums: Vec<u16>,
    weights: Vec<u16>,
    planes: Planes,
}

/// Costs of a few planes, before they go to the pixels: writing them one plane at a time would cost more than computing them.
#[derive(Default)]
struct Planes {
    costs: Vec<u8>,
    /// From one plane to the next: more than a plane holds, so that planes do not share cache sets.
    stride: usize,
}

/// A source laid over the tile, and the census of its shifted form for the current plane.
#[derive(Default)]
struct Laid {
    map: Option<TileMap>,
    picture: Vec<i16>,
    /// Where the census of a pixel that is moved here holds a void; empty where there is none.
    voids: Vec<u8>,
    stride: usize,
    rows: usize,
    origin: [i64; 2],
    /// Where the part's first padded pixel lies for the current plane; `None` where the source is not seen.
    at: Option<(usize, usize)>,
    census: Census,
}

/// Brings differences of grey values to the unit that counts fully: of the image's contrast, or of its noise where that is more.
pub(crate) fn census_scale(view: &SourceLevel<'_>) -> f32 {
    1.0 / (FULL_DIFFERENCE * view.contrast).max(view.noise).max(QUANTISATION_VARIANCE.sqrt())
}

/// Fills the costs of `tile` (a part of the block, in image coordinates) for every pixel's own hypotheses.
pub(crate) fn sweep_tile(
    reference: Reference<'_>,
    sources: &[SourceLevel<'_>],
    tile: Window,
    config: &CostConfig,
    scratch: &mut TileScratch,
    block: &mut BlockCosts<'_>,
) -> Result<(), SweepError> {
    let planes = plane_span(reference.ranges, tile);
    sweep_planes(reference, sources, (tile, planes), config, scratch, block)
}

/// Fills the costs of the tile's pixels for those of their hypotheses that lie among `planes`.
fn sweep_planes(
    reference: Reference<'_>,
    sources: &[SourceLevel<'_>],
    (tile, planes): (Window, (i32, i32)),
    config: &CostConfig,
    scratch: &mut TileScratch,
    block: &mut BlockCosts<'_>,
) -> Result<(), SweepError> {
    let maps = match fit_maps(reference, sources, tile, planes, config)? {
        Fitted::Maps(maps) => maps,
        Fitted::RoughAcross => {
            for part in halves(tile) {
                sweep_planes(reference, sources, (part, planes), config, scratch, block)?;
            }
            return Ok(());
        }
        Fitted::RoughAlong => {
            let middle = planes.0 + (planes.1 - planes.0) / 2;
            for part in [(planes.0, middle), (middle, planes.1)] {
                sweep_planes(reference, sources, (tile, part), config, scratch, block)?;
            }
            return Ok(());
        }
    };
    scratch.prepare(reference, sources, &maps, tile, planes, config);
    scratch.sweep_part(reference, tile, (tile, planes), config, block);
    Ok(())
}

/// First plane and one past the last that any pixel of the tile asks for.
#[multiversion(targets("x86_64+avx2"))]
fn plane_span(ranges: &Ranges, tile: Window) -> (i32, i32) {
    let mut span = (i32::MAX, i32::MIN);
    for y in tile.y as usize..tile.y as usize + tile.height {
        let low = &ranges.low.row(y)[tile.x as usize..][..tile.width];
        let count = &ranges.count.row(y)[tile.x as usize..][..tile.width];
        for (low, count) in low.iter().zip(count) {
            span = (span.0.min(*low), span.1.max(low + i32::from(*count)));
        }
    }
    span
}

/// Whether a part of a tile would be swept through far more planes than its pixels ask for, as at a wall between two roofs.
/// Parts cost their margins again: below 16 pixels these outweigh the gain.
fn is_wasteful(ranges: &Ranges, part: Window, planes: (i32, i32)) -> bool {
    if part.width.max(part.height) < 32 {
        return false;
    }
    let rows = part.y as usize..part.y as usize + part.height;
    let asked =
        |y: usize| ranges.count.row(y)[part.x as usize..][..part.width].iter().map(|&n| u64::from(n)).sum::<u64>();
    let swept = (planes.1 - planes.0) as u64 * (part.width * part.height) as u64;
    swept > 2 * rows.map(asked).sum::<u64>()
}

/// The local maps of a tile to all sources, or in which direction one of them is over the bound.
enum Fitted {
    Maps(Vec<Option<TileMap>>),
    /// The tile must be divided.
    RoughAcross,
    /// The heights must be divided.
    RoughAlong,
}

/// The local maps to all sources. A source whose camera does not reach the tile has no map: it sees nothing there.
fn fit_maps(
    reference: Reference<'_>,
    sources: &[SourceLevel<'_>],
    tile: Window,
    planes: (i32, i32),
    config: &CostConfig,
) -> Result<Fitted, SweepError> {
    let step = reference.ranges.step_m;
    let heights = (f64::from(planes.0) * step, f64::from(planes.1 - 1) * step);
    let corners = [
        tile.x as f64,
        tile.y as f64,
        (tile.x + tile.width as i64 - 1) as f64,
        (tile.y + tile.height as i64 - 1) as f64,
    ];
    let mut maps = Vec::with_capacity(sources.len());
    for s in sources {
        let exact = |p, h| source_from_reference(reference.view.camera, s.camera, reference.level, p, h);
        let Ok(map) = TileMap::fit(corners, heights, exact) else {
            maps.push(None);
            continue;
        };
        if map.max_error_px > config.map_tolerance_px {
            let centre = [0.5 * (corners[0] + corners[2]), 0.5 * (corners[1] + corners[3])];
            let along = TileMap::fit([centre[0], centre[1], centre[0], centre[1]], heights, exact);
            let is_along = along.is_ok_and(|m| m.max_error_px > 0.5 * config.map_tolerance_px);
            if is_along && planes.1 - planes.0 > PLANES_MIN {
                return Ok(Fitted::RoughAlong);
            }
            if tile.width.max(tile.height) / 2 >= TILE_MIN {
                return Ok(Fitted::RoughAcross);
            }
            return Err(SweepError::NotSmooth {
                reference: reference.view.index,
                source_view: s.index,
                error_px: map.max_error_px,
                bound_px: config.map_tolerance_px,
            });
        }
        maps.push(Some(map));
    }
    Ok(Fitted::Maps(maps))
}

/// The two halves of a tile across its longer side.
fn halves(t: Window) -> [Window; 2] {
    if t.width >= t.height {
        let w = t.width / 2;
        [Window { width: w, ..t }, Window { x: t.x + w as i64, width: t.width - w, ..t }]
    } else {
        let h = t.height / 2;
        [Window { height: h, ..t }, Window { y: t.y + h as i64, height: t.height - h, ..t }]
    }
}

impl TileScratch {
    fn prepare(
        &mut self,
        reference: Reference<'_>,
        sources: &[SourceLevel<'_>],
        maps: &[Option<TileMap>],
        tile: Window,
        planes: (i32, i32),
        config: &CostConfig,
    ) {
        let padded = tile.grown(CENSUS_REACH);
        self.sources.resize_with(sources.len(), Laid::default);
        let step = reference.ranges.step_m;
        for ((laid, source), map) in self.sources.iter_mut().zip(sources).zip(maps) {
            laid.map = *map;
            let heights = (f64::from(planes.0) * step, f64::from(planes.1 - 1) * step);
            laid.lay_over(source, padded, heights, &mut self.grey);
        }
        let pairs = match config.aggregation {
            Aggregation::Variance => sources.len() * (sources.len() + 1) / 2,
            Aggregation::BestOf(_) => sources.len(),
        };
        self.pair_costs.resize_with(pairs, Vec::new);
    }

    /// Fills the costs of a part of the tile for those of its pixels' hypotheses that lie among `planes`.
    fn sweep_part(
        &mut self,
        reference: Reference<'_>,
        part: Window,
        (tile, planes): (Window, (i32, i32)),
        config: &CostConfig,
        block: &mut BlockCosts<'_>,
    ) {
        let asked = plane_span(reference.ranges, part);
        let planes = (asked.0.max(planes.0), asked.1.min(planes.1));
        if planes.0 >= planes.1 {
            return;
        }
        if is_wasteful(reference.ranges, part, planes) {
            for half in halves(part) {
                self.sweep_part(reference, half, (tile, planes), config, block);
            }
            return;
        }
        self.look_at(reference, part);
        for first in (planes.0..planes.1).step_by(PLANES_AT_ONCE) {
            let count = PLANES_AT_ONCE.min((planes.1 - first) as usize);
            for i in 0..count {
                self.shift_sources(f64::from(first + i as i32) * reference.ranges.step_m, part, tile);
                self.combine(part, i, config);
            }
            scatter(reference.ranges, part, (first, count), &self.planes, block);
        }
    }

    /// Takes the reference's picture of a part of the tile, and the room that its planes need.
    fn look_at(&mut self, reference: Reference<'_>, part: Window) {
        let padded = part.grown(CENSUS_REACH);
        let (area, core) = (padded.width * padded.height, part.width * part.height);
        self.rows.resize(padded.width * (padded.height + 3) + OVERHANG, 0);
        self.grey.resize(area, 0.0);
        self.sums.resize(core, 0);
        self.weights.resize(core, 0);
        self.pair_costs.iter_mut().for_each(|c| c.resize(core, 0));
        self.planes.stride = core + CACHE_LINE;
        self.planes.costs.resize(PLANES_AT_ONCE * self.planes.stride, 0);
        copy_window(reference.view.image, padded, &mut self.grey);
        let scale = FULL * census_scale(&reference.view);
        kernels::quantise(&self.grey, scale, &mut self.padded, &mut self.reference_voids);
        kernels::spread(&mut self.reference_voids, padded.width, 2 * CENSUS_REACH + 1);
        self.reference.fill(&self.padded, padded.width);
    }

    /// Brings every source into the geometry of one height plane.
    fn shift_sources(&mut self, height_m: f64, part: Window, tile: Window) {
        let padded = part.grown(CENSUS_REACH);
        let within = [part.x - tile.x, part.y - tile.y];
        for laid in &mut self.sources {
            laid.shift_to(height_m, within, (padded.width, padded.height), &mut self.rows, &mut self.padded);
        }
    }

    /// The cost of the current plane, the `i`th at hand, for every pixel of the part.
    fn combine(&mut self, part: Window, i: usize, config: &CostConfig) {
        let width = part.width + 2 * CENSUS_REACH;
        let out = &mut self.planes.costs[i * self.planes.stride..][..part.width * part.height];
        let mut costs = self.pair_costs.iter_mut();
        for (i, laid) in self.sources.iter().enumerate() {
            if let Some(cost) = costs.next() {
                laid.compare(Some(&self.reference), part.width, &mut self.apart, cost);
                kernels::hide(cost, part.width, &self.reference_voids, width);
            }
            if config.aggregation == Aggregation::Variance {
                for (other, cost) in self.sources[..i].iter().zip(&mut costs) {
                    laid.compare(other.seen(), part.width, &mut self.apart, cost);
                    other.hide(cost, part.width);
                }
            }
        }
        let used = match config.aggregation {
            Aggregation::Variance => self.pair_costs.len(),
            Aggregation::BestOf(k) => select_smallest(&mut self.pair_costs, k),
        };
        let used = &self.pair_costs[..used];
        kernels::mean_cost(used, &mut self.sums, &mut self.weights, out);
    }
}

/// Moves the `k` smallest costs of every pixel into the first `k` planes; returns how many there are.
fn select_smallest(costs: &mut [Vec<u8>], k: usize) -> usize {
    let k = k.clamp(1, costs.len());
    if k < costs.len() {
        for i in 0..k {
            let (head, tail) = costs.split_at_mut(i + 1);
            tail.iter_mut().for_each(|c| kernels::sort_pair(&mut head[i], c));
        }
    }
    k
}

impl Laid {
    /// Resamples the source over the padded tile at the map's middle height, wide enough for all heights.
    fn lay_over(&mut self, source: &SourceLevel<'_>, padded: Window, (h_lo, h_hi): (f64, f64), grey: &mut Vec<f32>) {
        let Some(map) = self.map else { return };
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
        kernels::quantise(grey, FULL * census_scale(source), &mut self.picture, &mut self.voids);
        self.picture.resize(grey.len() + OVERHANG, 0);
        kernels::spread(&mut self.voids, self.stride, CUBIC_TAPS + 2 * CENSUS_REACH);
    }

    /// Grades the picture as it lies over the part `within` the tile at a height; `moved` is for it.
    fn shift_to(
        &mut self,
        height_m: f64,
        within: [i64; 2],
        (width, height): (usize, usize),
        rows: &mut [i16],
        moved: &mut Vec<i16>,
    ) {
        self.at = None;
        let Some([dx, dy]) = self.map.and_then(|m| m.shift_at(height_m)) else { return };
        let (fx, fy) = (dx.floor(), dy.floor());
        let x0 = fx as i64 - 1 - self.origin[0] + within[0];
        let y0 = fy as i64 - 1 - self.origin[1] + within[1];
        let inside =
            x0 >= 0 && y0 >= 0 && x0 as usize + width + 3 <= self.stride && y0 as usize + height + 3 <= self.rows;
        if !inside {
            return;
        }
        let at = (x0 as usize, y0 as usize);
        self.at = Some(at);
        let weights = (cubic_weights((dx - fx) as f32), cubic_weights((dy - fy) as f32));
        let weights = (weights.0.map(kernels::fixed), weights.1.map(kernels::fixed));
        let picture = Picture { data: &self.picture, stride: self.stride };
        moved.resize(width * height + OVERHANG, 0);
        shift_bicubic(picture, at, weights, (width, height), rows, moved);
        self.census.fill(&moved[..width * height], width);
    }

    /// The census of the current plane, where the source is seen at all.
    fn seen(&self) -> Option<&Census> {
        self.at.map(|_| &self.census)
    }

    /// The costs of the current plane against another picture, in rows of `width`; invalid where this source is.
    fn compare(&self, other: Option<&Census>, width: usize, apart: &mut [Vec<u8>; 4], costs: &mut [u8]) {
        if let (Some(own), Some(other)) = (self.seen(), other) {
            kernels::census_cost(other, own, width + 2 * CENSUS_REACH, apart, costs);
        }
        self.hide(costs, width);
    }

    /// Makes the costs of the current plane invalid where the source has voids; rows of `width`.
    fn hide(&self, costs: &mut [u8], width: usize) {
        match self.at {
            None => costs.fill(kernels::INVALID),
            Some((x, y)) if !self.voids.is_empty() => {
                kernels::hide(costs, width, &self.voids[y * self.stride + x..], self.stride);
            }
            Some(_) => {}
        }
    }
}

/// Copies a window that may reach outside the image; NaN there.
fn copy_window(image: &Grid<f32>, w: Window, out: &mut [f32]) {
    out.fill(f32::NAN);
    let Some(i) = Window::whole(image.width(), image.height()).intersection(&w) else { return };
    for y in 0..i.height {
        let from = &image.row(i.y as usize + y)[i.x as usize..i.x as usize + i.width];
        let to = ((i.y - w.y) as usize + y) * w.width + (i.x - w.x) as usize;
        out[to..to + i.width].copy_from_slice(from);
    }
}

/// Writes the costs of the planes from `first` on to the pixels that ask for them.
#[multiversion(targets("x86_64+avx2"))]
fn scatter(ranges: &Ranges, part: Window, (first, count): (i32, usize), planes: &Planes, block: &mut BlockCosts<'_>) {
    let (bx, by) = ((part.x - block.window.x) as usize, (part.y - block.window.y) as usize);
    for y in 0..part.height {
        let low = &ranges.low.row(part.y as usize + y)[part.x as usize..][..part.width];
        let asked = &ranges.count.row(part.y as usize + y)[part.x as usize..][..part.width];
        let offsets = &block.offsets[(by + y) * block.window.width + bx..][..part.width];
        for x0 in (0..part.width).step_by(PLANES_AT_ONCE) {
            let columns = transposed(&planes.costs[y * part.width + x0..], planes.stride);
            for (x, column) in (x0..part.width).zip(&columns) {
                let from = low[x].max(first);
                let to = (low[x] + i32::from(asked[x])).min(first + count as i32);
                if from < to {
                    let at = offsets[x] as usize + (from - low[x]) as usize;
                    put(column, (from - first) as usize, (to - from) as usize, &mut block.costs[at..]);
                }
            }
        }
    }
}

/// Writes `count` of the column's costs, from `first` on, without a loop; what lies behind in `out` stays.
#[inline(always)]
fn put(column: &[u8; PLANES_AT_ONCE], first: usize, count: usize, out: &mut [u8]) {
    let Some(out) = out.first_chunk_mut::<PLANES_AT_ONCE>() else { return };
    if count == PLANES_AT_ONCE {
        *out = *column;
        return;
    }
    let own = u128::MAX >> (8 * (PLANES_AT_ONCE - count));
    let costs = u128::from_le_bytes(*column) >> (8 * first);
    *out = ((costs & own) | (u128::from_le_bytes(*out) & !own)).to_le_bytes();
}
