//! The two surfaces on one grid: read, co-registered, with deviations and observed cells.

use eval::{AlignmentMethod, CellMap, CellOrigin, EvalConfig, EvalInput, LocalShifts, Shift, evaluate, nearest};
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
    /// Shifts by block that were added to it besides, if they were asked for.
    pub(super) local: Option<LocalShifts>,
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
        let (width, height) = (inputs.reference.heights.width(), inputs.reference.heights.height());
        let place = |at: usize| found.place(&inputs.test_from_reference, (at % width) as f64, (at / width) as f64).0;
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
        // All heights, filled ones too.
        let after = found.heights(&inputs);
        let Movement { shift, local, .. } = found;
        Ok(Self { after, sigma, observed, probability, shift, local, cell_m, is_own, inputs })
    }
}

/// How the second surface is moved.
struct Movement {
    shift: Shift,
    /// The shift in columns and rows.
    cells: (f64, f64),
    local: Option<LocalShifts>,
}

impl Movement {
    /// Returns the position in the second surface of a cell of the first, and what is added to its
    /// height there.
    fn place(&self, after_from_before: &CellMap, column: f64, row: f64) -> ((f64, f64), f64) {
        let local = self.local.as_ref().map_or([0.0; 3], |local| local.at(column, row));
        let position = after_from_before.position(column - self.cells.0 - local[0], row - self.cells.1 - local[1]);
        (position, self.shift.dz_m + local[2])
    }

    /// Returns the second surface at the cells of the first.
    fn heights(&self, inputs: &GridInputs) -> Grid<f32> {
        let (width, height) = (inputs.reference.heights.width(), inputs.reference.heights.height());
        let mut moved = Grid::filled(width, height, f32::NAN);
        for (at, out) in moved.data_mut().iter_mut().enumerate() {
            let ((x, y), dz_m) = self.place(&inputs.test_from_reference, (at % width) as f64, (at / width) as f64);
            *out = eval::bilinear(&inputs.test.heights, x, y).map_or(f32::NAN, |h| (h + dz_m) as f32);
        }
        moved
    }
}

/// Finds the shift on the observed cells, and again on those that the first shift leaves within a
/// few deviations, so that changes do not pull it. Local shifts are found on all observed cells:
/// the first shift leaves large errors at just those edges that tell them.
fn co_registered(
    config: &DiffConfig,
    inputs: &mut GridInputs,
    before: Option<&Grid<bool>>,
    after: Option<&Grid<bool>>,
) -> Result<Movement, DiffError> {
    let observed_of = |heights: &Grid<f32>, observed: &Grid<bool>| heights.without(|i| !observed.data()[i]);
    let test = after.map_or_else(|| inputs.test.heights.clone(), |mask| observed_of(&inputs.test.heights, mask));
    let mut settings = EvalConfig::default();
    (settings.alignment, settings.search_m) = (config.alignment, config.search_m);
    let (reference, cells, metres) = (&inputs.reference.heights, &inputs.test_from_reference, inputs.metres_from_cells);
    let run = |test: &Grid<f32>, mask: Option<&Grid<bool>>, settings: &EvalConfig| {
        evaluate(&EvalInput { mask, ..EvalInput::new(test, reference, cells, metres) }, settings)
            .map_err(DiffError::Alignment)
    };
    let mut found = run(&test, before, &settings)?;
    let mut errors: Vec<f32> = found.errors.data().iter().copied().filter(|e| e.is_finite()).collect();
    let limit = (STABLE_NMADS * numeric::upper_nmad(&mut errors).unwrap_or(0.0) as f32).max(STABLE_MIN_M);
    let is_stable = found.errors.map(|error| error.abs() <= limit);
    let mut note = None;
    if config.alignment != AlignmentMethod::None {
        found = run(&test, Some(&is_stable), &settings)?;
        note = found.search.and_then(|search| match search {
            search if search.at_edge => Some("the best shift lies at the edge of the search: search further"),
            search if search.contrast < FLAT => Some("the ground is so flat that the horizontal shift is uncertain"),
            _ => None,
        });
    }
    let local = config.block_m.map(|block_m| {
        let observed = before.map(|mask| observed_of(reference, mask));
        LocalShifts::find(&found.aligned, observed.as_ref().unwrap_or(reference), metres, block_m)
            .map_err(DiffError::Alignment)
    });
    let (mut shift, mut local) = (found.shift, local.transpose()?);
    if let Some(local) = &mut local {
        let [dx_m, dy_m, dz_m] = local.take_mean(metres);
        shift = Shift { dx_m: shift.dx_m + dx_m, dy_m: shift.dy_m + dy_m, dz_m: shift.dz_m + dz_m };
    }
    let movement = Movement { shift, cells: metres.cells(shift.dx_m, shift.dy_m), local };
    inputs.notes.extend(note.map(str::to_owned));
    Ok(movement)
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
