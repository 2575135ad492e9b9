//! One surface against another: alignment, then errors over all cells and per class.

use crate::align::{Alignment, MetresFromCells, Shift};
use crate::cell_map::CellMap;
use crate::error::EvalError;
use crate::metrics::Metrics;
use crate::resample::bilinear;
use crate::search::{Search, SearchSummary};
use crate::statistics::percentile;
use raster::Grid;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// What to compare. Heights are metres above the same vertical datum, cells that are not finite are void.
#[derive(Debug, Clone, Copy)]
pub struct EvalInput<'a> {
    /// The surface that is evaluated.
    pub test: &'a Grid<f32>,
    /// The surface that is believed; errors are measured at its cells.
    pub reference: &'a Grid<f32>,
    /// Where the reference's cells lie in the test grid. For [`Alignment::Xyz`] it must hold as far outside the reference as
    /// the search reaches.
    pub test_from_reference: &'a CellMap,
    /// The size of the reference's cells.
    pub metres_from_cells: MetresFromCells,
    /// The class of each reference cell, on the reference grid; `None` where there is none.
    pub classes: Option<&'a Grid<Option<i32>>>,
}

/// How to compare.
#[derive(Debug, Clone, PartialEq)]
pub struct EvalConfig {
    /// What is removed first.
    pub alignment: Alignment,
    /// Radius of the horizontal search, metres.
    pub search_m: f64,
    /// Thresholds of `completeness_<t>` and `pag_<t>`, metres.
    pub thresholds_m: Vec<f64>,
    /// Classes whose cells are left out of everything, the alignment too.
    pub skip: Vec<i32>,
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self { alignment: Alignment::Xyz, search_m: 5.0, thresholds_m: vec![0.5, 1.0, 2.5, 7.5], skip: Vec::new() }
    }
}

/// The metrics of one class.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassMetrics {
    /// The class.
    pub class: i32,
    /// What was measured on its cells.
    pub metrics: Metrics,
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// The translation that was added to the test surface.
    pub shift: Shift,
    /// How the horizontal part was found; `None` without a search.
    pub search: Option<SearchSummary>,
    /// Over all cells that are not skipped.
    pub overall: Metrics,
    /// Per class, in rising order; empty without classes.
    pub classes: Vec<ClassMetrics>,
    /// Valid cells of the reference that were left out because of their class.
    pub skipped_cells: usize,
    /// Test − reference after the alignment, metres, on the reference grid; NaN where either is void, or skipped.
    pub errors: Grid<f32>,
}

/// Aligns the test surface with the reference and measures its errors.
///
/// # Errors
/// When the settings are unusable, the reference is empty, the two share no cell, or the class grid has another shape.
pub fn evaluate(input: &EvalInput<'_>, config: &EvalConfig) -> Result<Evaluation, EvalError> {
    check(input, config)?;
    let reference = without_skipped(input, &config.skip);
    let valid = |grid: &Grid<f32>| grid.data().iter().filter(|h| h.is_finite()).count();
    let reference_cells = valid(&reference);
    let skipped_cells = valid(input.reference) - reference_cells;
    if reference_cells == 0 {
        return Err(EvalError::EmptyReference { skipped: skipped_cells });
    }
    let input = EvalInput { reference: &reference, ..*input };
    let (cells, search) = horizontal_shift(&input, config)?;
    let mut errors = differences(&input, cells);
    let mut common = finite(&errors);
    let offset = percentile(&mut common, 50.0).ok_or(EvalError::NoOverlap { reference_cells })?;
    let (dx_m, dy_m) = input.metres_from_cells.apply(cells.0, cells.1);
    let mut shift = Shift { dx_m, dy_m, dz_m: 0.0 };
    if config.alignment != Alignment::None {
        shift.dz_m = 0.0 - offset;
        errors.data_mut().iter_mut().for_each(|e| *e -= offset);
    }
    Ok(Evaluation {
        shift,
        search,
        overall: Metrics::of(&mut finite(&errors), reference_cells, &config.thresholds_m),
        classes: per_class(&input, &errors, &config.thresholds_m),
        skipped_cells,
        errors: errors.map(|&e| e as f32),
    })
}

fn check(input: &EvalInput<'_>, config: &EvalConfig) -> Result<(), EvalError> {
    let positive = |name, value: f64| {
        if value.is_finite() && value > 0.0 { Ok(()) } else { Err(EvalError::NotPositive { name, value }) }
    };
    config.thresholds_m.iter().try_for_each(|&t| positive("a threshold", t))?;
    positive("the search radius", config.search_m)?;
    let (width, height) = (input.reference.width(), input.reference.height());
    match input.classes {
        None if !config.skip.is_empty() => Err(EvalError::SkipWithoutClasses),
        Some(classes) if (classes.width(), classes.height()) != (width, height) => {
            Err(EvalError::ClassShape { found_width: classes.width(), found_height: classes.height(), width, height })
        }
        _ => Ok(()),
    }
}

/// The reference with its skipped cells void.
fn without_skipped(input: &EvalInput<'_>, skip: &[i32]) -> Grid<f32> {
    let mut reference = input.reference.clone();
    if let Some(classes) = input.classes {
        for (height, class) in reference.data_mut().iter_mut().zip(classes.data()) {
            if class.is_some_and(|class| skip.contains(&class)) {
                *height = f32::NAN;
            }
        }
    }
    reference
}

fn horizontal_shift(
    input: &EvalInput<'_>,
    config: &EvalConfig,
) -> Result<((f64, f64), Option<SearchSummary>), EvalError> {
    if config.alignment != Alignment::Xyz {
        return Ok(((0.0, 0.0), None));
    }
    let search = Search {
        reference: input.reference,
        test: input.test,
        test_from_reference: input.test_from_reference,
        metres_from_cells: input.metres_from_cells,
    };
    let (cells, summary) = search.run(config.search_m)?;
    Ok((cells, Some(summary)))
}

/// Test − reference at every reference cell, the test moved by `shift` reference cells; NaN where either is void.
fn differences(input: &EvalInput<'_>, shift: (f64, f64)) -> Grid<f64> {
    let mut errors = Grid::filled(input.reference.width(), input.reference.height(), f64::NAN);
    let width = input.reference.width().max(1);
    errors.data_mut().par_chunks_mut(width).zip(input.reference.data().par_chunks(width)).enumerate().for_each(
        |(row, (errors, heights))| {
            for (column, (error, &height)) in errors.iter_mut().zip(heights).enumerate() {
                if height.is_finite() {
                    let (x, y) = input.test_from_reference.position(column as f64 - shift.0, row as f64 - shift.1);
                    *error = bilinear(input.test, x, y).map_or(f64::NAN, |test| test - f64::from(height));
                }
            }
        },
    );
    errors
}

fn finite(errors: &Grid<f64>) -> Vec<f64> {
    errors.data().iter().copied().filter(|e| e.is_finite()).collect()
}

fn per_class(input: &EvalInput<'_>, errors: &Grid<f64>, thresholds_m: &[f64]) -> Vec<ClassMetrics> {
    let Some(classes) = input.classes else { return Vec::new() };
    let mut cells: BTreeMap<i32, (usize, Vec<f64>)> = BTreeMap::new();
    for ((height, class), error) in input.reference.data().iter().zip(classes.data()).zip(errors.data()) {
        if let (true, Some(class)) = (height.is_finite(), class) {
            let (count, errors) = cells.entry(*class).or_default();
            *count += 1;
            errors.extend(error.is_finite().then_some(error));
        }
    }
    let metrics = |(class, (count, mut errors)): (i32, (usize, Vec<f64>))| ClassMetrics {
        class,
        metrics: Metrics::of(&mut errors, count, thresholds_m),
    };
    cells.into_iter().map(metrics).collect()
}
