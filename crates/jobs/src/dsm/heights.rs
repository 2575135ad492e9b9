//! Coarse to fine: the heights of every view.
//!
//! The coarsest level covers the scene's whole range; each finer one searches, per pixel, around what the coarser one
//! found there and next to it.

use rayon::prelude::*;
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::cost::Aggregation;
use sweep::ranges::Ranges;
use sweep::{HeightMap, LevelConfig, Prior, Reference, SweepError, SweepView, ViewLevel, sweep_level};

use crate::dsm::prior::{self, Findings, ViewPrior};

/// What the sweep needs to know of the scene.
#[derive(Debug, Clone)]
pub(crate) struct SweepPlan {
    /// Heights to search, metres above the ellipsoid.
    pub(crate) range_m: (f64, f64),
    /// Metres between hypotheses at full resolution; each coarser level doubles it.
    pub(crate) step_m: f64,
    /// The coarsest pyramid level used.
    pub(crate) top_level: usize,
    /// The finest pyramid level used: 0 is the full resolution.
    pub(crate) bottom_level: usize,
    /// For each view, the views it is compared with.
    pub(crate) sources: Vec<Vec<usize>>,
    /// How far around a coarse pixel heights are taken over, coarse pixels.
    pub(crate) reach: usize,
    /// Cost, penalties and read-out.
    pub(crate) level: LevelConfig,
    /// For each view what it sees of a city model, if anything; empty without one.
    pub(crate) priors: Vec<Option<ViewPrior>>,
}

impl SweepPlan {
    /// Metres between the hypotheses of a level.
    pub(crate) fn step_at(&self, level: usize) -> f64 {
        self.step_m * f64::from(1u32 << level)
    }
}

/// Heights of all views on the finest level used, and how many hypotheses were evaluated for them.
#[derive(Debug, Clone)]
pub(crate) struct SceneHeights {
    /// One map per view.
    pub(crate) maps: Vec<HeightMap>,
    /// Pixel × hypothesis pairs over all views and levels.
    pub(crate) evaluations: u64,
    /// What the last coarse level says of the buildings of the prior.
    pub(crate) findings: Findings,
}

/// Sweeps all views from the coarsest level down. `done` is told after each view and level.
///
/// # Errors
/// Those of [`sweep_level`].
pub(crate) fn sweep_scene(
    views: &[SweepView],
    plan: &SweepPlan,
    done: &(dyn Fn() + Sync),
) -> Result<SceneHeights, SweepError> {
    let origin_m = 0.5 * (plan.range_m.0 + plan.range_m.1);
    let mut maps: Vec<HeightMap> = Vec::new();
    let mut evaluations = 0;
    // Where there are coarser levels, the prior waits for them to tell where it lies.
    let is_single = plan.top_level == plan.bottom_level;
    let mut priors: Vec<Option<ViewPrior>> = if is_single { plan.priors.clone() } else { Vec::new() };
    priors.resize(views.len(), None);
    let mut findings = Findings::default();
    for level in (plan.bottom_level..=plan.top_level).rev() {
        let swept: Vec<(HeightMap, u64)> = (0..views.len())
            .into_par_iter()
            .map(|i| {
                let out = sweep_view(views, plan, i, level, maps.get(i), priors[i].as_ref(), origin_m);
                done();
                out
            })
            .collect::<Result<_, SweepError>>()?;
        evaluations += swept.iter().map(|(_, n)| n).sum::<u64>();
        maps = swept.into_iter().map(|(m, _)| m).collect();
        if level > plan.bottom_level {
            maps = drop_lone_heights(views, plan, &maps, level as u32)?;
            findings = Findings::default();
            let mut checked = |(prior, map): (&Option<ViewPrior>, &HeightMap)| {
                let held = prior.as_ref()?.checked(map, level, plan.step_at(level));
                findings.add(held.as_ref().map(|(_, evidence)| evidence));
                Some(held?.0)
            };
            priors = plan.priors.iter().zip(&maps).map(&mut checked).collect();
            priors.resize(views.len(), None);
        }
    }
    Ok(SceneHeights { maps, evaluations, findings })
}

fn sweep_view(
    views: &[SweepView],
    plan: &SweepPlan,
    index: usize,
    level: usize,
    coarser: Option<&HeightMap>,
    known: Option<&ViewPrior>,
    origin_m: f64,
) -> Result<(HeightMap, u64), SweepError> {
    let reference = views[index].on_level(index, level);
    let (w, h) = (reference.image.width(), reference.image.height());
    if plan.sources[index].is_empty() {
        return Ok((HeightMap::empty(w, h, origin_m), 0));
    }
    let step = plan.step_at(level);
    let ranges = match coarser {
        None => Ranges::uniform(w, h, step, plan.range_m),
        Some(c) => Ranges::from_coarser(w, h, step, &c.height_m, c.origin_m, plan.range_m, plan.reach),
    }
    .without_voids(reference.image);
    let prior_m = known.map(|prior| prior.at_level(level, (w, h)));
    let prior = prior_m.as_ref().map(|height_m| Prior { height_m, deviation_m: prior::DEVIATION_M });
    let ranges = match prior {
        Some(prior) => prior.widened(ranges),
        None => ranges,
    };
    let sources: Vec<ViewLevel<'_>> = plan.sources[index].iter().map(|&s| views[s].on_level(s, level)).collect();
    let mut config = plan.level;
    config.cost.aggregation = Aggregation::of_sources(sources.len());
    let reference = Reference { view: reference, level: level as u32, ranges: &ranges, prior };
    let map = sweep_level(reference, &sources, origin_m, &config)?;
    Ok((map, ranges.evaluations()))
}

/// On a coarse level, a height that no other view shares is forgotten, unless nothing around it is known either.
fn drop_lone_heights(
    views: &[SweepView],
    plan: &SweepPlan,
    maps: &[HeightMap],
    level: u32,
) -> Result<Vec<HeightMap>, SweepError> {
    // Two pixels: coarse heights are rough, and a wrong deletion costs more than a wide range.
    let config = ConsistencyConfig { tolerance_px: 2.0, ..ConsistencyConfig::default() };
    let heights: Vec<Heights<'_>> =
        maps.iter().enumerate().map(|(index, map)| Heights { index, view: &views[index], map }).collect();
    heights
        .par_iter()
        .map(|h| {
            let own_heights = |s: &&usize| !plan.sources[**s].is_empty();
            let others: Vec<Heights<'_>> =
                plan.sources[h.index].iter().filter(own_heights).map(|&s| heights[s]).collect();
            if others.is_empty() {
                return Ok(h.map.clone());
            }
            let counts = count_agreeing(*h, &others, level, &config)?;
            let mut out = h.map.clone();
            for (height, n) in out.height_m.data_mut().iter_mut().zip(counts.data()) {
                if *n == 0 {
                    *height = f32::NAN;
                }
            }
            Ok(out)
        })
        .collect()
}
