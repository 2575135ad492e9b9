//! The stages of a run, in which the result of a stage may be replaced by the truth.

use camera::{ImagePoint, RpcCamera};
use geodesy::MapPoint;
use raster::Grid;
use rayon::prelude::*;
use simulate::Simulation;
use sweep::aggregation::Penalties;
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::fusion::{FusionConfig, GridFrame, fuse_views, place_view};
use sweep::ranges::{EDGE_REACH, Ranges, Reach};
use sweep::{HeightMap, LevelConfig, Reference, SweepView, ViewLevel, source_from_reference, sweep_level};

/// Reach of the default preset.
const REACH: Reach = Reach { above: EDGE_REACH, below: 8 };
/// Value of the default preset.
const STEP_PX: f64 = 0.5;
/// Half width of the search around the true heights, steps.
const AROUND: f64 = 4.0;
/// Margin of the search below and above the heights of the scene, metres.
const MARGIN_M: f64 = 20.0;

/// The part of the truth that is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Known {
    /// The true pointing.
    Pointing,
    /// The true pointing, and the true heights as a range of a few steps.
    Range,
    /// The same as `Range`, without regularisation.
    RangeAlone,
}

/// A simulated scene as input of the sweep.
pub(crate) struct Scene<'a> {
    simulation: &'a Simulation,
    views: Vec<SweepView>,
    step_m: f64,
    origin_m: f64,
}

impl<'a> Scene<'a> {
    /// Makes the views with the true RPCs or with the RPCs that a user gets.
    pub(crate) fn new(simulation: &'a Simulation, is_true: bool) -> anyhow::Result<Self> {
        let view = |v: &simulate::SimulatedView| {
            let rpc = if is_true { &v.true_rpc } else { &v.rpc };
            let image = v.image.map(|p| if *p == 0 { f32::NAN } else { f32::from(*p) });
            SweepView::new(RpcCamera::new(rpc.clone()), image)
        };
        let views: Vec<SweepView> = simulation.views.iter().map(view).collect();
        let (low, high) = simulation.scene.height_range_m();
        let origin_m = 0.5 * (low + high);
        let mut parallax = 0.0f64;
        for (i, a) in views.iter().enumerate() {
            for b in &views[..i] {
                let centre = ImagePoint::new(a.levels[0].width() as f64 / 2.0, a.levels[0].height() as f64 / 2.0);
                let at = |h| source_from_reference(&a.camera, &b.camera, 0, centre, h);
                let (p, q) = (at(origin_m)?, at(origin_m + 10.0)?);
                parallax = parallax.max((q.sample - p.sample).hypot(q.line - p.line) / 10.0);
            }
        }
        Ok(Self { simulation, views, step_m: STEP_PX / parallax, origin_m })
    }

    /// Computes the heights of all views.
    pub(crate) fn heights(&self, known: Known) -> anyhow::Result<Vec<HeightMap>> {
        (0..self.views.len()).into_par_iter().map(|i| self.view_heights(i, known)).collect()
    }

    fn view_heights(&self, index: usize, known: Known) -> anyhow::Result<HeightMap> {
        if known != Known::Pointing {
            let truth = self.simulation.views[index].heights.map(|h| (f64::from(*h) - self.origin_m) as f32);
            return self.sweep(index, 0, &self.around(&truth), known);
        }
        let mut found: Option<HeightMap> = None;
        for level in (0..self.views[index].levels.len().min(4)).rev() {
            let (image, step_m) = (&self.views[index].levels[level], self.step_m * f64::from(1u32 << level));
            let (low, high) = self.simulation.scene.height_range_m();
            let full = (low - MARGIN_M, high + MARGIN_M);
            let ranges = match &found {
                None => Ranges::uniform(image.width(), image.height(), step_m, full),
                Some(c) => {
                    let size = (image.width(), image.height());
                    Ranges::from_coarser(size.0, size.1, step_m, &c.height_m, c.origin_m, full, REACH)
                }
            };
            found = Some(self.sweep(index, level, &ranges.without_voids(image), known)?);
        }
        found.ok_or_else(|| anyhow::anyhow!("an image without a level"))
    }

    /// Returns search ranges of a few steps around heights above the origin.
    fn around(&self, height_m: &Grid<f32>) -> Ranges {
        let mut out = Ranges::uniform(height_m.width(), height_m.height(), self.step_m, (0.0, 0.0));
        for (i, h) in height_m.data().iter().enumerate().filter(|(_, h)| !h.is_nan()) {
            out.low.data_mut()[i] = ((f64::from(*h) + self.origin_m) / self.step_m - AROUND).round() as i32;
            out.count.data_mut()[i] = 2 * AROUND as u16 + 1;
        }
        out
    }

    fn sweep(&self, index: usize, level: usize, ranges: &Ranges, known: Known) -> anyhow::Result<HeightMap> {
        let at = |index: usize| self.views[index].on_level(index, level);
        let sources: Vec<ViewLevel<'_>> = (0..self.views.len()).filter(|&i| i != index).map(at).collect();
        let mut config = LevelConfig::default();
        if known == Known::RangeAlone {
            config.penalties = Penalties { step: 0, jump: 0, jump_at_edge: 0 };
        }
        let reference = Reference { view: at(index), level: level as u32, ranges, prior: None };
        Ok(sweep_level(reference, &sources, self.origin_m, &config)?)
    }

    /// Returns the true heights of all pixels.
    pub(crate) fn true_heights(&self) -> Vec<HeightMap> {
        let map = |v: &simulate::SimulatedView| {
            let mut out = HeightMap::empty(v.heights.width(), v.heights.height(), self.origin_m);
            out.height_m = v.heights.map(|h| (f64::from(*h) - self.origin_m) as f32);
            out.sigma_m = v.heights.map(|h| if h.is_nan() { f32::NAN } else { 0.1 });
            out.confidence = v.heights.map(|_| 1.0);
            out.support = v.heights.map(|_| 1.0);
            out
        };
        self.simulation.views.iter().map(map).collect()
    }

    /// Fuses all heights, or only those that another view confirms, on the cells of the truth.
    /// Returns metres above the ellipsoid.
    pub(crate) fn fused(&self, maps: &[HeightMap], checked: bool) -> anyhow::Result<Grid<f32>> {
        let truth = &self.simulation.truth;
        let all: Vec<Heights<'_>> =
            maps.iter().enumerate().map(|(index, map)| Heights { index, view: &self.views[index], map }).collect();
        let [x, y] = self.simulation.frame.origin_m();
        let map_from_ground =
            |g| self.simulation.frame.scene_from_ground(g).ok().map(|p| MapPoint { x: p.x + x, y: p.y + y });
        let frame = GridFrame { geotransform: truth.geotransform, map_from_ground: &map_from_ground };
        let cell_m = self.simulation.config.gsd_m;
        let mut placed = Vec::new();
        for own in &all {
            let others: Vec<Heights<'_>> = all.iter().filter(|o| o.index != own.index).copied().collect();
            let counts = count_agreeing(*own, &others, 0, &ConsistencyConfig::default())?.agreeing;
            let keep = counts.map(|n| !checked || *n > 0);
            placed.push(place_view(*own, 0, &keep, &own.view.blank(0), (2.0 * self.step_m) as f32, &frame)?);
        }
        let config = FusionConfig {
            same_surface_m: (2.0 * self.step_m).max(1.5 * cell_m) as f32,
            tear_m: (2.75 * cell_m).max(2.0 * self.step_m) as f32,
            step_m: self.step_m,
            origin_m: self.origin_m,
            tile: 1024,
        };
        let fused = fuse_views(&placed, (truth.dsm.width(), truth.dsm.height()), &config);
        Ok(fused.height_m.map(|h| (f64::from(*h) + self.origin_m) as f32))
    }
}
