//! The search for regions of significant change.

use raster::Grid;
use serde::Serialize;

use crate::border::near_border;
use crate::config::ChangeConfig;
use crate::correlation::{ErrorCorrelation, spread};
use crate::error::{ChangeError, Reason};
use crate::normal::{ln_two_sided, two_sided_quantile};
use crate::regions::{NONE, connected, grow, without_lines};
use crate::tolerance::unexplained;
use crate::walls::perimeter;

/// Fewest cells that are observed in both surfaces.
const CELLS_MIN: usize = 400;
/// Growth of the number of connected shapes with their cells, for cells that touch at sides or
/// corners: polyplets grow by less than this for each cell.
const SHAPES_GROWTH: f64 = 7.0;
/// Share of the mean change of a region from which a cell beside it belongs to its ramp.
const RAMP_SHARE: f32 = 0.25;
/// Share of the mean change of a region from which a filled cell belongs to it.
const FILLED_SHARE: f32 = 0.5;
/// Least probability that both heights of a cell are right from which the cell decides: it is
/// rather right than wrong.
const RATHER_RIGHT: f32 = 0.5;
/// Least share of a region that must be observed on both dates, and least share of what is observed
/// that must decide. The other cells follow them.
const MOSTLY: f64 = 0.5;
/// Smallest standard deviation of a difference, metres: what f32 keeps of heights on mountains.
const SIGMA_MIN_M: f32 = 0.001;

/// Two surfaces on one grid of square cells.
#[derive(Debug, Clone, Copy)]
pub struct ChangeInput<'a> {
    /// Heights of the first date, metres; NaN where there is none.
    pub before: &'a Grid<f32>,
    /// Heights of the second date, metres, above the same datum.
    pub after: &'a Grid<f32>,
    /// Standard deviation of the difference of two cells, metres. Cells without a finite one take
    /// the median of the others. Without the raster it follows from the differences alone.
    pub sigma: Option<&'a Grid<f32>>,
    /// Whether a cell was observed on both dates. Only such cells decide; others may join a region
    /// that surrounds them. Without the raster all cells with two heights were.
    pub observed: Option<&'a Grid<bool>>,
    /// Probability that both heights of a cell are right, 0 to 1; NaN where nothing is known of it.
    /// Cells that are rather wrong decide nothing, others count by their probability. Without the
    /// raster all cells count alike.
    pub probability: Option<&'a Grid<f32>>,
    /// Side of a cell, metres.
    pub cell_m: f64,
}

/// A region of significant change.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct ChangeRegion {
    /// Cells with a difference, as indices into the rasters; the ramps at the borders included.
    #[serde(skip)]
    pub cells: Vec<usize>,
    /// Area of these cells, square metres.
    pub area_m2: f64,
    /// The part of the area whose cells decided: observed on both dates, rather right than wrong,
    /// and not at the border of a surface, square metres.
    pub decided_m2: f64,
    /// The part of the area that was not observed on both dates, and has filled heights, square
    /// metres.
    pub filled_m2: f64,
    /// Cells beyond the level of detection whose errors are independent of each other: what the
    /// mean and its test rest on.
    pub independent_cells: f64,
    /// Mean probability that both heights of these cells are right, 0 to 1; 1 where nothing states
    /// it.
    pub probability: f64,
    /// Mean change of the cells that are beyond the level of detection by their probability,
    /// metres.
    pub mean_m: f64,
    /// Standard deviation of this mean, metres, with the correlation of the errors.
    pub mean_sigma_m: f64,
    /// Largest change in the direction of the mean, metres.
    pub extreme_m: f64,
    /// Length of the border, metres, where the change falls through half of its mean.
    pub border_m: f64,
    /// Volume over all cells without the overreach of walls, cubic metres; negative for a loss.
    pub volume_m3: f64,
    /// Its standard deviation, cubic metres.
    pub volume_sigma_m3: f64,
    /// Volume that was taken off for the overreach of walls, cubic metres, with the sign of the
    /// change.
    pub overreach_m3: f64,
    /// The part of the deviation that the walls are the reason of, cubic metres.
    pub wall_sigma_m3: f64,
    /// Probability that a scene without change has such a region anywhere, at most 1. It may be 0
    /// where no number is small enough.
    pub p_value: f64,
}

/// Change between two surfaces.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Change {
    /// After − before, metres; NaN where either has no height.
    pub difference: Grid<f32>,
    /// Calibrated standard deviation of the difference, metres.
    pub sigma: Grid<f32>,
    /// Difference in deviations; NaN where the cell decides nothing: it was not observed on both
    /// dates, is rather wrong than right, or lies at the border of a surface.
    pub significance: Grid<f32>,
    /// Number of the region of each cell, from 1; 0 is none.
    pub numbers: Grid<u32>,
    /// The regions, by their numbers.
    pub regions: Vec<ChangeRegion>,
    /// Factor by which the given deviations were multiplied, at least 1; where none are given, the
    /// deviation that was measured, metres.
    pub sigma_factor: f64,
    /// Correlation of the errors of two cells.
    pub correlation: ErrorCorrelation,
    /// Median of the level of detection of the cells, metres.
    pub detection_m: f64,
    /// Cells observed on both dates.
    pub observed_cells: usize,
    /// Those of them that decide.
    pub deciding_cells: usize,
    /// Candidates that were tested: regions large and strong enough.
    pub tested: usize,
    /// Deviation of a scene-wide offset of the heights, metres.
    pub offset_sigma_m: f64,
}

impl Change {
    /// Returns the standard deviation of the mean difference of cells, metres: `variance_m2` is the
    /// sum of their variances. It holds the deviation of the offset of all heights.
    pub(crate) fn mean_sigma_m(&self, cells: usize, variance_m2: f64) -> f64 {
        if cells == 0 {
            return 0.0;
        }
        let area_m2 = cells as f64 * self.correlation.cell_area_m2;
        self.sigma_of_mean_m(variance_m2 / cells as f64, self.correlation.effective_cells(area_m2))
    }

    /// Returns the same from the mean of the variances and the number of cells whose errors are
    /// independent.
    fn sigma_of_mean_m(&self, variance_m2: f64, independent_cells: f64) -> f64 {
        (variance_m2 / independent_cells + self.offset_sigma_m.powi(2)).sqrt()
    }
}

/// Finds the regions that changed significantly between two surfaces.
///
/// ```
/// use change::{ChangeConfig, ChangeInput, detect};
/// use raster::Grid;
///
/// let before = Grid::from_vec(80, 60, (0..4800u32).map(|i| (i * 7919 % 101) as f32 * 0.002).collect()).unwrap();
/// let mut after = before.map(|h| 0.2 - h);
/// for row in 20..35 {
///     after.row_mut(row)[30..50].fill(6.0);
/// }
/// let input = ChangeInput { before: &before, after: &after, sigma: None, observed: None, probability: None,
///     cell_m: 0.5 };
/// let found = detect(&input, &ChangeConfig::default())?;
/// assert_eq!(found.regions.len(), 1);
/// assert!((found.regions[0].volume_m3 - 6.0 * 75.0).abs() < 20.0);
/// # Ok::<(), change::ChangeError>(())
/// ```
///
/// # Errors
/// [`ChangeError`] for a parameter outside of its range, for rasters of different sizes, and
/// without an overlap.
pub fn detect(input: &ChangeInput<'_>, config: &ChangeConfig) -> Result<Change, ChangeError> {
    config.validate()?;
    check(input)?;
    let mut change = calibrated(input, config)?;
    let reach = (config.position_m / input.cell_m).round() as usize;
    let observed_only = |grid: &Grid<f32>| grid.without(|at| !is_observed(input, at));
    let left = unexplained(&observed_only(input.before), &observed_only(input.after), reach);
    let deviations = two_sided_quantile(1.0 - config.confidence) as f32;
    let mut signs = Grid::filled(left.width(), left.height(), 0i8);
    for (at, sign) in signs.data_mut().iter_mut().enumerate() {
        if !change.significance.data()[at].is_finite() {
            continue;
        }
        let (left, limit) = (left.data()[at], deviations * change.sigma.data()[at]);
        // A cell below the least change may be part of a region whose mean is above it.
        if left.abs() > limit.max(0.5 * config.least_change_m as f32) {
            *sign = if left > 0.0 { 1 } else { -1 };
        }
    }
    let signs = without_lines(&signs);
    let mut levels: Vec<f64> =
        change.sigma.data().iter().filter(|s| s.is_finite()).map(|s| f64::from(*s * deviations)).collect();
    change.detection_m = numeric::percentile(&mut levels, 50.0).unwrap_or(0.0);
    let candidates = connected(&signs);
    // The errors are those of the cells that stand out nowhere.
    let mut stable = change.significance.clone();
    candidates.iter().flatten().for_each(|at| stable.data_mut()[*at] = f32::NAN);
    change.correlation = ErrorCorrelation::measure(&stable, input.cell_m);
    let mean_variance = mean_square(&change.sigma);
    let deciding_m2 = change.deciding_cells as f64 * change.correlation.cell_area_m2;
    change.offset_sigma_m = (mean_variance / change.correlation.effective_cells(deciding_m2)).sqrt();
    let places = change.correlation.effective_cells(deciding_m2).ln();
    for cells in candidates {
        take_region(&mut change, input, config, cells, places);
    }
    Ok(change)
}

/// Tests a candidate, and adds it to the regions with its ramps and filled cells if it is
/// significant. `places` is the logarithm of the number of independent cells of the scene.
fn take_region(
    change: &mut Change,
    input: &ChangeInput<'_>,
    config: &ChangeConfig,
    cells: Vec<usize>,
    places: f64,
) -> Option<()> {
    let cell_area_m2 = change.correlation.cell_area_m2;
    let area_m2 = cells.len() as f64 * cell_area_m2;
    let sum = |cells: &[usize], of: &dyn Fn(usize) -> f64| -> f64 { cells.iter().map(|at| of(*at)).sum() };
    let weight = |at: usize| probability_at(input, at);
    let weights = sum(&cells, &weight);
    let mean_m = sum(&cells, &|at| weight(at) * f64::from(change.difference.data()[at])) / weights;
    if area_m2 < config.least_area_m2 || mean_m.abs() < config.least_change_m {
        return None;
    }
    change.tested += 1;
    let variance_m2 = |cells: &[usize]| sum(cells, &|at| f64::from(change.sigma.data()[at]).powi(2));
    let independent_cells = change.correlation.effective_cells(weights * cell_area_m2);
    let mean_sigma_m = change.sigma_of_mean_m(variance_m2(&cells) / cells.len() as f64, independent_cells);
    let shapes = (change.correlation.effective_cells(area_m2) - 1.0) * SHAPES_GROWTH.ln();
    let ln_p = ln_two_sided(mean_m / mean_sigma_m) + places + shapes;
    if ln_p > (1.0 - config.confidence).ln() {
        return None;
    }
    let number = change.regions.len() as u32 + 1;
    cells.iter().for_each(|at| change.numbers.data_mut()[*at] = number);
    let along = |at: usize| change.difference.data()[at] * mean_m.signum() as f32;
    let decides = |at: usize| change.significance.data()[at].is_finite();
    let ramp = (2.0 * config.position_m / input.cell_m).round() as usize;
    let (least_ramp, least_filled) = (RAMP_SHARE * mean_m.abs() as f32, FILLED_SHARE * mean_m.abs() as f32);
    let joins = |at: usize| along(at) > if is_observed(input, at) { least_ramp } else { least_filled };
    let gained = grow(&mut change.numbers, &cells, number, ramp, joins);
    let seeds = cells.len();
    let all: Vec<usize> = cells.into_iter().chain(gained).collect();
    let counted = |counts: &dyn Fn(usize) -> bool| all.iter().filter(|at| counts(**at)).count() as f64 * cell_area_m2;
    let (all_m2, decided_m2) = (all.len() as f64 * cell_area_m2, counted(&decides));
    let filled_m2 = counted(&|at| !is_observed(input, at));
    let observed_m2 = all_m2 - filled_m2;
    if observed_m2 < MOSTLY * all_m2 || decided_m2 < MOSTLY * observed_m2 {
        all.iter().for_each(|at| change.numbers.data_mut()[*at] = NONE);
        return None;
    }
    let extreme = all.iter().take(seeds).map(|at| along(*at)).fold(0.0, f32::max);
    let half = 0.5 * mean_m.abs() as f32;
    let core: Vec<usize> = all.iter().copied().filter(|at| along(*at) > half).collect();
    let border_m = perimeter(&core, change.difference.width()) * input.cell_m;
    let difference = |at: usize| f64::from(change.difference.data()[at]);
    let step_m = sum(&core, &difference) / core.len().max(1) as f64;
    let raw_m3 = sum(&all, &difference) * cell_area_m2;
    // A wall that lies inwards cannot turn a gain into a loss.
    let overreach_m3 = (config.overreach_of_m(step_m.abs()) * border_m * step_m / raw_m3).min(0.9) * raw_m3;
    let wall_sigma_m3 = config.overreach_sigma_m * border_m * step_m.abs();
    let noise_m3 = change.mean_sigma_m(all.len(), variance_m2(&all)) * all_m2;
    change.regions.push(ChangeRegion {
        cells: all,
        area_m2: all_m2,
        decided_m2,
        filled_m2,
        independent_cells,
        probability: weights / seeds as f64,
        mean_m,
        mean_sigma_m,
        extreme_m: f64::from(extreme) * mean_m.signum(),
        border_m,
        volume_m3: raw_m3 - overreach_m3,
        volume_sigma_m3: noise_m3.hypot(wall_sigma_m3),
        overreach_m3,
        wall_sigma_m3,
        p_value: ln_p.exp().min(1.0),
    });
    Some(())
}

/// Returns whether a cell was observed on both dates.
fn is_observed(input: &ChangeInput<'_>, at: usize) -> bool {
    input.observed.is_none_or(|observed| observed.data()[at])
}

/// Returns the probability that both heights of a cell are right; 1 where nothing states it.
fn probability_at(input: &ChangeInput<'_>, at: usize) -> f64 {
    let stated = input.probability.map(|probability| probability.data()[at]);
    stated.filter(|probability| probability.is_finite()).map_or(1.0, f64::from)
}

/// Makes the rasters of differences with calibrated deviations; regions and correlation come later.
fn calibrated(input: &ChangeInput<'_>, config: &ChangeConfig) -> Result<Change, Reason> {
    let (width, height) = (input.before.width(), input.before.height());
    let difference = input.after.zip_map(input.before, |after, before| after - before);
    let usual = input.sigma.and_then(|sigma| {
        let mut known: Vec<f32> = sigma.data().iter().copied().filter(|s| s.is_finite() && *s > 0.0).collect();
        numeric::upper_median(&mut known)
    });
    let at_border = near_border(&difference, (2.0 * config.position_m / input.cell_m).round() as usize);
    let mut sigma = Grid::filled(width, height, f32::NAN);
    let (mut significance, mut observed_cells) = (sigma.clone(), 0);
    for at in (0..width * height).filter(|at| difference.data()[*at].is_finite()) {
        let given = input.sigma.map(|sigma| sigma.data()[at]).filter(|s| s.is_finite() && *s > 0.0);
        let own = given.or(usual).unwrap_or(1.0).max(SIGMA_MIN_M);
        sigma.data_mut()[at] = own;
        let observed = is_observed(input, at);
        observed_cells += usize::from(observed);
        if observed && !at_border.data()[at] && probability_at(input, at) >= f64::from(RATHER_RIGHT) {
            significance.data_mut()[at] = difference.data()[at] / own;
        }
    }
    let deciding_cells = significance.data().iter().filter(|z| z.is_finite()).count();
    if deciding_cells < CELLS_MIN {
        return Err(Reason::TooFewCells { found: deciding_cells, observed: observed_cells, needed: CELLS_MIN });
    }
    // Identical surfaces have no spread; the least deviation keeps them apart from a division by 0.
    // The spread is that of the many good cells. It does not show that stated deviations are too
    // large where cells are weak, so it makes none smaller.
    let least = if input.sigma.is_some() { 1.0 } else { 1e-3 };
    let factor = spread(&significance).max(least);
    sigma.data_mut().iter_mut().for_each(|s| *s = (*s * factor as f32).max(SIGMA_MIN_M));
    for (z, (d, s)) in significance.data_mut().iter_mut().zip(difference.data().iter().zip(sigma.data())) {
        *z = if z.is_finite() { d / s } else { f32::NAN };
    }
    let correlation = ErrorCorrelation::measure(&significance, input.cell_m);
    Ok(Change {
        difference,
        sigma,
        significance,
        numbers: Grid::filled(width, height, NONE),
        regions: Vec::new(),
        sigma_factor: factor,
        correlation,
        detection_m: 0.0,
        observed_cells,
        deciding_cells,
        tested: 0,
        offset_sigma_m: 0.0,
    })
}

fn mean_square(grid: &Grid<f32>) -> f64 {
    let known = || grid.data().iter().filter(|s| s.is_finite());
    known().map(|s| f64::from(*s).powi(2)).sum::<f64>() / known().count().max(1) as f64
}

fn check(input: &ChangeInput<'_>) -> Result<(), Reason> {
    let expected = (input.before.width(), input.before.height());
    let fits = |what, found: Option<(usize, usize)>| match found {
        Some(found) if found != expected => Err(Reason::Size { what, found, expected }),
        _ => Ok(()),
    };
    fits("the second surface", Some((input.after.width(), input.after.height())))?;
    fits("the raster of deviations", input.sigma.map(|grid| (grid.width(), grid.height())))?;
    fits("the raster of observed cells", input.observed.map(|grid| (grid.width(), grid.height())))?;
    fits("the raster of probabilities", input.probability.map(|grid| (grid.width(), grid.height())))?;
    if !(input.cell_m.is_finite() && input.cell_m > 0.0) {
        let (name, expected) = ("the side of a cell", "a positive number of metres");
        return Err(Reason::Parameter { name, found: input.cell_m, expected });
    }
    Ok(())
}
