//! Horizontal translation between two surfaces with the least NMAD of their differences.
//!
//! All whole-cell shifts within a radius are tried on a sample of the reference's cells. The best
//! few are compared on a larger sample. The best of these is refined by a compass search down to
//! 1/64 cell and by a paraboloid around its end. The NMAD does not depend on the vertical shift,
//! and it ignores up to half of the cells (vegetation, changes, gross errors).
//!
//! Interpolation smooths a noisy surface, most of all half-way between cells: compared at the cell
//! centres, shifts by half a cell would win on any noisy surface. Sharp edges that are sampled on
//! one lattice agree best at whole cells. So the refinement compares both surfaces after the same
//! low-pass filter, at positions scattered within the cells, which removes both effects. Errors are
//! measured on the unsmoothed surfaces.
//!
//! A shift counts only if it keeps at least three quarters of the largest number of cells valid in
//! both. Otherwise an incomplete surface would do best where it hardly overlaps. The samples are
//! stratified and depend on the grids alone. Flat ground has no unique translation: the NMAD then
//! hardly changes over the searched shifts, which [`SearchSummary::contrast`] shows.

use crate::alignment::align::MetresFromCells;
use crate::alignment::cell_map::CellMap;
use crate::alignment::resample::bilinear;
use crate::alignment::smooth::smoothed;
use crate::error::EvalError;
use numeric::random::hash64;
use numeric::{upper_median, upper_nmad};
use raster::Grid;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::HashSet;

/// Lowest number of cells valid in both surfaces.
const LEAST_CELLS: usize = 100;
/// Share of the largest common cell count that a shift must keep.
const LEAST_OVERLAP: f64 = 0.75;
/// Highest number of whole-cell shifts.
const MOST_CANDIDATES: usize = 50_000;
/// Shortest search radius, cells.
const LEAST_RADIUS_CELLS: f64 = 2.0;
/// Number of winners on the small sample that are compared on the large one.
pub(crate) const FINALISTS: usize = 5;
/// Number of cells of the small sample.
const SMALL_SAMPLE: std::ops::RangeInclusive<usize> = 10_000..=60_000;
/// Number of heights read from the small sample over all shifts. It bounds the time of a wide
/// search.
const SMALL_SAMPLE_READS: usize = 30_000_000;
/// Number of positions of the large sample.
const LARGE_SAMPLE: usize = 250_000;
/// Highest number of positions of the large sample within one cell.
const MOST_PER_CELL: usize = 4;
/// Step at which the compass search ends, cells.
const LAST_STEP_CELLS: f64 = 1.0 / 64.0;
/// Distance of the 5 × 5 shifts to which the last paraboloid is fitted, cells.
const FIT_STEP_CELLS: f64 = 0.25;
/// Highest ratio of the NMAD at the vertex to that of the minimum for which the vertex is accepted.
const CLEARLY_BETTER: f64 = 1.02;
/// Largest distance of the refined shift from the best whole-cell shift, cells.
const MOST_REFINEMENT_CELLS: f64 = 1.5;

/// Summary of a search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SearchSummary {
    /// Search radius, metres.
    pub radius_m: f64,
    /// Number of whole-cell shifts tried.
    pub candidates: usize,
    /// Median NMAD of all whole-cell shifts divided by the lowest. Near 1 the ground is too flat to
    /// find a shift.
    pub contrast: f64,
    /// Whether the best whole-cell shift lies at the edge of the searched disc. The true shift may
    /// then lie outside.
    pub at_edge: bool,
}

/// Input of a search.
pub(crate) struct Search<'a> {
    pub(crate) reference: &'a Grid<f32>,
    pub(crate) test: &'a Grid<f32>,
    pub(crate) test_from_reference: &'a CellMap,
    pub(crate) metres_from_cells: MetresFromCells,
    pub(crate) measure: Measure,
}

/// What the best shift makes least, of the differences without their median.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Measure {
    /// The NMAD, which ignores up to half of the cells.
    Nmad,
    /// The mean of the magnitudes, none of which counts more than this many metres. It sees a few
    /// walls on much flat ground, and what changed costs every shift the same.
    ClippedMean(f64),
}

impl Measure {
    fn of(self, differences: &mut [f32]) -> f64 {
        match self {
            Self::Nmad => upper_nmad(differences).unwrap_or(f64::INFINITY),
            Self::ClippedMean(most_m) => {
                let Some(median) = upper_median(differences).filter(|_| !differences.is_empty()) else {
                    return f64::INFINITY;
                };
                let magnitude = |d: &f32| f64::from((d - median).abs()).min(most_m);
                differences.iter().map(magnitude).sum::<f64>() / differences.len() as f64
            }
        }
    }
}

/// Position on the reference, in cells, and the height there.
#[derive(Clone, Copy)]
struct Sample {
    column: f64,
    row: f64,
    height: f64,
}

/// Shift in reference cells and its score.
#[derive(Clone, Copy)]
pub(crate) struct Candidate {
    pub(crate) columns: f64,
    pub(crate) rows: f64,
    pub(crate) n: usize,
    pub(crate) score: f64,
}

impl Search<'_> {
    /// Returns the shift, in reference cells, that is added to the test surface.
    pub(crate) fn run(&self, radius_m: f64) -> Result<((f64, f64), SearchSummary), EvalError> {
        let steps = self.steps(radius_m)?;
        let count = (SMALL_SAMPLE_READS / steps.len()).clamp(*SMALL_SAMPLE.start(), *SMALL_SAMPLE.end());
        let ranked = self.try_steps(&steps, count)?;
        let (start, best) = self.finest(&steps, &ranked, LARGE_SAMPLE);
        let summary = SearchSummary {
            radius_m: self.radius_m(radius_m),
            candidates: steps.len(),
            contrast: contrast(&ranked),
            at_edge: at_edge(&steps, start),
        };
        Ok(((best.columns, best.rows), summary))
    }

    /// Compares whole-cell shifts at `count` cells; the best come first.
    pub(crate) fn try_steps(&self, steps: &[(i32, i32)], count: usize) -> Result<Vec<Candidate>, EvalError> {
        let small = self.at_centres(&self.cells_near_test(steps), count);
        let tried = steps.par_iter().map(|&(c, r)| self.candidate(&small, f64::from(c), f64::from(r))).collect();
        let ranked = ranked(tried);
        let found = ranked.first().map_or(0, |c| c.n);
        // Without shared ground there is nothing to align.
        if found == 0 {
            let reference_cells = self.reference.data().iter().filter(|height| height.is_finite()).count();
            return Err(EvalError::NoOverlap { reference_cells });
        }
        if found < LEAST_CELLS {
            return Err(EvalError::TooFewCells { found, needed: LEAST_CELLS });
        }
        Ok(ranked)
    }

    /// Returns the best of the ranked whole-cell shifts, and the shift next to it that fits best,
    /// compared at `count` positions.
    pub(crate) fn finest(&self, steps: &[(i32, i32)], ranked: &[Candidate], count: usize) -> (Candidate, Candidate) {
        let (reference, test) = (smoothed(self.reference), smoothed(self.test));
        let smooth = Search { reference: &reference, test: &test, ..*self };
        let large = smooth.scattered(&self.cells_near_test(steps), count);
        let finalists: Vec<Candidate> =
            ranked.par_iter().take(FINALISTS).map(|c| smooth.candidate(&large, c.columns, c.rows)).collect();
        let nowhere = Candidate { columns: 0.0, rows: 0.0, n: 0, score: f64::INFINITY };
        let start = finalists.into_iter().fold(nowhere, better);
        (start, smooth.levelled(&large, smooth.refined(&large, start)))
    }

    fn radius_m(&self, radius_m: f64) -> f64 {
        let (along_columns, along_rows) = self.metres_from_cells.cell_size_m();
        radius_m.max(LEAST_RADIUS_CELLS * along_columns.max(along_rows))
    }

    /// Returns all whole-cell shifts within the radius, nearest first.
    pub(crate) fn steps(&self, radius_m: f64) -> Result<Vec<(i32, i32)>, EvalError> {
        let radius_m = self.radius_m(radius_m);
        let (along_columns, along_rows) = self.metres_from_cells.cell_size_m();
        let (columns, rows) = (radius_m / along_columns, radius_m / along_rows);
        let candidates = std::f64::consts::PI * columns * rows;
        if candidates.is_nan() || candidates > MOST_CANDIDATES as f64 {
            return Err(EvalError::SearchTooWide { radius_m, candidates: candidates as usize, most: MOST_CANDIDATES });
        }
        // The side lengths underestimate the reach of sheared cells, hence the factor of two.
        let (columns, rows) = (2 * columns as i32 + 1, 2 * rows as i32 + 1);
        let length = |&(c, r): &(i32, i32)| {
            let (dx, dy) = self.metres_from_cells.apply(f64::from(c), f64::from(r));
            dx.hypot(dy)
        };
        let all = (-rows..=rows).flat_map(|r| (-columns..=columns).map(move |c| (c, r)));
        let mut steps: Vec<(i32, i32)> = all.filter(|step| length(step) <= radius_m * (1.0 + 1e-9)).collect();
        steps.sort_by(|a, b| length(a).total_cmp(&length(b)).then(a.cmp(b)));
        Ok(steps)
    }

    /// Returns the indices of the valid reference cells that some shift brings over the test grid.
    fn cells_near_test(&self, steps: &[(i32, i32)]) -> Vec<usize> {
        let (width, height) = (self.test.width() as f64, self.test.height() as f64);
        let reach = steps.iter().map(|&(c, r)| c.abs().max(r.abs())).max().unwrap_or(0);
        let reach = f64::from(reach) + MOST_REFINEMENT_CELLS;
        let near = |column: f64, row: f64| {
            let corner = |sx: f64, sy: f64| self.test_from_reference.position(column + sx * reach, row + sy * reach);
            let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)];
            let apart = corners.iter().all(|c| c.0 < -0.5)
                || corners.iter().all(|c| c.0 > width - 0.5)
                || corners.iter().all(|c| c.1 < -0.5)
                || corners.iter().all(|c| c.1 > height - 0.5);
            !apart
        };
        let columns = self.reference.width().max(1);
        let cells = self.reference.data().par_iter().enumerate();
        cells
            .filter(|(i, h)| h.is_finite() && near((i % columns) as f64, (i / columns) as f64))
            .map(|(i, _)| i)
            .collect()
    }

    /// Samples the centres of at most `count` of the cells.
    fn at_centres(&self, cells: &[usize], count: usize) -> Vec<Sample> {
        let (columns, heights) = (self.reference.width().max(1), self.reference.data());
        let sample = |i: usize| Sample {
            column: (i % columns) as f64,
            row: (i / columns) as f64,
            height: f64::from(heights[i]),
        };
        stratified(cells, count).map(sample).collect()
    }

    /// Samples positions anywhere within at most `count` of the cells, several per cell if there
    /// are few cells.
    fn scattered(&self, cells: &[usize], count: usize) -> Vec<Sample> {
        let columns = self.reference.width().max(1);
        let per_cell = (count / cells.len().max(1)).clamp(1, MOST_PER_CELL);
        let offset = |hash: u64| f64::from(hash as u32) / (f64::from(u32::MAX) + 1.0) - 0.5;
        let sample = |(i, k): (usize, usize)| {
            let hash = hash64((i * MOST_PER_CELL + k) as u64);
            let (column, row) = ((i % columns) as f64 + offset(hash), (i / columns) as f64 + offset(hash >> 32));
            Some(Sample { column, row, height: bilinear(self.reference, column, row)? })
        };
        let places = stratified(cells, count).flat_map(|i| (0..per_cell).map(move |k| (i, k)));
        places.filter_map(sample).collect()
    }

    fn candidate(&self, samples: &[Sample], columns: f64, rows: f64) -> Candidate {
        let difference = |s: &Sample| {
            let (column, row) = self.test_from_reference.position(s.column - columns, s.row - rows);
            Some((bilinear(self.test, column, row)? - s.height) as f32)
        };
        let mut differences: Vec<f32> = samples.iter().filter_map(difference).collect();
        let n = differences.len();
        Candidate { columns, rows, n, score: self.measure.of(&mut differences) }
    }

    /// Refines a shift by compass search: it moves to the best of eight neighbours while that
    /// improves, then halves the step. A shift that was tried before cannot be better than the
    /// best.
    fn refined(&self, samples: &[Sample], start: Candidate) -> Candidate {
        let least = (LEAST_OVERLAP * start.n as f64) as usize;
        let is_near = |c: f64, r: f64| (c - start.columns).abs().max((r - start.rows).abs()) <= MOST_REFINEMENT_CELLS;
        // Whole cells and halved steps are exact, so equal shifts have equal bits.
        let mut tried = HashSet::from([[start.columns, start.rows].map(f64::to_bits)]);
        let mut best = start;
        let mut step = 0.5;
        while step >= LAST_STEP_CELLS {
            let around = COMPASS.map(|(c, r)| (best.columns + c * step, best.rows + r * step));
            let fresh: Vec<(f64, f64)> =
                around.into_iter().filter(|&(c, r)| is_near(c, r) && tried.insert([c, r].map(f64::to_bits))).collect();
            let found: Vec<Candidate> = fresh.par_iter().map(|&(c, r)| self.candidate(samples, c, r)).collect();
            let next = found.into_iter().filter(|c| c.n >= least).fold(best, better);
            if next.score < best.score { best = next } else { step /= 2.0 }
        }
        best
    }

    /// Returns the vertex of the paraboloid through the squared score around a minimum. It averages
    /// the roughness that noise gives to the criterion. Returns the minimum itself if it is clearly
    /// better (surfaces without noise), or if there is no vertex.
    fn levelled(&self, samples: &[Sample], minimum: Candidate) -> Candidate {
        let stencil: Vec<(f64, f64)> =
            (0..25).map(|i| (f64::from(i % 5 - 2) * FIT_STEP_CELLS, f64::from(i / 5 - 2) * FIT_STEP_CELLS)).collect();
        let criterion = |&(c, r): &(f64, f64)| {
            let candidate = self.candidate(samples, minimum.columns + c, minimum.rows + r);
            candidate.score.powi(2)
        };
        let values: Vec<f64> = stencil.par_iter().map(criterion).collect();
        let Some((columns, rows)) = vertex(&stencil, &values) else { return minimum };
        let levelled = self.candidate(samples, minimum.columns + columns, minimum.rows + rows);
        if levelled.score <= CLEARLY_BETTER * minimum.score { levelled } else { minimum }
    }
}

const COMPASS: [(f64, f64); 8] =
    [(0.0, -1.0), (-1.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];

/// Returns the minimum of the paraboloid fitted to values at shifts, or `None` if it has no minimum
/// within the outermost shifts.
fn vertex(places: &[(f64, f64)], values: &[f64]) -> Option<(f64, f64)> {
    let mut normal = nalgebra::Matrix6::<f64>::zeros();
    let mut right = nalgebra::Vector6::<f64>::zeros();
    for (&(u, v), &value) in places.iter().zip(values) {
        let terms = nalgebra::Vector6::new(1.0, u, v, u * u, u * v, v * v);
        normal += terms * terms.transpose();
        right += terms * value;
    }
    let [_, u, v, uu, uv, vv]: [f64; 6] = normal.cholesky()?.solve(&right).into();
    let det = 4.0 * uu * vv - uv * uv;
    if !(uu > 0.0 && det > 0.0) {
        return None;
    }
    let (columns, rows) = ((uv * v - 2.0 * vv * u) / det, (uv * u - 2.0 * uu * v) / det);
    (columns.abs().max(rows.abs()) <= 2.0 * FIT_STEP_CELLS).then_some((columns, rows))
}

/// Returns the second of two candidates if it is strictly better, the first otherwise.
fn better(a: Candidate, b: Candidate) -> Candidate {
    if b.score < a.score { b } else { a }
}

/// Returns the candidates that overlap enough, best first. Equal ones keep their order (shortest
/// shift first).
fn ranked(mut candidates: Vec<Candidate>) -> Vec<Candidate> {
    let most = candidates.iter().map(|c| c.n).max().unwrap_or(0);
    candidates.retain(|c| c.n > 0 && c.n as f64 >= LEAST_OVERLAP * most as f64);
    candidates.sort_by(|a, b| a.score.total_cmp(&b.score));
    candidates
}

/// Returns the score of the middle candidate divided by the first; 1 if every shift fits equally.
pub(crate) fn contrast(ranked: &[Candidate]) -> f64 {
    match (ranked.first(), ranked.get(ranked.len() / 2)) {
        (Some(first), Some(middle)) if first.score > 0.0 => middle.score / first.score,
        (Some(_), Some(middle)) if middle.score > 0.0 => f64::MAX,
        _ => 1.0,
    }
}

/// Returns whether a neighbour of the whole-cell shift was not searched.
pub(crate) fn at_edge(steps: &[(i32, i32)], start: Candidate) -> bool {
    let (column, row) = (start.columns as i32, start.rows as i32);
    [(0, -1), (-1, 0), (1, 0), (0, 1)].iter().any(|(c, r)| !steps.contains(&(column + c, row + r)))
}

/// Picks at most `count` of the cells: one from each of `count` equal runs. A hash chooses the
/// place within the run, so that no stride falls in step with the columns.
fn stratified(cells: &[usize], count: usize) -> impl Iterator<Item = usize> {
    let count = count.min(cells.len());
    let bound = move |k: usize| (k as u128 * cells.len() as u128 / count as u128) as usize;
    let pick = move |k: usize| bound(k) + (hash64(k as u64) % (bound(k + 1) - bound(k)).max(1) as u64) as usize;
    (0..count).filter_map(move |k| cells.get(pick(k)).copied())
}
