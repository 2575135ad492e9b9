//! The heights of all views of a scene or chunk, from the coarsest pyramid level to the finest.
//!
//! The coarsest level covers the whole height range. Each finer level searches, per pixel, around
//! the heights that the coarser level found at this pixel and next to it. Before a city
//! model is used, the coarse levels are swept without it, to tell which of its buildings are there.
//!
//! Matching depends on where the pixels lie: a blunder on one lattice of pixels is often none on
//! another, and edges fall between other pixels. The finest level may therefore be swept on several
//! lattices, each the same image resampled, whose heights are fused (the idea of cycle spinning:
//! Coifman and Donoho 1995, "Translation-invariant de-noising"). The other images of a cost stay as
//! they are. The other lattices ask the coarse levels where a pattern repeats ([`CoarseGuide`]).

use std::collections::BTreeMap;

use numeric::{Muted, Progress};
use rayon::prelude::*;
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::ranges::{Ranges, Reach};
use sweep::{CoarseGuide, HeightMap, LevelConfig, Prior, Reference, SweepError, SweepView, ViewLevel, sweep_level};

use crate::error::ReconstructError;
use crate::planning::levels::SweepLevels;
use crate::prior::findings::PriorFindings;
use crate::prior::verdict::refuted;
use crate::prior::view_prior::{DEVIATION_M, ViewPrior, tolerance_m};
use crate::tuning::SweepTuning;
use crate::values::HeightRange;

/// Tolerance of the consistency check on coarse levels, pixels. Coarse heights are rough, and a
/// wrong deletion costs more than a wide range.
const COARSE_TOLERANCE_PX: f64 = 2.0;

/// Penalty of a jump on coarse levels, three quarters of that on the finest. A house is few pixels
/// wide there, and what the coarse levels smooth away is never searched again.
const COARSE_JUMP: u8 = 93;
/// Penalty of a step on coarse levels, five eighths of that on the finest: their steps are large,
/// and a slope or a low house takes few of them.
const COARSE_STEP: u8 = 20;

/// Parameters of a sweep of all views.
#[derive(Debug, Clone)]
pub struct SceneSweep {
    /// Heights to search.
    pub range: HeightRange,
    /// Distance of two hypotheses at full resolution, metres; each coarser level doubles it.
    pub step_m: f64,
    /// Pyramid levels.
    pub levels: SweepLevels,
    /// For each view, the views it is compared with.
    pub sources: Vec<Vec<usize>>,
    /// Distances around a coarse pixel from which heights are taken over.
    pub reach: Reach,
    /// Penalty of a jump across the strongest image edges on the finest level.
    pub jump_at_edge: u8,
    /// Lattices of pixels beside the images' own on which the finest level is swept: columns and
    /// rows, pixels of that level.
    pub lattices_px: &'static [[f64; 2]],
    /// For each view, what it sees of a city model; empty without a model.
    pub priors: Vec<Option<ViewPrior>>,
}

impl SceneSweep {
    /// Returns the sweep of the images' own lattices, without a city model.
    pub fn new(
        range: HeightRange,
        step_m: f64,
        levels: SweepLevels,
        sources: Vec<Vec<usize>>,
        tuning: &SweepTuning,
    ) -> Self {
        let (reach, jump_at_edge) = (tuning.reaches(), tuning.jump_at_edge);
        Self { range, step_m, levels, sources, reach, jump_at_edge, lattices_px: &[], priors: Vec::new() }
    }

    /// Returns the distance of two hypotheses of a level, metres.
    pub fn step_at(&self, level: usize) -> f64 {
        self.step_m * f64::from(1u32 << level)
    }

    /// Returns the number of height maps that a view gets.
    fn maps_per_view(&self) -> usize {
        self.levels.count() + self.lattices_px.len()
    }
}

/// Heights of all views on the finest level.
#[derive(Debug, Clone)]
pub struct SceneHeights {
    /// One map per view.
    pub maps: Vec<HeightMap>,
    /// The same on other lattices of pixels than the images' own.
    pub shifted: Vec<LatticeHeights>,
    /// Number of pixel-hypothesis pairs evaluated over all views and levels.
    pub hypotheses: u64,
    /// Agreement of the heights of the last coarse level with the city model.
    pub findings: PriorFindings,
}

/// Heights of all views on one lattice of pixels.
#[derive(Debug, Clone)]
pub struct LatticeHeights {
    /// The views with the finest level on the lattice.
    pub views: Vec<SweepView>,
    /// One map per view.
    pub maps: Vec<HeightMap>,
}

/// Sweeps all views from the coarsest level to the finest, and the finest on all lattices: a stage
/// of `progress`, of which each height map of a view is a step.
///
/// # Errors
/// [`ReconstructError::Sweep`] as [`sweep_level`], [`ReconstructError::Cancelled`] between two
/// levels.
pub fn sweep_scene(
    views: &[SweepView],
    sweep: &SceneSweep,
    progress: &dyn Progress,
) -> Result<SceneHeights, ReconstructError> {
    progress.begin("sweeping heights", views.len() * sweep.maps_per_view());
    let SweepLevels { finest, coarsest } = sweep.levels;
    let none = PlacedModel { priors: vec![None; views.len()], findings: PriorFindings::default(), hypotheses: 0 };
    let model = if sweep.priors.iter().any(Option::is_some) {
        let level = (finest + 1).min(coarsest);
        let levels = SweepLevels { finest: level, coarsest };
        let alone = sweep_down(views, sweep, levels, &none.priors, &Muted(progress))?;
        place_model(sweep, &alone, level)
    } else {
        none
    };
    let above = SweepLevels { finest: finest + 1, coarsest };
    let coarse = sweep_down(views, sweep, above, &model.priors, progress)?;
    let mut hypotheses = model.hypotheses + coarse.hypotheses;
    let mut finest_on = |lattice: Lattice<'_>| {
        progress.check_cancelled()?;
        let (maps, evaluated) = sweep_views(views, sweep, lattice, (finest, coarse.last()), &model.priors, progress)?;
        hypotheses += evaluated;
        Ok::<_, ReconstructError>(maps)
    };
    let maps = finest_on(Lattice { references: views, offset_px: [0.0; 2], guides: &[] })?;
    let deeper = sweep_guides(views, sweep, &model.priors, progress)?;
    let coarser = &deeper.as_ref().unwrap_or(&coarse).levels;
    let of_view = |view: usize| coarser.iter().rev().map(|maps| &maps[view]).collect();
    let guides: Vec<CoarseGuide<'_>> =
        maps.iter().enumerate().map(|(view, own)| CoarseGuide { own, coarser: of_view(view) }).collect();
    let mut shifted = Vec::with_capacity(sweep.lattices_px.len());
    for &offset_px in sweep.lattices_px {
        let references: Vec<SweepView> = views.par_iter().map(|view| view.on_lattice(finest, offset_px)).collect();
        let maps = finest_on(Lattice { references: &references, offset_px, guides: &guides })?;
        shifted.push(LatticeHeights { views: references, maps });
    }
    hypotheses += deeper.map_or(0, |deeper| deeper.hypotheses);
    Ok(SceneHeights { maps, shifted, hypotheses, findings: model.findings })
}

/// Sweeps the levels that guide the further lattices: at most [`CoarseGuide::LEVELS`] above the
/// finest, and such that all views have. `None` where there are no further lattices, or the sweep
/// begins that far up anyway.
fn sweep_guides(
    views: &[SweepView],
    sweep: &SceneSweep,
    priors: &[Option<ViewPrior>],
    progress: &dyn Progress,
) -> Result<Option<SweptLevels>, ReconstructError> {
    let SweepLevels { finest, coarsest } = sweep.levels;
    let is_present = |view: &&SweepView| !view.levels[finest].data().is_empty();
    let shared = views.iter().filter(is_present).map(|view| view.levels.len() - 1).min().unwrap_or(finest);
    let deepest = shared.min(finest + CoarseGuide::LEVELS);
    if sweep.lattices_px.is_empty() || deepest <= coarsest {
        return Ok(None);
    }
    let levels = SweepLevels { finest: finest + 1, coarsest: deepest };
    sweep_down(views, sweep, levels, priors, &Muted(progress)).map(Some)
}

/// A lattice of pixels.
#[derive(Clone, Copy)]
struct Lattice<'a> {
    /// The views on the lattice.
    references: &'a [SweepView],
    /// Place of its pixels against those of the images, pixels of the level.
    offset_px: [f64; 2],
    /// What is known of each view before it is swept on this lattice; empty if nothing is.
    guides: &'a [CoarseGuide<'a>],
}

/// Heights of all views after several levels.
struct SweptLevels {
    /// One map per view and level, the coarsest level first.
    levels: Vec<Vec<HeightMap>>,
    /// Number of pixel-hypothesis pairs evaluated.
    hypotheses: u64,
}

impl SweptLevels {
    /// Returns the maps of the finest of the levels; none before any was swept.
    fn last(&self) -> &[HeightMap] {
        self.levels.last().map_or(&[], Vec::as_slice)
    }
}

/// Sweeps all views from the coarsest of the levels down to the finest. Heights of a coarse level
/// that no source shares are dropped.
fn sweep_down(
    views: &[SweepView],
    sweep: &SceneSweep,
    levels: SweepLevels,
    priors: &[Option<ViewPrior>],
    progress: &dyn Progress,
) -> Result<SweptLevels, ReconstructError> {
    let mut out = SweptLevels { levels: Vec::new(), hypotheses: 0 };
    for level in (levels.finest..=levels.coarsest).rev() {
        progress.check_cancelled()?;
        let own = Lattice { references: views, offset_px: [0.0; 2], guides: &[] };
        let (mut maps, evaluated) = sweep_views(views, sweep, own, (level, out.last()), priors, progress)?;
        if level > sweep.levels.finest {
            maps = drop_lone_heights(views, sweep, &maps, level as u32)?;
        }
        out.levels.push(maps);
        out.hypotheses += evaluated;
    }
    Ok(out)
}

/// Sweeps all views on one level and lattice, around the heights of the coarser level if there are
/// any; returns their heights and the number of hypotheses.
fn sweep_views(
    views: &[SweepView],
    sweep: &SceneSweep,
    lattice: Lattice<'_>,
    (level, coarser): (usize, &[HeightMap]),
    priors: &[Option<ViewPrior>],
    progress: &dyn Progress,
) -> Result<(Vec<HeightMap>, u64), SweepError> {
    let swept: Vec<(HeightMap, u64)> = (0..views.len())
        .into_par_iter()
        .map(|i| {
            let out = sweep_view(views, sweep, (i, lattice), (level, coarser.get(i)), priors[i].as_ref());
            progress.step();
            out
        })
        .collect::<Result<_, SweepError>>()?;
    let hypotheses = swept.iter().map(|(_, n)| n).sum();
    Ok((swept.into_iter().map(|(map, _)| map).collect(), hypotheses))
}

/// A city model at its place in the images, without the buildings that they refute.
struct PlacedModel {
    /// What each view sees of it.
    priors: Vec<Option<ViewPrior>>,
    findings: PriorFindings,
    /// Number of pixel-hypothesis pairs that were evaluated to find it.
    hypotheses: u64,
}

/// Places the model at the heights of a level that was swept without it.
fn place_model(sweep: &SceneSweep, alone: &SweptLevels, level: usize) -> PlacedModel {
    let step_m = sweep.step_at(level);
    let of_views = || sweep.priors.iter().zip(alone.last()).filter_map(|(prior, map)| Some((prior.as_ref()?, map)));
    let placed: Vec<Option<ViewPrior>> = of_views().map(|(prior, map)| prior.placed(map, level, step_m)).collect();
    let differences: Vec<Option<BTreeMap<u32, Vec<f32>>>> = of_views()
        .zip(&placed)
        .map(|((_, map), placed)| placed.as_ref().map(|placed| placed.differences(map, level)))
        .collect();
    let mut together: BTreeMap<u32, Vec<f32>> = BTreeMap::new();
    for (number, all) in differences.iter().flatten().flatten() {
        together.entry(*number).or_default().extend(all);
    }
    let tolerance_m = tolerance_m(step_m);
    let gone = refuted(&together, tolerance_m);
    let findings = PriorFindings::new(&differences, &gone, tolerance_m);
    let mut placed = placed.into_iter().map(|prior| prior.map(|prior| prior.without(&gone)));
    let priors = sweep.priors.iter().map(|prior| prior.as_ref().and_then(|_| placed.next().flatten()));
    PlacedModel { priors: priors.collect(), findings, hypotheses: alone.hypotheses }
}

/// Sweeps one view on one level; returns its heights and the number of hypotheses.
fn sweep_view(
    views: &[SweepView],
    sweep: &SceneSweep,
    (index, lattice): (usize, Lattice<'_>),
    (level, coarser): (usize, Option<&HeightMap>),
    known: Option<&ViewPrior>,
) -> Result<(HeightMap, u64), SweepError> {
    let origin_m = sweep.range.middle_m();
    let reference = lattice.references[index].on_level(index, level);
    let (w, h) = (reference.image.width(), reference.image.height());
    if sweep.sources[index].is_empty() {
        return Ok((HeightMap::empty(w, h, origin_m), 0));
    }
    let step = sweep.step_at(level);
    let range = (sweep.range.low_m, sweep.range.high_m);
    let mut ranges = match coarser {
        None => Ranges::uniform(w, h, step, range),
        Some(c) => Ranges::from_coarser(w, h, step, &c.height_m, c.origin_m, range, sweep.reach),
    }
    .without_voids(reference.image);
    if let Some(guide) = lattice.guides.get(index) {
        guide.narrow(&mut ranges);
    }
    let prior_m = known.map(|prior| prior.at_level(level, (w, h), lattice.offset_px));
    let prior = prior_m.as_ref().map(|height_m| Prior { height_m, deviation_m: DEVIATION_M });
    let ranges = match prior {
        Some(prior) => prior.widened(ranges),
        None => ranges,
    };
    let sources: Vec<ViewLevel<'_>> = sweep.sources[index].iter().map(|&s| views[s].on_level(s, level)).collect();
    let mut config = LevelConfig::default();
    if level > sweep.levels.finest {
        config.cost.blends_neighbours = false;
        (config.penalties.step, config.penalties.jump) = (COARSE_STEP, COARSE_JUMP);
    } else {
        config.penalties.jump_at_edge = sweep.jump_at_edge;
    }
    let reference = Reference { view: reference, level: level as u32, ranges: &ranges, prior };
    let map = sweep_level(reference, &sources, origin_m, &config)?;
    Ok((map, ranges.evaluations()))
}

/// Sets coarse heights to NaN that no source shares. A view whose sources have no heights keeps its
/// own.
fn drop_lone_heights(
    views: &[SweepView],
    sweep: &SceneSweep,
    maps: &[HeightMap],
    level: u32,
) -> Result<Vec<HeightMap>, SweepError> {
    let config = ConsistencyConfig { tolerance_px: COARSE_TOLERANCE_PX, ..ConsistencyConfig::default() };
    let heights: Vec<Heights<'_>> =
        maps.iter().enumerate().map(|(index, map)| Heights { index, view: &views[index], map }).collect();
    heights
        .par_iter()
        .map(|h| {
            let own_heights = |s: &&usize| !sweep.sources[**s].is_empty();
            let others: Vec<Heights<'_>> =
                sweep.sources[h.index].iter().filter(own_heights).map(|&s| heights[s]).collect();
            if others.is_empty() {
                return Ok(h.map.clone());
            }
            let counts = count_agreeing(*h, &others, level, &config)?;
            let mut out = h.map.clone();
            out.height_m.void_where(|i| counts.agreeing.data()[i] == 0);
            Ok(out)
        })
        .collect()
}
