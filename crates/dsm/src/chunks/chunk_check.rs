//! Checks of a chunk's result against its plan, before it is merged.
//!
//! A result may have been computed elsewhere. Heights that are not finite or that the plan never
//! searched, and counts that are not those of the rasters, are no result.

use reconstruct::{CellCounts, HeightRange, SURROUNDINGS_M};

use crate::chunks::chunk::{ChunkContent, ChunkResult, ChunkSurface};
use crate::error::DsmError;
use crate::planning::chunk_plan::{ChunkSweep, ChunkWork};
use crate::planning::plan::Plan;
use sweep::fusion::{FILLED, VOID};

/// Steps of the finest level that an observed height may lie outside the range: hypotheses begin
/// and end on whole steps beyond it, and a height is refined by up to half a step more.
const STEPS_OUTSIDE: f64 = 2.0;
/// Metres that a filled height may lie outside the range. A void is filled on a plane through its
/// border, which no slope up to 45° brings further than the void is wide.
const FILLED_OUTSIDE_M: f64 = SURROUNDINGS_M;

/// What does not fit: found, expected.
type Misfit = (String, String);

impl ChunkResult {
    /// Checks that the result can be that of the plan's chunk with number `index` (from 0): its
    /// cells, its kind, its counts, and heights that are finite and were searched.
    ///
    /// # Errors
    /// [`DsmError::NoSuchChunk`], [`DsmError::ChunkContent`].
    pub(crate) fn check(&self, plan: &Plan, index: usize) -> Result<(), DsmError> {
        let count = plan.chunks.len();
        let chunk = plan.chunks.get(index).ok_or(DsmError::NoSuchChunk { index, count })?;
        let misfit = match (&self.content, &chunk.work) {
            _ if self.core != chunk.core => Some((format!("{:?}", self.core), format!("{:?}", chunk.core))),
            (ChunkContent::Surface(surface), ChunkWork::Sweep(work)) => surface.misfit(plan, work),
            (ChunkContent::Surface(_), _) => Some(("a surface".to_owned(), "cells without work".to_owned())),
            (ChunkContent::Unseen | ChunkContent::Failed { .. }, _) => None,
        };
        misfit.map_or(Ok(()), |(found, expected)| Err(DsmError::ChunkContent { index, found, expected }))
    }
}

impl ChunkSurface {
    fn misfit(&self, plan: &Plan, work: &ChunkSweep) -> Option<Misfit> {
        if self.summary.height_range != work.height_range {
            return Some((in_words(self.summary.height_range), in_words(work.height_range)));
        }
        self.misfit_of_heights(plan, work).or_else(|| self.misfit_of_counts(plan))
    }

    fn misfit_of_heights(&self, plan: &Plan, work: &ChunkSweep) -> Option<Misfit> {
        // Around the buildings of a city model other heights are searched, too.
        let searched = if plan.config.prior.is_some() { HeightRange::EARTH } else { work.height_range };
        let margin_m = STEPS_OUTSIDE * plan.step_m * f64::from(1u32 << work.levels.finest.min(31));
        let observed = searched.grown(margin_m, margin_m);
        let filled = searched.grown(FILLED_OUTSIDE_M, FILLED_OUTSIDE_M);
        let origin_m = self.rasters.origin_m;
        if !origin_m.is_finite() {
            return Some((format!("heights that count from {origin_m} m"), "a height".to_owned()));
        }
        let cells = self.rasters.height_m.data().iter().zip(self.rasters.filled.data());
        for (height_m, mark) in cells {
            let height_m = origin_m + f64::from(*height_m);
            let range = if *mark == FILLED { filled } else { observed };
            let expected = match (*mark == VOID, height_m.is_nan()) {
                (true, true) => continue,
                (true, false) => "none in a void cell".to_owned(),
                (false, true) => "a number in a cell that is not void".to_owned(),
                (false, false) if range.contains(height_m) => continue,
                (false, false) => in_words(range),
            };
            return Some((format!("the height {height_m} m"), expected));
        }
        None
    }

    fn misfit_of_counts(&self, plan: &Plan) -> Option<Misfit> {
        let counts = &self.summary.counts;
        let described = |cells: CellCounts| {
            let CellCounts { observed, filled, void, masked, expected_right, .. } = cells;
            format!(
                "{observed} observed, {filled} filled, {void} void and {masked} masked cells, \
                 {expected_right:.1} heights expected to be right"
            )
        };
        let (own, counted) = (described(counts.cells), described(CellCounts::of(&self.rasters)));
        if own != counted {
            return Some((own, counted));
        }
        let (views, images) = (counts.views.len(), plan.images.len());
        (views > images).then(|| (format!("counts of {views} views"), format!("at most {images}")))
    }
}

fn in_words(range: HeightRange) -> String {
    format!("heights from {:.1} to {:.1} m", range.low_m, range.high_m)
}
