//! Horizontal translation between two surfaces from their slopes (Nuth and Kääb 2011, The
//! Cryosphere 5, 271-290, eq. 2-4).
//!
//! A surface that is displaced by d differs from the reference by dh = −d · ∇h + dz. Divided by the
//! tangent of the slope, dh is a cosine of the aspect. Its amplitude and phase are the
//! displacement. As in the paper, the differences are collected in bins of 5° of the aspect, a
//! cosine is fitted to the medians of the bins (weighted by their cells), and the fit is repeated
//! on the corrected surface until nothing changes.
//!
//! The relation holds while the displacement is smaller than the forms of the ground. So the
//! differences are first reduced to cells as large as the search radius, where a town is a few
//! hills. The shift is then refined level by level down to the cells of the reference. The method
//! needs slopes in more than one direction. [`EvalError::TooFlat`] and [`EvalError::OneWaySlopes`]
//! report where they are missing. Both are measured at the coarsest level, where noise adds no
//! slope.

use crate::alignment::align::MetresFromCells;
use crate::error::EvalError;
use crate::measures::gradient::{gradients, steepness};
use numeric::{percentile, upper_nmad};
use raster::{Grid, reduce};
use serde::Serialize;

/// Number of bins of the aspect, as in the paper.
const BINS: usize = 72;
/// Lowest slope that is used, degrees.
const STEEP_DEG: f64 = 3.0;
/// Lowest share of steep cells at the coarsest level.
const LEAST_STEEP_SHARE: f64 = 0.02;
/// Lowest number of steep cells that are valid in both surfaces.
const LEAST_CELLS: usize = 50;
/// Lowest number of cells of a bin.
const LEAST_PER_BIN: usize = 5;
/// Lowest ratio of the squared axes of the normal matrix. Below it the slopes face one way.
const LEAST_AXES: f64 = 0.02;
/// Lowest number of cells on the shorter side of a level.
const LEAST_SIDE: usize = 24;
/// Highest number of iterations per level.
const MOST_ITERATIONS: usize = 12;
/// Step at which the iterations of a level end, in cells of the level.
const LAST_STEP_CELLS: f64 = 0.004;

/// Summary of the method of Nuth and Kääb.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NuthKaabSummary {
    /// Number of reductions to the coarsest level.
    pub levels: usize,
    /// Number of corrections.
    pub iterations: usize,
    /// Share of the cells at the coarsest level that are steep enough.
    pub steep_share: f64,
    /// Length of the last correction, metres.
    pub last_step_m: f64,
    /// Whether the corrections converged and lowered the NMAD.
    pub converged: bool,
    /// NMAD of the differences before the alignment, metres.
    pub nmad_before_m: f64,
    /// NMAD of the differences after the alignment, metres.
    pub nmad_after_m: f64,
}

/// Input of the method.
pub(crate) struct NuthKaab<'a> {
    pub(crate) reference: &'a Grid<f32>,
    pub(crate) metres_from_cells: MetresFromCells,
    /// Returns test − reference for a shift of the test in reference cells.
    pub(crate) differences: &'a dyn Fn((f64, f64)) -> Grid<f32>,
}

/// Gradients of the reference on one level.
struct Level {
    slopes: Grid<[f32; 2]>,
    cell_m: f64,
}

impl NuthKaab<'_> {
    /// Returns the shift, in reference cells, that is added to the test surface.
    pub(crate) fn run(&self, search_m: f64) -> Result<((f64, f64), NuthKaabSummary), EvalError> {
        let levels = self.levels(search_m);
        let before = (self.differences)((0.0, 0.0));
        let steep_share = steep_share(&levels, &before)?;
        let mut shift_m = (0.0, 0.0);
        let (mut iterations, mut last_step_m, mut settled) = (0, f64::INFINITY, false);
        for (number, level) in levels.iter().enumerate().rev() {
            settled = false;
            for _ in 0..MOST_ITERATIONS {
                let differences = (self.differences)(self.metres_from_cells.cells(shift_m.0, shift_m.1));
                let step = level.step(&reduced(differences, number))?;
                shift_m = (shift_m.0 + step.0, shift_m.1 + step.1);
                iterations += 1;
                last_step_m = step.0.hypot(step.1);
                settled = last_step_m < LAST_STEP_CELLS * level.cell_m;
                if settled {
                    break;
                }
            }
        }
        let cells = self.metres_from_cells.cells(shift_m.0, shift_m.1);
        let (nmad_before_m, nmad_after_m) = (nmad(&before), nmad(&(self.differences)(cells)));
        let converged = settled && nmad_after_m <= nmad_before_m;
        let levels = levels.len() - 1;
        let summary =
            NuthKaabSummary { levels, iterations, steep_share, last_step_m, converged, nmad_before_m, nmad_after_m };
        Ok((cells, summary))
    }

    /// Returns the levels, finest first, up to cells of the search radius.
    fn levels(&self, search_m: f64) -> Vec<Level> {
        let (along_columns, along_rows) = self.metres_from_cells.cell_size_m();
        let mut heights = self.reference.clone();
        let mut scale = 1.0;
        let mut levels = Vec::new();
        loop {
            let cell_m = scale * along_columns.max(along_rows);
            levels.push(Level { slopes: gradients(&heights, self.metres_from_cells.scaled(scale)), cell_m });
            if cell_m >= search_m || heights.width().min(heights.height()) < 2 * LEAST_SIDE {
                return levels;
            }
            heights = reduce(&heights);
            scale *= 2.0;
        }
    }
}

fn reduced(grid: Grid<f32>, times: usize) -> Grid<f32> {
    (0..times).fold(grid, |grid, _| reduce(&grid))
}

fn is_steep(slope: [f32; 2]) -> bool {
    steepness(slope) >= STEEP_DEG.to_radians().tan()
}

/// Returns the share of steep cells among the cells of the coarsest level that are valid in both.
fn steep_share(levels: &[Level], differences: &Grid<f32>) -> Result<f64, EvalError> {
    let Some(coarsest) = levels.last() else { return Ok(0.0) };
    let differences = reduced(differences.clone(), levels.len() - 1);
    let cells = coarsest.slopes.data().iter().zip(differences.data());
    let (mut all, mut steep) = (0usize, 0usize);
    for (slope, _) in cells.filter(|(slope, d)| d.is_finite() && slope[0].is_finite()) {
        all += 1;
        steep += usize::from(is_steep(*slope));
    }
    let share = steep as f64 / all.max(1) as f64;
    if steep < LEAST_CELLS || share < LEAST_STEEP_SHARE {
        let cell_m = coarsest.cell_m;
        return Err(EvalError::TooFlat { share, needed: LEAST_STEEP_SHARE, slope_deg: STEEP_DEG, cell_m });
    }
    Ok(share)
}

impl Level {
    /// Returns the shift, in metres along x and y, that fits the differences.
    fn step(&self, differences: &Grid<f32>) -> Result<(f64, f64), EvalError> {
        let mut all: Vec<f64> = differences.data().iter().map(|&d| f64::from(d)).filter(|d| d.is_finite()).collect();
        let offset = percentile(&mut all, 50.0).unwrap_or(0.0);
        let mut bins: Vec<Vec<f64>> = vec![Vec::new(); BINS];
        for (&slope, &difference) in self.slopes.data().iter().zip(differences.data()) {
            if difference.is_finite() && is_steep(slope) {
                let direction = f64::from(slope[1]).atan2(f64::from(slope[0])).rem_euclid(std::f64::consts::TAU);
                let bin = (direction / std::f64::consts::TAU * BINS as f64) as usize;
                if let Some(bin) = bins.get_mut(bin.min(BINS - 1)) {
                    bin.push((f64::from(difference) - offset) / steepness(slope));
                }
            }
        }
        let step = cosine(&mut bins)?;
        // The relation is linear only within about one cell of the level.
        let most = (1.5 * self.cell_m / step.0.hypot(step.1)).min(1.0);
        Ok((step.0 * most, step.1 * most))
    }
}

/// Fits `A cos + B sin + C` to the medians of the bins. (A, B) is the shift that undoes the
/// displacement.
fn cosine(bins: &mut [Vec<f64>]) -> Result<(f64, f64), EvalError> {
    let count = bins.len() as f64;
    let mut normal = nalgebra::Matrix3::<f64>::zeros();
    let mut right = nalgebra::Vector3::<f64>::zeros();
    for (i, bin) in bins.iter_mut().enumerate().filter(|(_, bin)| bin.len() >= LEAST_PER_BIN) {
        let weight = bin.len() as f64;
        let Some(median) = percentile(bin, 50.0) else { continue };
        let (sin, cos) = ((i as f64 + 0.5) / count * std::f64::consts::TAU).sin_cos();
        let terms = nalgebra::Vector3::new(cos, sin, 1.0);
        normal += weight * terms * terms.transpose();
        right += weight * median * terms;
    }
    let axes = normal.fixed_view::<2, 2>(0, 0).into_owned().symmetric_eigenvalues();
    if axes.min() < LEAST_AXES * axes.max() {
        return Err(EvalError::OneWaySlopes);
    }
    let solved = normal.cholesky().ok_or(EvalError::OneWaySlopes)?.solve(&right);
    Ok((solved[0], solved[1]))
}

fn nmad(differences: &Grid<f32>) -> f64 {
    let mut finite: Vec<f32> = differences.data().iter().copied().filter(|d| d.is_finite()).collect();
    upper_nmad(&mut finite).unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cosine_gives_its_displacement_whatever_the_outliers() {
        let mut bins: Vec<Vec<f64>> = (0..BINS)
            .map(|i| {
                let direction = (i as f64 + 0.5) / BINS as f64 * std::f64::consts::TAU;
                let value = 1.5 * direction.cos() - 0.5 * direction.sin() + 0.2;
                (0..20).map(|k| if k % 4 == 0 { 100.0 * (k as f64 - 8.0) } else { value }).collect()
            })
            .collect();
        let (a, b) = cosine(&mut bins).unwrap();
        assert!((a - 1.5).abs() < 1e-9 && (b + 0.5).abs() < 1e-9, "{a} {b}");
    }

    #[test]
    fn slopes_that_face_one_way_are_refused() {
        let mut bins = vec![Vec::new(); BINS];
        bins[10] = vec![1.0; 30];
        bins[46] = vec![-1.0; 30];
        assert!(matches!(cosine(&mut bins), Err(EvalError::OneWaySlopes)));
        assert!(matches!(cosine(&mut vec![Vec::new(); BINS]), Err(EvalError::OneWaySlopes)));
    }
}
