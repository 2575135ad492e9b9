//! One tile of the reference: all height planes, all sources.

use raster::{Grid, Window, bicubic, cubic_weights};

use super::kernels::{self, Picture};
use super::{Aggregation, COST_MAX, CostConfig, SourceLevel};
use crate::SweepError;
use crate::geometry::{TileMap, source_from_reference};
use crate::ranges::Ranges;

/// A tile is not divided below this side: an RPC that is not smooth over eight pixels is broken.
const TILE_MIN: usize = 8;
/// … nor below this many heights.
const PLANES_MIN: i32 = 4;
/// Variance that an 8-bit quantisation alone leaves in a patch.
pub(crate) const VARIANCE_FLOOR: f32 = 1.0 / 12.0;
/// The census looks at the eight neighbours, as MicMac's patches in cities do: the aggregation brings the support that they
/// lack, and roofs keep their edges.
const CENSUS_REACH: usize = 1;
/// The difference that counts fully, in typical differences of the image: half of them then take part in full. Measured
/// on simulated towns of one and of several dates and on the LiDAR truth of JAX_068, where 0.3 to 0.7 are alike.
const FULL_DIFFERENCE: f32 = 0.5;

/// The reference on the level being swept.
#[derive(Clone, Copy)]
pub(crate) struct Reference<'a> {
    pub(crate) view: SourceLevel<'a>,
    pub(crate) level: u32,
    pub(crate) ranges: &'a Ranges,
}

/// Where a block's costs go: pixel `(x, y)` of `window` has its hypotheses at `offsets[y · width + x]`.
pub(crate) struct BlockCosts<'a> {
    pub(crate) window: Window,
    pub(crate) offsets: &'a [u32],
    pub(crate) costs: &'a mut [u8],
}

/// Buffers that a thread reuses from tile to tile.
#[derive(Default)]
pub struct TileScratch {
    reference: Vec<f32>,
    sources: Vec<Laid>,
    rows: Vec<f32>,
    pair_costs: Vec<Vec<f32>>,
    weights: Vec<f32>,
    mean: Vec<f32>,
    quantised: Vec<u8>,
}

/// A source laid over the tile, and its shifted form for the current plane.
#[derive(Default)]
struct Laid {
    map: Option<TileMap>,
    picture: Vec<f32>,
    stride: usize,
    rows: usize,
    origin: [i64; 2],
    plane: Vec<f32>,
    scale: f32,
}

/// Brings differences of grey values to the unit that counts fully: of the image's contrast, or of its noise where that is more.
pub(crate) fn census_scale(view: &SourceLevel<'_>) -> f32 {
    1.0 / (FULL_DIFFERENCE * view.contrast).max(view.noise).max(VARIANCE_FLOOR.sqrt())
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
    if is_wasteful(reference.ranges, tile, planes) {
        for part in halves(tile) {
            sweep_tile(reference, sources, part, config, scratch, block)?;
        }
        return Ok(());
    }
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
    for k in planes.0..planes.1 {
        scratch.shift_sources(f64::from(k) * reference.ranges.step_m, tile);
        scratch.combine(tile.width + 2 * CENSUS_REACH, config);
        scatter(reference.ranges, tile, k, &scratch.quantised, block);
    }
    Ok(())
}

/// First plane and one past the last that any pixel of the tile asks for.
fn plane_span(ranges: &Ranges, tile: Window) -> (i32, i32) {
    let mut span = (i32::MAX, i32::MIN);
    for y in 0..tile.height {
        for x in 0..tile.width {
            let at = (tile.x as usize + x, tile.y as usize + y);
            let low = ranges.low[at];
            span = (span.0.min(low), span.1.max(low + i32::from(ranges.count[at])));
        }
    }
    span
}

/// Whether the tile would be swept through far more planes than its pixels ask for, as at a wall between two roofs.
/// Its parts cost their margins again: below 16 pixels these outweigh the gain.
fn is_wasteful(ranges: &Ranges, tile: Window, planes: (i32, i32)) -> bool {
    if tile.width.max(tile.height) < 32 {
        return false;
    }
    let rows = tile.y as usize..tile.y as usize + tile.height;
    let asked = rows.flat_map(|y| &ranges.count.row(y)[tile.x as usize..][..tile.width]).map(|&n| u64::from(n));
    let swept = (planes.1 - planes.0) as u64 * (tile.width * tile.height) as u64;
    swept > 2 * asked.sum::<u64>()
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
        let (area, core) = (padded.width * padded.height, tile.width * tile.height);
        self.rows.resize(padded.width * (padded.height + 3), 0.0);
        self.weights.resize(core, 0.0);
        self.mean.resize(core, 0.0);
        self.quantised.resize(core, 0);
        self.reference.resize(area, 0.0);
        copy_window(reference.view.image, padded, &mut self.reference);
        let scale = census_scale(&reference.view);
        self.reference.iter_mut().for_each(|v| *v *= scale);
        self.sources.resize_with(sources.len(), Laid::default);
        let step = reference.ranges.step_m;
        for ((laid, source), map) in self.sources.iter_mut().zip(sources).zip(maps) {
            laid.plane.resize(area, 0.0);
            laid.scale = census_scale(source);
            laid.map = *map;
            laid.lay_over(source.image, padded, (f64::from(planes.0) * step, f64::from(planes.1 - 1) * step));
        }
        let pairs = match config.aggregation {
            Aggregation::Variance => sources.len() * (sources.len() + 1) / 2,
            Aggregation::BestOf(_) => sources.len(),
        };
        self.pair_costs.resize_with(pairs, Vec::new);
        self.pair_costs.iter_mut().for_each(|c| c.resize(core, 0.0));
    }

    /// Brings every source into the geometry of one height plane.
    fn shift_sources(&mut self, height_m: f64, tile: Window) {
        let padded = tile.grown(CENSUS_REACH);
        for laid in &mut self.sources {
            laid.shift_to(height_m, (padded.width, padded.height), &mut self.rows);
        }
    }

    /// The cost of the current plane for every pixel of the tile.
    fn combine(&mut self, width: usize, config: &CostConfig) {
        let mut pair = 0;
        for (i, laid) in self.sources.iter().enumerate() {
            let out = &mut self.pair_costs[pair];
            kernels::census_cost(&self.reference, &laid.plane, width, out);
            pair += 1;
            if config.aggregation == Aggregation::Variance {
                for other in &self.sources[..i] {
                    let out = &mut self.pair_costs[pair];
                    kernels::census_cost(&other.plane, &laid.plane, width, out);
                    pair += 1;
                }
            }
        }
        let used = match config.aggregation {
            Aggregation::Variance => pair,
            Aggregation::BestOf(k) => select_smallest(&mut self.pair_costs, k),
        };
        kernels::mean_cost(&self.pair_costs[..used], &mut self.weights, &mut self.mean);
        kernels::quantise(&self.mean, f32::from(COST_MAX), &mut self.quantised);
    }
}

/// Moves the `k` smallest costs of every pixel into the first `k` planes; returns how many there are.
fn select_smallest(costs: &mut [Vec<f32>], k: usize) -> usize {
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
    fn lay_over(&mut self, image: &Grid<f32>, padded: Window, (h_lo, h_hi): (f64, f64)) {
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
        self.picture.resize(self.stride * self.rows, 0.0);
        for y in 0..self.rows {
            for x in 0..self.stride {
                let p = [(padded.x + first[0] + x as i64) as f64, (padded.y + first[1] + y as i64) as f64];
                let [u, v] = map.at(p, map.mid_height_m());
                self.picture[y * self.stride + x] = bicubic(image, u, v);
            }
        }
    }

    fn shift_to(&mut self, height_m: f64, (width, height): (usize, usize), rows: &mut [f32]) {
        let Some([dx, dy]) = self.map.and_then(|m| m.shift_at(height_m)) else {
            self.plane.fill(f32::NAN);
            return;
        };
        let (fx, fy) = (dx.floor(), dy.floor());
        let x0 = fx as i64 - 1 - self.origin[0];
        let y0 = fy as i64 - 1 - self.origin[1];
        let inside =
            x0 >= 0 && y0 >= 0 && x0 as usize + width + 3 <= self.stride && y0 as usize + height + 3 <= self.rows;
        if !inside {
            self.plane.fill(f32::NAN);
            return;
        }
        // The unit that counts fully costs nothing here.
        let weights = (cubic_weights((dx - fx) as f32), cubic_weights((dy - fy) as f32).map(|w| w * self.scale));
        let picture = Picture { data: &self.picture, stride: self.stride };
        let at = (x0 as usize, y0 as usize);
        kernels::shift_bicubic(picture, at, weights, (width, height), rows, &mut self.plane);
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

/// Subtracts the mean of the valid samples: keeps f32 sums of squares well conditioned.
pub(crate) fn remove_mean(v: &mut [f32]) {
    let (mut sum, mut n) = (0.0f64, 0u32);
    for x in v.iter().filter(|x| x.is_finite()) {
        sum += f64::from(*x);
        n += 1;
    }
    if n > 0 {
        let mean = (sum / f64::from(n)) as f32;
        v.iter_mut().for_each(|x| *x -= mean);
    }
}

/// Writes one plane's costs to the pixels that ask for it.
fn scatter(ranges: &Ranges, tile: Window, k: i32, costs: &[u8], block: &mut BlockCosts<'_>) {
    let (bx, by) = ((tile.x - block.window.x) as usize, (tile.y - block.window.y) as usize);
    for y in 0..tile.height {
        let low = &ranges.low.row(tile.y as usize + y)[tile.x as usize..][..tile.width];
        let count = &ranges.count.row(tile.y as usize + y)[tile.x as usize..][..tile.width];
        let offsets = &block.offsets[(by + y) * block.window.width + bx..][..tile.width];
        let costs = &costs[y * tile.width..][..tile.width];
        for x in 0..tile.width {
            let d = k.wrapping_sub(low[x]) as u32;
            if d < u32::from(count[x]) {
                block.costs[(offsets[x] + d) as usize] = costs[x];
            }
        }
    }
}
