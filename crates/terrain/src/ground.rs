//! From a surface to the ground under it.

use std::borrow::Cow;

use numeric::Progress;
use raster::Grid;

use crate::canopy::under_forests;
use crate::coarse::{add, blocks, slopes, smooth_slopes, spread, widened, without_cells};
use crate::config::{GroundConfig, NOISE_DEVIATIONS};
use crate::error::TerrainError;
use crate::forest::{forests, roughness};
use crate::heights::Heights;
use crate::membrane::filled;
use crate::narrow::Vanishing;
use crate::objects::{objects, radii};
use crate::outliers::OffPlanes;
use crate::pits::pits;
use crate::plate::plate;
use crate::regions::quantile;
use crate::rejoin::{growth_by_m, rejoined};
use crate::stray::{islands, stray};
use crate::trend::{TrendConfig, trend};

/// State of a cell without a height of the ground: too far from any ground.
pub const UNKNOWN: u8 = 0;
/// State of a cell that shows the ground itself.
pub const GROUND: u8 = 1;
/// State of a cell whose ground was interpolated under an object.
pub const UNDER_OBJECT: u8 = 2;
/// State of a cell whose ground was interpolated in a void of the surface.
pub const VOID_FILLED: u8 = 3;

/// Side of the cells on which objects are searched, metres. Smaller ones add time and noise only.
const WORK_CELL_M: f64 = 1.0;
/// Trend before any object is known: planes as wide as a city block, on the lower part of the
/// surface.
const FIRST_TREND: TrendConfig = TrendConfig { half_width_m: 50.0, quantile: 0.1, is_lower: true };
/// Trends of the ground between the objects of the searches before. The last is narrower: without
/// objects, planes may bend with the ground. It would follow the roof of a hall that none found.
const LATER_TRENDS: [TrendConfig; 2] = [
    TrendConfig { half_width_m: 40.0, quantile: 0.5, is_lower: false },
    TrendConfig { half_width_m: 20.0, quantile: 0.5, is_lower: false },
];
/// Width of the ring around objects in which ramps and low walls are looked for, metres.
const RING_M: f64 = 3.0;
/// Height above the ground around it up to which a cell of the ring, or a cell of the surface, is
/// ground, metres: the noise of satellite surfaces. It was chosen on simulated towns (seeds 4 to 6)
/// and JAX_068.
pub(crate) const RISE_M: f32 = 0.7;
/// Share of the cells that lie on ground as smooth as the noise allows; others are rough. The
/// deviations of smooth cells spread little, so the lowest of them tell the noise.
const SMOOTH_SHARE: f64 = 0.1;
/// Half-width of the planes that tell the noise of the ground, metres.
const NOISE_HALF_WIDTH_M: f64 = 2.0;
/// Least noise, metres: what quantised heights have.
pub(crate) const NOISE_MIN_M: f64 = 0.01;

/// The ground under a surface.
#[derive(Debug, Clone)]
pub struct BareGround {
    /// Heights of the ground, metres, in the datum of the surface. NaN where it is not known.
    pub heights: Grid<f32>,
    /// [`GROUND`], [`UNDER_OBJECT`], [`VOID_FILLED`] or [`UNKNOWN`].
    pub states: Grid<u8>,
}

/// Finds the ground under a surface with square cells of `cell_m` metres. Cells that are farther
/// from any ground than the widest object stay unknown.
///
/// # Errors
/// [`TerrainError::CellSize`], [`TerrainError::Parameter`] for values outside of their range,
/// [`TerrainError::Cancelled`].
///
/// ```
/// use numeric::Silent;
/// use raster::Grid;
/// use terrain::{GroundConfig, UNDER_OBJECT, bare_ground};
///
/// let mut surface = Grid::filled(80, 60, 20.0);
/// (30..42).for_each(|row| surface.row_mut(row)[30..50].fill(26.0));
/// let ground = bare_ground(&surface, 1.0, &GroundConfig::default(), &Silent)?;
/// assert_eq!(ground.states[(40, 36)], UNDER_OBJECT);
/// assert!((ground.heights[(40, 36)] - 20.0).abs() < 0.01);
/// # Ok::<(), terrain::TerrainError>(())
/// ```
pub fn bare_ground(
    surface: &Grid<f32>,
    cell_m: f64,
    config: &GroundConfig,
    progress: &dyn Progress,
) -> Result<BareGround, TerrainError> {
    bare_ground_of_observed(surface, None, cell_m, config, progress)
}

/// Finds the ground as [`bare_ground`] does. Cells that are marked `unobserved` have heights that
/// nothing has measured, such as filled gaps: they count as voids, and never tell the ground. Only
/// the canopy of a forest is taken with them, because they lie between crowns there.
///
/// # Errors
/// As [`bare_ground`], and [`TerrainError::Layer`] for a mask of another size.
pub fn bare_ground_of_observed(
    surface: &Grid<f32>,
    unobserved: Option<&Grid<bool>>,
    cell_m: f64,
    config: &GroundConfig,
    progress: &dyn Progress,
) -> Result<BareGround, TerrainError> {
    let search = unobserved.map_or(Search::Openings, |_| Search::OpeningsAndPlanes);
    searched((surface, unobserved), cell_m, config, search, progress)
}

/// Finds the ground as [`bare_ground_of_observed`] does, by openings alone. It takes roofs for
/// ground that are flush with a slope, but keeps hollows of which little is observed: planes take
/// their ground for wrong heights.
///
/// # Errors
/// As [`bare_ground_of_observed`].
pub fn bare_ground_by_openings(
    surface: &Grid<f32>,
    unobserved: &Grid<bool>,
    cell_m: f64,
    config: &GroundConfig,
    progress: &dyn Progress,
) -> Result<BareGround, TerrainError> {
    searched((surface, Some(unobserved)), cell_m, config, Search::Openings, progress)
}

/// How objects are told from ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Search {
    /// By the walls of what openings cut off. The points of a cloud show the whole border of what
    /// stands out.
    Openings,
    /// Beside it, by planes through the ground around.
    OpeningsAndPlanes,
}

fn searched(
    (surface, unobserved): (&Grid<f32>, Option<&Grid<bool>>),
    cell_m: f64,
    config: &GroundConfig,
    search: Search,
    progress: &dyn Progress,
) -> Result<BareGround, TerrainError> {
    config.validate()?;
    if !(cell_m > 0.0 && cell_m.is_finite()) {
        return Err(TerrainError::CellSize { found: cell_m });
    }
    let expected = (surface.width(), surface.height());
    if let Some(found) = unobserved.map(|mask| (mask.width(), mask.height())).filter(|found| *found != expected) {
        return Err(TerrainError::Layer { found, expected });
    }
    let side = work_side(cell_m);
    let work_m = cell_m * side as f64;
    progress.begin("ground", (1 + LATER_TRENDS.len()) * radii(config.widest_object_m / work_m).len());
    let whole_m = blocks(surface, side);
    let noise_m = noise_of(&whole_m, work_m);
    let observed = unobserved.map_or(Cow::Borrowed(surface), |mask| Cow::Owned(without_cells(surface, mask)));
    let without_pits = |heights: &Grid<f32>| without_cells(heights, &pits_of(heights, work_m, noise_m));
    let (whole_m, surface_m, evidence_m) = match unobserved {
        Some(_) => {
            let is_void = blocks(&observed, side).map(|h| h.is_nan());
            // Heights that were filled around a pit hide its rim.
            let is_pit = pits_of(&without_cells(&whole_m, &is_void), work_m, noise_m);
            let whole_m = without_pits(&without_cells(&whole_m, &is_pit));
            let surface_m = without_cells(&whole_m, &is_void);
            let evidence_m = without_cells(&surface_m, &islands(&surface_m, work_m));
            let evidence_m = match search {
                Search::Openings => evidence_m,
                Search::OpeningsAndPlanes => {
                    let is_sunken = OffPlanes::new(&evidence_m, work_m, noise_m, config).sunken();
                    without_cells(&evidence_m, &is_sunken)
                }
            };
            (whole_m, surface_m, evidence_m)
        }
        // Voids between the points of a cloud are usual: they make no islands, and hide no drops.
        None => {
            let whole_m = without_pits(&whole_m);
            (whole_m.clone(), whole_m.clone(), whole_m)
        }
    };
    let mut found = surface_m.map(|_| false);
    let mut is_forest = forests(&whole_m, work_m, config.widest_object_m);
    let mut clear_m = without_cells(&evidence_m, &is_forest);
    if clear_m.data().iter().all(|h| h.is_nan()) {
        // The surface is all there is to go by.
        (is_forest, clear_m) = (found.clone(), surface_m.clone());
    }
    // Without any height the raster stays unknown, and has no trend.
    if clear_m.data().iter().any(|h| !h.is_nan()) {
        let heights = Heights { clear: &clear_m, whole: &evidence_m, cell_m: work_m, noise_m };
        let vanishing = Vanishing::of(&heights, config);
        let first = trend(&clear_m, work_m, &FIRST_TREND);
        found = objects(&heights, &vanishing, (&first, &slopes(&first, work_m)), config, progress)?;
        // What one of the trends hides, another shows; ground joins again below.
        for later in &LATER_TRENDS {
            let known = filled(&without_cells(&clear_m, &found));
            let by_later = (&trend(&known, work_m, later), &smooth_slopes(&known, work_m));
            let again = objects(&heights, &vanishing, by_later, config, progress)?;
            add(&mut found, &again);
        }
        if search == Search::OpeningsAndPlanes {
            found = OffPlanes::new(&evidence_m, work_m, noise_m, config).no_ground(&clear_m, &found);
        }
    }
    let hidden_m = unobserved.map(|_| &evidence_m);
    let is_stray = stray(&without_cells(&clear_m, &found), hidden_m, work_m, noise_m);
    let ground = without_ramps(&without_cells(&clear_m, &is_stray), &found, work_m, noise_m);
    let noise_m = noise_of(&ground, work_m);
    let mut ground = rejoined(&without_cells(&surface_m, &is_forest), ground, work_m, noise_m);
    let mut under = match is_forest.data().contains(&true) && ground.data().iter().any(|h| !h.is_nan()) {
        true => under_forests(&whole_m, &is_forest, &mut ground, work_m, noise_m),
        false => plate(&ground, work_m, noise_m),
    };
    // Known ground keeps its height.
    under.data_mut().iter_mut().zip(ground.data()).filter(|(_, h)| !h.is_nan()).for_each(|(under, h)| *under = *h);
    Ok(at_cells(&observed, &ground, &under, side, config.widest_object_m / work_m))
}

/// Number of cells along the side of one of the cells that the work is done on.
pub(crate) fn work_side(cell_m: f64) -> usize {
    ((WORK_CELL_M / cell_m).round() as usize).max(1)
}

/// Returns the cells of pits, none in a surface without any height, which has no trend.
fn pits_of(surface: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    if surface.data().iter().all(|h| h.is_nan()) {
        return surface.map(|_| false);
    }
    pits(surface, &trend(surface, cell_m, &FIRST_TREND), cell_m, noise_m)
}

/// Returns the heights of the ground, NaN at objects and at the ramps that lead up to them. A cell
/// near an object is ground if it does not rise above the ground further away.
fn without_ramps(surface: &Grid<f32>, objects: &Grid<bool>, cell_m: f64, noise_m: f64) -> Grid<f32> {
    let ring = ((RING_M / cell_m).round() as usize).max(1);
    let around = without_cells(surface, &widened(objects, ring));
    let expected = filled(&around);
    // In a clearing without any ground further away nothing can be compared.
    let is_near = widened(&around.map(|h| !h.is_nan()), 2 * ring);
    let mut ground = without_cells(surface, objects);
    let slope = slopes(&expected, cell_m);
    let rise_m = RISE_M.max((NOISE_DEVIATIONS * noise_m) as f32);
    for (at, cell) in ground.data_mut().iter_mut().enumerate().filter(|(at, _)| is_near.data()[*at]) {
        if *cell - expected.data()[at] > rise_m + growth_by_m(slope.data()[at]) {
            *cell = f32::NAN;
        }
    }
    ground
}

/// Deviations of the cells of a surface from the planes around them, metres; NaN at voids.
pub(crate) fn unevenness(surface: &Grid<f32>, cell_m: f64) -> Grid<f32> {
    roughness(surface, ((NOISE_HALF_WIDTH_M / cell_m).round() as usize).max(1))
}

/// Noise of a surface: the deviation of its smooth cells from the planes around them, metres.
fn noise_of(ground: &Grid<f32>, cell_m: f64) -> f64 {
    let rough = unevenness(ground, cell_m);
    let mut known: Vec<f32> = rough.data().iter().copied().filter(|h| !h.is_nan()).collect();
    quantile(&mut known, SMOOTH_SHARE).map_or(NOISE_MIN_M, |noise| f64::from(noise).max(NOISE_MIN_M))
}

/// Carries the ground of coarse cells to the cells of the surface.
fn at_cells(surface: &Grid<f32>, ground: &Grid<f32>, coarse: &Grid<f32>, side: usize, reach: f64) -> BareGround {
    let (width, height) = (surface.width(), surface.height());
    let is_near = widened(&ground.map(|h| !h.is_nan()), reach.round() as usize);
    let mut heights = Grid::filled(width, height, f32::NAN);
    let mut states = Grid::filled(width, height, UNKNOWN);
    let below = spread(coarse, side, (width, height));
    for row in 0..height {
        for column in 0..width {
            let block = (column / side, row / side);
            if is_near[block] {
                let (own_m, below_m) = (surface[(column, row)], below[(column, row)]);
                let may_show = !ground[block].is_nan();
                (heights[(column, row)], states[(column, row)]) = shown_or_below(own_m, below_m, may_show);
            }
        }
    }
    BareGround { heights, states }
}

/// Returns height and state of a cell above a known ground: its own height if it may show the
/// ground and lies at it.
pub(crate) fn shown_or_below(own_m: f32, below_m: f32, may_show: bool) -> (f32, u8) {
    match may_show && (own_m - below_m).abs() <= RISE_M {
        true => (own_m, GROUND),
        false if own_m.is_nan() => (below_m, VOID_FILLED),
        false => (below_m, UNDER_OBJECT),
    }
}
