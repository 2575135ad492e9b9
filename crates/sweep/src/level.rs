//! Heights of one view on one pyramid level: costs, aggregation and read-out, block by block.
//!
//! Blocks lie on a fixed lattice of the image and overlap by a margin over which the aggregation
//! settles. They are part of the method, so that the result does not depend on memory or threads.

use std::cell::Cell;

use raster::Window;
use rayon::prelude::*;

use crate::aggregation::{Penalties, RowSums, VolumeBlock};
use crate::cost::{COST_MAX, CostConfig};
use crate::error::SweepError;
use crate::height_map::HeightMap;
use crate::ranges::Ranges;
use crate::readout::{Estimates, LeastSum, Modes, TOGETHER};
use crate::reference::Reference;
#[cfg(target_arch = "x86_64")]
use crate::simd::Avx2;
use crate::simd::{Arrays, Kernel};
use crate::support::agreed_share;
use crate::tiles::tiles_on;
use crate::view::ViewLevel;
use crate::volume::CostVolume;

/// Largest side of a block's core, pixels.
const BLOCK: usize = 1024;
/// Smallest side of a block's core, pixels: four times its margin, which is computed as well.
const BLOCK_MIN: usize = 256;
/// Overlap of a block on each side, pixels: one tile of the cost volume, so that the tiles of all
/// blocks lie on one lattice. A path forgets its start within a few tens of pixels.
const BLOCK_MARGIN: usize = 64;

/// Largest number of hypotheses of a block's core, and of those whose buffers are kept for the next
/// block: about four times those of a usual one.
const BLOCK_HYPOTHESES: usize = 64 << 20;

/// Parameters of a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelConfig {
    /// Parameters of the cost volume.
    pub cost: CostConfig,
    /// Penalties of the aggregation.
    pub penalties: Penalties,
    /// Standard deviation of a cost relative to the worst one. It turns the sharpness of a mode
    /// into the deviation of its height.
    pub cost_noise: f32,
}

impl Default for LevelConfig {
    fn default() -> Self {
        Self { cost: CostConfig::default(), penalties: Penalties::default(), cost_noise: 0.02 }
    }
}

/// Computes the heights of one view from its sources. Heights in the result count from `origin_m`,
/// metres above the ellipsoid.
///
/// # Errors
/// Returns [`SweepError::NotSmooth`] if a camera is not smooth at the scale of a tile,
/// [`SweepError::TooManyHypotheses`] if a block does not fit into memory, and
/// [`SweepError::HeightsTooFar`] if the ranges lie absurdly far from the ellipsoid.
pub fn sweep_level(
    reference: Reference<'_>,
    sources: &[ViewLevel<'_>],
    origin_m: f64,
    config: &LevelConfig,
) -> Result<HeightMap, SweepError> {
    let (width, height) = (reference.view.image.width(), reference.view.image.height());
    // Blocks begin where the part of an image does, but end on the tiles of the whole.
    let first = reference.view.first.map(|at| at % BLOCK_MARGIN);
    let cores = tiles_on(Window::whole(width, height), block_side(reference.ranges), first);
    let mut parts: Vec<HeightMap> = cores
        .par_iter()
        .map(|core| sweep_block(reference, sources, *core, origin_m, config))
        .collect::<Result<_, _>>()?;
    if let [_] = parts[..] {
        return Ok(parts.remove(0));
    }
    let mut out = HeightMap::empty(width, height, origin_m);
    for (core, part) in cores.iter().zip(parts) {
        out.put(*core, &part);
    }
    Ok(out)
}

/// Returns the side of the blocks' cores: a level of many hypotheses is swept in smaller ones.
fn block_side(ranges: &Ranges) -> usize {
    let mean = ranges.evaluations() as usize / ranges.count.data().len().max(1);
    let mut side = BLOCK;
    while side > BLOCK_MIN && side * side * mean > BLOCK_HYPOTHESES {
        side /= 2;
    }
    side
}

fn sweep_block(
    reference: Reference<'_>,
    sources: &[ViewLevel<'_>],
    core: Window,
    origin_m: f64,
    config: &LevelConfig,
) -> Result<HeightMap, SweepError> {
    let whole = Window::whole(reference.view.image.width(), reference.view.image.height());
    let window = core.grown(BLOCK_MARGIN).intersection(&whole).unwrap_or(core);
    let LevelScratch { costs, mut forward } = SCRATCH.take();
    let volume = CostVolume::compute(reference, sources, window, &config.cost, costs)?;
    let mut reader = Reader {
        reference,
        window,
        core,
        config,
        best: vec![0; window.width * window.height],
        out: HeightMap::empty(core.width, core.height, origin_m),
    };
    let block = volume.as_block();
    volume.aggregate(config.penalties, &mut forward, |y, sums| read_row(&mut reader, &block, y, sums));
    if volume.hypotheses() <= BLOCK_HYPOTHESES {
        SCRATCH.set(LevelScratch { costs: volume.into_buffer(), forward });
    }
    Ok(reader.finish())
}

/// Buffers for a block's costs and for the forward pass: two bytes per hypothesis.
#[derive(Default)]
struct LevelScratch {
    costs: Vec<u8>,
    forward: Vec<u8>,
}

thread_local! {
    /// Kept from block to block and from level to level: fresh pages cost more time than the work
    /// on them.
    static SCRATCH: Cell<LevelScratch> = Cell::default();
}

/// Reads the heights of a block from its aggregated costs, row by row.
struct Reader<'a> {
    reference: Reference<'a>,
    window: Window,
    core: Window,
    config: &'a LevelConfig,
    /// Cost of each pixel of the window at its hypothesis with the least sum.
    best: Vec<u8>,
    /// Heights of the core.
    out: HeightMap,
}

/// Reading of one row.
struct ReadRow<'a, 'b> {
    reader: &'a mut Reader<'b>,
    block: &'a VolumeBlock<'a>,
    y: usize,
    sums: RowSums<'a>,
}

fn read_row(reader: &mut Reader<'_>, block: &VolumeBlock<'_>, y: usize, sums: RowSums<'_>) {
    let kernel = ReadRow { reader, block, y, sums };
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = Avx2::detect() {
        return avx2.run(kernel);
    }
    kernel.run(Arrays);
}

impl<S: LeastSum> Kernel<S> for ReadRow<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self, token: S) {
        read_row_with(token, self);
    }
}

#[inline(always)]
fn read_row_with<S: LeastSum>(token: S, row: ReadRow<'_, '_>) {
    let ReadRow { reader, block, y, sums } = row;
    let Reader { reference, window, core, config, best, out } = reader;
    let scale = 8.0 * f32::from(COST_MAX);
    let step = reference.ranges.step_m;
    let gy = window.y + y as i64;
    let image = &reference.view.image.row(gy as usize)[window.x as usize..][..window.width];
    let row = y * window.width..(y + 1) * window.width;
    let (low, offsets, best) = (&block.low[row.clone()], &block.offsets[row.clone()], &mut best[row]);
    let first = (core.x - window.x) as usize;
    let inner = usize::try_from(gy - core.y).ok().filter(|cy| *cy < core.height);
    let mut modes = Modes::new();
    for start in (0..window.width).step_by(TOGETHER) {
        let run = start..(start + TOGETHER).min(window.width);
        let inside = run.start.max(first)..run.end.min(first + core.width);
        let inside = if inner.is_some() { inside } else { 0..0 };
        for (i, x) in run.enumerate() {
            let own = sums.pixel_with_overhang(x);
            let least = token.least(own.0, own.1);
            best[x] = block.costs[offsets[x] as usize + least.1];
            if inside.contains(&x) {
                modes.put(token, i, own, least);
            }
        }
        let Some(cy) = inner.filter(|_| !inside.is_empty()) else { continue };
        let Estimates { index, spread, margin } = modes.estimates(scale, config.cost_noise);
        let (from, to) = (inside.start - start..inside.end - start, inside.start - first..inside.end - first);
        let heights = out.height_m.row_mut(cy)[to.clone()].iter_mut().zip(&index[from.clone()]);
        for ((height, index), (low, grey)) in heights.zip(low[inside.clone()].iter().zip(&image[inside])) {
            let height_m = (f64::from(*low) + f64::from(*index)) * step;
            // Invalid pixels get no height: voids agree at every height at which both images see
            // them.
            *height = if grey.is_nan() { f32::NAN } else { (height_m - out.origin_m) as f32 };
        }
        let sigmas = out.sigma_m.row_mut(cy)[to.clone()].iter_mut().zip(&spread[from.clone()]);
        sigmas.for_each(|(sigma, spread)| *sigma = spread * step as f32);
        out.confidence.row_mut(cy)[to].copy_from_slice(&margin[from]);
    }
}

impl Reader<'_> {
    /// Adds the support of the heights by the image, and returns the map. A block whose image
    /// has a single value has no heights.
    fn finish(self) -> HeightMap {
        let Self { reference, window, core, best, mut out, .. } = self;
        let support = agreed_share(&best, &reference.view, window);
        let columns = window.x as usize..window.x as usize + window.width;
        let rows = window.y as usize..window.y as usize + window.height;
        let mut values = rows.flat_map(|y| &reference.view.image.row(y)[columns.clone()]).filter(|v| !v.is_nan());
        let is_blank = values.next().is_none_or(|first| values.all(|v| v == first));
        for y in 0..core.height {
            for x in 0..core.width {
                let from = ((core.x - window.x) as usize + x, (core.y - window.y) as usize + y);
                out.support[(x, y)] = support[from.1 * window.width + from.0];
                if out.height_m[(x, y)].is_nan() || is_blank {
                    out.clear((x, y));
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::Aggregation;
    use crate::testing::camera::leaning_camera;
    use crate::testing::plane::view_of_plane;
    use crate::view::SweepView;
    use numeric::SplitMix64;
    use raster::Grid;

    fn config(aggregation: Aggregation) -> LevelConfig {
        let cost = CostConfig { aggregation, ..CostConfig::default() };
        LevelConfig { cost, ..LevelConfig::default() }
    }

    fn reference<'a>(views: &'a [SweepView], ranges: &'a Ranges) -> Reference<'a> {
        Reference { view: views[0].on_level(0, 0), level: 0, ranges, prior: None }
    }

    /// Errors of the inner pixels, in steps, for a plane at a given height.
    fn errors(views: &[SweepView], height_m: f64, aggregation: Aggregation) -> Vec<f64> {
        let size = views[0].levels[0].width();
        let ranges = Ranges::uniform(size, size, 1.0, (-10.0, 30.0));
        let sources: Vec<ViewLevel<'_>> = (1..views.len()).map(|i| views[i].on_level(i, 0)).collect();
        let map = sweep_level(reference(views, &ranges), &sources, 0.0, &config(aggregation)).unwrap();
        let inner = 30..size - 30;
        let at = |x: usize, y: usize| f64::from(map.height_m[(x, y)]) - height_m;
        inner.clone().flat_map(|y| inner.clone().map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect()
    }

    #[test]
    fn a_plane_is_found_to_a_tenth_of_a_pixel_of_parallax_wherever_it_lies() {
        let cameras = [[0.0, 0.0], [0.5, 0.1], [-0.3, 0.4]].map(|p| leaning_camera(120, p));
        for height_m in [7.0, 7.25, 7.5] {
            let views = cameras.clone().map(|c| view_of_plane(c, 120, height_m));
            for aggregation in [Aggregation::Variance, Aggregation::Best] {
                let all = errors(&views, height_m, aggregation);
                let rmse = (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt();
                // A step is half a pixel of parallax here.
                assert!(rmse < 0.2, "RMSE {rmse} steps at {height_m} by {aggregation:?}");
            }
        }
    }

    #[test]
    fn noise_is_averaged_over_the_views_where_it_hides_the_texture() {
        let cameras = [[0.0, 0.0], [0.5, 0.1], [-0.3, 0.4], [0.2, -0.5], [-0.4, -0.2]];
        let mut random = SplitMix64::new(1);
        let noisy = |p| {
            let camera = leaning_camera(120, p);
            let mut image = view_of_plane(camera.clone(), 120, 7.3).levels.remove(0);
            image.data_mut().iter_mut().for_each(|v| *v += 60.0 * random.normal() as f32);
            SweepView::new(camera, image)
        };
        let views: Vec<SweepView> = cameras.into_iter().map(noisy).collect();
        let share_right = |views: &[SweepView]| {
            let all = errors(views, 7.3, Aggregation::Best);
            all.iter().filter(|error| error.abs() < 2.0).count() as f64 / all.len() as f64
        };
        // Views that are said to have no noise are compared by their best pair alone.
        let silent: Vec<SweepView> = views.iter().map(|v| SweepView { noise: 0.0, ..v.clone() }).collect();
        let (averaged, best) = (share_right(&views), share_right(&silent));
        assert!(averaged > 0.9 && best < 0.8, "{averaged} {best}");
    }

    fn swept(views: &[SweepView], order: &[usize]) -> HeightMap {
        let (w, h) = (views[0].levels[0].width(), views[0].levels[0].height());
        let ranges = Ranges::uniform(w, h, 1.0, (-10.0, 30.0));
        let sources: Vec<ViewLevel<'_>> = order.iter().map(|&i| views[i].on_level(i, 0)).collect();
        sweep_level(reference(views, &ranges), &sources, 0.0, &config(Aggregation::Variance)).unwrap()
    }

    /// Share of pixels whose heights in two maps differ by less than a hundredth of a step.
    fn same(a: &HeightMap, b: &HeightMap) -> f64 {
        let pairs = a.height_m.data().iter().zip(b.height_m.data());
        let same = pairs.filter(|(a, b)| (*a - *b).abs() < 0.01 || (a.is_nan() && b.is_nan())).count();
        same as f64 / a.height_m.data().len() as f64
    }

    fn three_views(size: usize) -> Vec<SweepView> {
        let cameras = [[0.0, 0.0], [0.5, 0.1], [-0.3, 0.4]].map(|p| leaning_camera(size, p));
        cameras.map(|c| view_of_plane(c, size, 7.3)).to_vec()
    }

    /// A core that begins and ends inside a run of pixels has the heights that the whole window has
    /// there.
    #[test]
    fn a_block_reads_its_core_where_it_is() {
        let views = three_views(130);
        let ranges = Ranges::uniform(130, 130, 1.0, (-10.0, 30.0));
        let (reference, sources) = (reference(&views, &ranges), [views[1].on_level(1, 0)]);
        let config = config(Aggregation::Variance);
        let block = |core| sweep_block(reference, &sources, core, 0.0, &config).unwrap();
        // With its margin the core's window is the whole image.
        let core = Window { x: 45, y: 41, width: 43, height: 46 };
        let (part, whole) = (block(core), block(Window::whole(130, 130)));
        fn maps(map: &HeightMap) -> [&Grid<f32>; 4] {
            [&map.height_m, &map.sigma_m, &map.confidence, &map.support]
        }
        let bits = |map: &Grid<f32>| map.data().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(part.height_m.data().iter().filter(|h| h.is_finite()).count() > 1500);
        for (part, whole) in maps(&part).into_iter().zip(maps(&whole)) {
            assert_eq!(bits(part), bits(&whole.window(core, f32::NAN)));
        }
    }

    #[test]
    fn the_order_of_the_sources_does_not_matter() {
        let views = three_views(100);
        assert!(same(&swept(&views, &[1, 2]), &swept(&views, &[2, 1])) > 0.999);
    }

    #[test]
    fn gain_and_offset_of_each_view_do_not_matter() {
        let views = three_views(100);
        let changed: Vec<SweepView> = [(2.0f32, 30.0f32), (7.0, -90.0), (1.5, 400.0)]
            .iter()
            .zip(&views)
            .map(|((gain, offset), v)| SweepView::new(v.camera.clone(), v.levels[0].map(|x| gain * x + offset)))
            .collect();
        assert!(same(&swept(&views, &[1, 2]), &swept(&changed, &[1, 2])) > 0.99);
    }

    /// Whole tiles are cut off at the upper left of all views, or parts of tiles: the rest keeps
    /// its heights.
    #[test]
    fn where_the_images_begin_does_not_matter() {
        let views = three_views(192);
        let whole = swept(&views, &[1, 2]).height_m;
        for (x, y) in [(64, 64), (40, 24)] {
            let cut = Window { x: x as i64, y: y as i64, width: 192 - x, height: 192 - y };
            let origin = camera::ImagePoint::new(x as f64, y as f64);
            let part = |v: &SweepView| SweepView::new(v.camera.cropped(origin), v.levels[0].window(cut, f32::NAN));
            let parts: Vec<SweepView> = views.iter().map(|v| part(v).beginning_at([x, y])).collect();
            let inner = Window { x: 20, y: 20, width: cut.width - 40, height: cut.height - 40 };
            let whole = whole.window(cut, f32::NAN).window(inner, f32::NAN);
            let part = swept(&parts, &[1, 2]).height_m.window(inner, f32::NAN);
            let same = whole.data().iter().zip(part.data()).filter(|(a, b)| (*a - *b).abs() < 0.02).count();
            assert!(same * 100 >= 99 * part.data().len(), "{same} of {} from {x}, {y}", part.data().len());
        }
    }

    /// An image of another place among the sources does not change a bit.
    #[test]
    fn a_source_that_shows_nothing_of_a_tile_costs_nothing() {
        let views = three_views(130);
        let blind = SweepView::new(views[2].camera.clone(), Grid::filled(130, 130, f32::NAN));
        let four = [&views[..], &[blind]].concat();
        let bits = |map: &HeightMap| map.height_m.data().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let best = |order: &[usize]| {
            let ranges = Ranges::uniform(130, 130, 1.0, (-10.0, 30.0));
            let sources: Vec<ViewLevel<'_>> = order.iter().map(|&i| four[i].on_level(i, 0)).collect();
            sweep_level(reference(&four, &ranges), &sources, 0.0, &config(Aggregation::Best)).unwrap()
        };
        assert_eq!(bits(&best(&[1, 2])), bits(&best(&[1, 2, 3])));
    }

    #[test]
    fn blank_and_missing_images_give_no_height() {
        let cameras = [[0.0, 0.0], [0.5, 0.1]].map(|p| leaning_camera(80, p));
        for value in [100.0f32, f32::NAN] {
            let views = cameras.clone().map(|c| SweepView::new(c, Grid::filled(80, 80, value)));
            let ranges = Ranges::uniform(80, 80, 1.0, (-10.0, 30.0));
            let config = config(Aggregation::Variance);
            let map = sweep_level(reference(&views, &ranges), &[views[1].on_level(1, 0)], 0.0, &config).unwrap();
            assert!(map.height_m.data().iter().all(|h| h.is_nan()));
        }
    }
}
