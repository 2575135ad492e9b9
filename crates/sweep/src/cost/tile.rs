//! The costs of one tile of the reference: all sources, all height planes.

use raster::{Grid, Window};

use super::averaged::averaged_pairs;
use super::census::{CHUNK, Census, overhang};
use super::config::{Aggregation, COST_MAX, CostConfig};
use super::division::{SweptPart, TILE_MIN, divide, halves, plane_span};
use super::kernels::{self, FULL, INVALID};
use super::part::{MARGIN, Part};
use super::planes::{BlockCosts, PLANES_AT_ONCE, PlaneRun, Planes, scatter};
use super::scale::census_scale;
use super::voids::Voids;
use super::warped::{PlaneScratch, WarpedSource};
use crate::error::SweepError;
use crate::geometry::{LocalMap, PixelBox, source_column_row};
use crate::reference::Reference;
use crate::view::ViewLevel;

/// Local maps are fitted between multiples of this many planes. A source is resampled at the middle
/// of these heights, and the phase of the resampling changes costs. Two runs whose heights differ a
/// little shall get the same costs, so that the middle must not follow every plane. More planes
/// would make the resampled images larger.
const PLANES_ALIGNED: i32 = 64;
/// A range of this many planes or fewer is not divided further.
const PLANES_MIN: i32 = 4;

/// Buffers that a thread reuses from tile to tile.
#[derive(Default)]
pub(crate) struct TileScratch {
    /// Census of the reference over the part.
    reference: Census,
    reference_voids: Voids,
    /// Sources resampled over the tile.
    sources: Vec<WarpedSource>,
    /// Grey values before quantisation.
    grey: Vec<f32>,
    /// Quantised image of the reference over the part.
    padded: Vec<i16>,
    plane: PlaneScratch,
    /// Costs of one plane for each pair of views.
    pair_costs: Vec<Vec<u8>>,
    /// Number of the pairs whose costs are averaged, the best ones.
    averaged: usize,
    sums: Vec<u16>,
    weights: Vec<u16>,
    planes: Planes,
    parts: Vec<SweptPart>,
}

/// Computes the costs of all hypotheses of a tile's pixels. `tile` is a part of the block, in image
/// coordinates.
///
/// # Errors
/// Returns [`SweepError::NotSmooth`] if the local map to a source exceeds its error bound on the
/// smallest tile.
pub(crate) fn sweep_tile(
    reference: Reference<'_>,
    sources: &[ViewLevel<'_>],
    tile: Window,
    config: &CostConfig,
    scratch: &mut TileScratch,
    block: &mut BlockCosts<'_>,
) -> Result<(), SweepError> {
    let planes = plane_span(reference.ranges, tile);
    sweep_planes(reference, sources, (tile, planes), config, scratch, block)
}

/// Computes the costs of those hypotheses of the tile's pixels that lie among `planes`. Divides the
/// tile or the planes where a local map exceeds its error bound.
fn sweep_planes(
    reference: Reference<'_>,
    sources: &[ViewLevel<'_>],
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
    let mut parts = std::mem::take(&mut scratch.parts);
    parts.clear();
    divide(reference.ranges, tile, planes, &mut parts);
    for part in &parts {
        scratch.sweep_part(reference, part, tile, config, block);
    }
    scratch.parts = parts;
    Ok(())
}

/// Result of fitting the local maps of a tile.
enum Fitted {
    /// A map for each source; `None` if the source does not see the tile.
    Maps(Vec<Option<LocalMap>>),
    /// A map exceeds its error bound across the tile, which must be divided.
    RoughAcross,
    /// A map exceeds its error bound over the heights, which must be divided.
    RoughAlong,
}

/// Fits the local maps to all sources. A source whose camera fails over the tile sees nothing there
/// and has no map.
fn fit_maps(
    reference: Reference<'_>,
    sources: &[ViewLevel<'_>],
    tile: Window,
    planes: (i32, i32),
    config: &CostConfig,
) -> Result<Fitted, SweepError> {
    let step = reference.ranges.step_m;
    let between = |first: i32, last: i32| (f64::from(first) * step, f64::from(last) * step);
    let heights = between(planes.0, planes.1 - 1);
    let wider = between(
        planes.0.div_euclid(PLANES_ALIGNED) * PLANES_ALIGNED,
        ((planes.1 - 1).div_euclid(PLANES_ALIGNED) + 1) * PLANES_ALIGNED,
    );
    let area = PixelBox::of_window(tile);
    let mut maps = Vec::with_capacity(sources.len());
    for s in sources {
        let exact = |p, h| source_column_row(reference.view.camera, s.camera, reference.level, p, h);
        // A camera may fail, or bend, at heights that the tile does not have.
        let aligned = LocalMap::fit(area, wider, exact).ok().filter(|map| map.max_error_px <= config.map_tolerance_px);
        let Some(map) = aligned.or_else(|| LocalMap::fit(area, heights, exact).ok()) else {
            maps.push(None);
            continue;
        };
        if map.max_error_px > config.map_tolerance_px {
            let along = LocalMap::fit(PixelBox::of_point(area.centre()), heights, exact);
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

impl TileScratch {
    /// Resamples all sources over the tile.
    fn prepare(
        &mut self,
        reference: Reference<'_>,
        sources: &[ViewLevel<'_>],
        maps: &[Option<LocalMap>],
        tile: Window,
        planes: (i32, i32),
        config: &CostConfig,
    ) {
        let padded = tile.grown(MARGIN);
        self.sources.resize_with(sources.len(), WarpedSource::default);
        let step = reference.ranges.step_m;
        for ((warped, source), map) in self.sources.iter_mut().zip(sources).zip(maps) {
            let heights = (f64::from(planes.0) * step, f64::from(planes.1 - 1) * step);
            warped.warp(source, *map, padded, heights, &mut self.grey);
        }
        let (pairs, averaged) = match config.aggregation {
            Aggregation::Variance => {
                let all = sources.len() * (sources.len() + 1) / 2;
                (all, all)
            }
            Aggregation::Best => (sources.len(), averaged_pairs(&reference.view, sources)),
        };
        self.averaged = averaged;
        self.pair_costs.resize_with(pairs, Vec::new);
    }

    /// Computes the costs of a part of the tile, plane by plane, and copies them to its pixels.
    fn sweep_part(
        &mut self,
        reference: Reference<'_>,
        swept: &SweptPart,
        tile: Window,
        config: &CostConfig,
        block: &mut BlockCosts<'_>,
    ) {
        let (part, planes) = (swept.window, swept.planes);
        self.look_at(reference, part);
        let is_all = swept.is_all && (planes.1 - planes.0) as usize <= PLANES_AT_ONCE;
        let padded = Part {
            within: [part.x - tile.x, part.y - tile.y],
            width: part.width + 2 * MARGIN,
            height: part.height + 2 * MARGIN,
        };
        for first in (planes.0..planes.1).step_by(PLANES_AT_ONCE) {
            let count = PLANES_AT_ONCE.min((planes.1 - first) as usize);
            for i in 0..count {
                self.sweep_plane(f64::from(first + i as i32) * reference.ranges.step_m, padded, i, config);
            }
            scatter(reference.ranges, part, PlaneRun { first, count, is_all }, &mut self.planes, block);
        }
    }

    /// Grades the reference over a part of the tile and makes room for its planes.
    fn look_at(&mut self, reference: Reference<'_>, part: Window) {
        let padded = part.grown(MARGIN);
        let area = padded.width * padded.height;
        let whole = area.next_multiple_of(CHUNK);
        self.grey.resize(area, 0.0);
        self.sums.resize(whole, 0);
        self.weights.resize(whole, 0);
        self.pair_costs.iter_mut().for_each(|c| c.resize(whole, 0));
        self.planes.fit(padded.width, area);
        copy_window(reference.view.image, padded, &mut self.grey);
        let scale = FULL * census_scale(&reference.view);
        let has_voids = kernels::quantise(&self.grey, scale, overhang(padded.width), &mut self.padded);
        self.reference_voids.mark(&self.grey, padded.width, 2 * MARGIN + 1, has_voids);
        self.reference.fill(&self.padded, padded.width, area);
    }

    /// Computes the `i`th plane at hand, at a height, for every pixel of the part.
    fn sweep_plane(&mut self, height_m: f64, part: Part, i: usize, config: &CostConfig) {
        let Self { reference, reference_voids, sources, plane: scratch, pair_costs, planes, .. } = self;
        let out = planes.plane_mut(i);
        if let [only] = &mut sources[..] {
            only.place(height_m, part, scratch);
            let is_hidden = only.cost(reference, part, INVALID, scratch, out);
            let is_hidden = reference_voids.hide((0, 0), part, INVALID, out) || is_hidden;
            if config.blends_neighbours {
                kernels::blend(out, part.width, is_hidden, &mut self.sums);
            }
            if is_hidden {
                out.iter_mut().for_each(|cost| *cost = (*cost).min(COST_MAX));
            }
            return;
        }
        let mut costs = pair_costs.iter_mut();
        let mut is_hidden = false;
        for i in 0..sources.len() {
            let (before, rest) = sources.split_at_mut(i);
            let (Some(warped), Some(cost)) = (rest.first_mut(), costs.next()) else { continue };
            warped.place(height_m, part, scratch);
            is_hidden |= warped.cost(reference, part, INVALID, scratch, cost);
            is_hidden |= reference_voids.hide((0, 0), part, INVALID, cost);
            if config.aggregation == Aggregation::Variance {
                warped.grade(part, scratch);
                for (other, cost) in before.iter().zip(&mut costs) {
                    is_hidden |= warped.cost_between(other, part, scratch, cost);
                }
            }
        }
        select_smallest(&mut self.pair_costs, self.averaged);
        let used = &mut self.pair_costs[..self.averaged];
        if config.blends_neighbours {
            used.iter_mut().for_each(|costs| kernels::blend(costs, part.width, is_hidden, &mut self.sums));
        }
        kernels::mean_cost(used, is_hidden, &mut self.sums, &mut self.weights, out);
    }
}

/// Moves the `k` smallest costs of every pixel to the first `k` pairs.
fn select_smallest(costs: &mut [Vec<u8>], k: usize) {
    if k < costs.len() {
        for i in 0..k {
            let (head, tail) = costs.split_at_mut(i + 1);
            tail.iter_mut().for_each(|c| kernels::sort_pair(&mut head[i], c));
        }
    }
}

/// Copies a window of an image; outside the image it is NaN.
fn copy_window(image: &Grid<f32>, w: Window, out: &mut [f32]) {
    out.fill(f32::NAN);
    let Some(i) = Window::whole(image.width(), image.height()).intersection(&w) else { return };
    for y in 0..i.height {
        let from = &image.row(i.y as usize + y)[i.x as usize..i.x as usize + i.width];
        let to = ((i.y - w.y) as usize + y) * w.width + (i.x - w.x) as usize;
        out[to..to + i.width].copy_from_slice(from);
    }
}
