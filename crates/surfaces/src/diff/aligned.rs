//! The two surfaces on one grid: read, co-registered, with deviations and observed cells.

use eval::{AlignmentMethod, CellOrigin, EvalConfig, EvalInput, Evaluation, Shift, evaluate, nearest};
use numeric::Progress;
use raster::Grid;

use super::config::DiffConfig;
use super::error::DiffError;
use crate::eval::GridEvalConfig;
use crate::eval::grid_inputs::GridInputs;
use crate::eval::grid_layers::TestLayers;
use job::run_folder::surface_file;

/// Errors beyond this many NMADs do not take part in the second alignment.
const STABLE_NMADS: f32 = 3.0;
/// Least error that may count as change in the alignment, metres: below it lies what quantised or
/// exact surfaces differ by.
const STABLE_MIN_M: f32 = 0.5;
/// Ratio of the NMADs of an average shift and the best one below which the ground does not fix the
/// shift.
const FLAT: f64 = 1.02;
/// Largest relative difference of the sides of a cell.
const SQUARE_TOLERANCE: f64 = 0.01;

/// Both surfaces at the cells of the first.
pub(super) struct Aligned {
    /// What was read.
    pub(super) inputs: GridInputs,
    /// Heights of the second surface, moved.
    pub(super) after: Grid<f32>,
    /// Standard deviation of the difference, metres; `None` if nothing states one.
    pub(super) sigma: Option<Grid<f32>>,
    /// Cells observed on both dates.
    pub(super) observed: Grid<bool>,
    /// Probability that both heights of a cell are right; `None` if neither surface states one.
    pub(super) probability: Option<Grid<f32>>,
    /// Shift that was added to the second surface.
    pub(super) shift: Shift,
    /// Side of a cell, metres.
    pub(super) cell_m: f64,
    /// Whether both surfaces come with the layers of a run of this toolkit.
    pub(super) is_own: bool,
}

impl Aligned {
    /// Reads the surfaces and moves the second onto the first.
    pub(super) fn new(config: &DiffConfig, progress: &dyn Progress) -> Result<Self, DiffError> {
        let mut settings = GridEvalConfig::new(surface_file(&config.after), surface_file(&config.before));
        settings.alignment = config.alignment;
        settings.search_m = config.search_m;
        settings.test_vertical = config.after_vertical;
        settings.reference_vertical = config.before_vertical;
        let mut inputs = GridInputs::read(&settings)?;
        let layers = TestLayers::read(&settings, &inputs.reference, &mut inputs.notes)?;
        progress.check_cancelled()?;
        let is_observed = |origin: &CellOrigin| config.use_filled || *origin == CellOrigin::Observed;
        let of_before = layers.origins.as_ref().map(|origins| origins.map(is_observed));
        let of_after = inputs.layers.origins.as_ref().map(|origins| origins.map(is_observed));
        let found = co_registered(config, &mut inputs, of_before.as_ref(), of_after.as_ref())?;
        let cells = inputs.metres_from_cells.cells(found.shift.dx_m, found.shift.dy_m);
        let (width, height) = (inputs.reference.heights.width(), inputs.reference.heights.height());
        let place = |at: usize| {
            let (column, row) = ((at % width) as f64, (at / width) as f64);
            inputs.test_from_reference.position(column - cells.0, row - cells.1)
        };
        let mut observed = Grid::filled(width, height, true);
        for (at, observed) in observed.data_mut().iter_mut().enumerate() {
            let (x, y) = place(at);
            let before = of_before.as_ref().is_none_or(|mask| mask.data()[at]);
            *observed = before && of_after.as_ref().is_none_or(|mask| nearest(mask, x, y).unwrap_or(false));
        }
        let of_after = |at: usize| {
            let (x, y) = place(at);
            inputs.layers.sigma_m.as_ref().map_or(f32::NAN, |sigma| nearest(sigma, x, y).unwrap_or(f32::NAN))
        };
        let of_before = |at: usize| layers.sigma_m.as_ref().map_or(f32::NAN, |sigma| sigma.data()[at]);
        let (has_before, has_after) = (layers.sigma_m.is_some(), inputs.layers.sigma_m.is_some());
        let sigma = sigma_of_differences(config, (width, height), [has_before, has_after], of_before, of_after);
        if sigma.is_none() {
            inputs.notes.push("no standard deviations are known: that of the differences stands for them".into());
        }
        let stated = [layers.confidence.as_ref(), inputs.layers.confidence.as_ref()];
        for (date, _) in ["first", "second"].iter().zip(&stated).filter(|(_, stated)| stated.is_none()) {
            inputs.notes.push(format!(
                "the {date} surface has no probabilities beside it (confidence.tif): all its heights count as right"
            ));
        }
        // The errors of the dates are independent, so both are right with the product.
        let probability = (stated != [None, None]).then(|| {
            let right = |at: usize| {
                let (x, y) = place(at);
                let before = stated[0].map_or(1.0, |grid| grid.data()[at]);
                before * stated[1].map_or(1.0, |grid| nearest(grid, x, y).unwrap_or(f32::NAN))
            };
            Grid::from_vec(width, height, (0..width * height).map(right).collect())
        });
        let probability = probability.flatten();
        let (along_columns, along_rows) = inputs.metres_from_cells.cell_size_m();
        if (along_columns - along_rows).abs() > SQUARE_TOLERANCE * along_columns.max(along_rows) {
            inputs.notes.push(format!(
                "the cells measure {along_columns:.3} m by {along_rows:.3} m; distances take them as squares of \
                 that area"
            ));
        }
        let cell_m = inputs.metres_from_cells.cell_area_m2().sqrt();
        let is_own = layers.origins.is_some() && inputs.layers.origins.is_some();
        Ok(Self { after: found.aligned, sigma, observed, probability, shift: found.shift, cell_m, is_own, inputs })
    }
}

/// Finds the shift on the observed cells, and again on those that the first shift leaves within a
/// few deviations, so that changes do not pull it.
fn co_registered(
    config: &DiffConfig,
    inputs: &mut GridInputs,
    before: Option<&Grid<bool>>,
    after: Option<&Grid<bool>>,
) -> Result<Evaluation, DiffError> {
    let mut test = inputs.test.heights.clone();
    if let Some(observed) = after {
        let cells = test.data_mut().iter_mut().zip(observed.data());
        cells.filter(|(_, observed)| !**observed).for_each(|(height, _)| *height = f32::NAN);
    }
    let mut settings = EvalConfig::default();
    (settings.alignment, settings.search_m) = (config.alignment, config.search_m);
    let (reference, cells, metres) = (&inputs.reference.heights, &inputs.test_from_reference, inputs.metres_from_cells);
    let run = |test: &Grid<f32>, mask: Option<&Grid<bool>>, settings: &EvalConfig| {
        evaluate(&EvalInput { mask, ..EvalInput::new(test, reference, cells, metres) }, settings)
            .map_err(DiffError::Alignment)
    };
    let first = run(&test, before, &settings)?;
    let mut errors: Vec<f32> = first.errors.data().iter().copied().filter(|e| e.is_finite()).collect();
    let limit = (STABLE_NMADS * numeric::upper_nmad(&mut errors).unwrap_or(0.0) as f32).max(STABLE_MIN_M);
    let is_stable = |error: &f32| error.abs() <= limit;
    let shift = match config.alignment {
        AlignmentMethod::None => first.shift,
        _ => {
            let second = run(&test, Some(&first.errors.map(is_stable)), &settings)?;
            if let Some(search) = second.search.filter(|search| search.at_edge || search.contrast < FLAT) {
                inputs.notes.push(match search.at_edge {
                    true => "the best shift lies at the edge of the search: search further".into(),
                    false => "the ground is so flat that the horizontal shift is uncertain".into(),
                });
            }
            second.shift
        }
    };
    // All heights, filled ones too, at the shift that was found.
    let moved = cells_moved(inputs, shift);
    Ok(Evaluation { shift, aligned: moved, ..first })
}

/// Returns the second surface at the cells of the first, moved by a shift.
fn cells_moved(inputs: &GridInputs, shift: Shift) -> Grid<f32> {
    let cells = inputs.metres_from_cells.cells(shift.dx_m, shift.dy_m);
    let (width, height) = (inputs.reference.heights.width(), inputs.reference.heights.height());
    let mut moved = Grid::filled(width, height, f32::NAN);
    for (at, out) in moved.data_mut().iter_mut().enumerate() {
        let (column, row) = ((at % width) as f64, (at / width) as f64);
        let (x, y) = inputs.test_from_reference.position(column - cells.0, row - cells.1);
        *out = eval::bilinear(&inputs.test.heights, x, y).map_or(f32::NAN, |h| (h + shift.dz_m) as f32);
    }
    moved
}

/// Combines the deviations of both surfaces. A surface without a raster of deviations has the
/// configured one.
fn sigma_of_differences(
    config: &DiffConfig,
    (width, height): (usize, usize),
    has: [bool; 2],
    of_before: impl Fn(usize) -> f32,
    of_after: impl Fn(usize) -> f32,
) -> Option<Grid<f32>> {
    if has == [false; 2] && config.sigma_m.is_none() {
        return None;
    }
    let stated = config.sigma_m.map_or(0.0, |sigma| sigma as f32);
    let pick = |has: bool, sigma: f32| if has { sigma } else { stated };
    let cells = (0..width * height).map(|at| pick(has[0], of_before(at)).hypot(pick(has[1], of_after(at))));
    Grid::from_vec(width, height, cells.collect())
}
