//! The classes of cells from heights.

use raster::Grid;

use crate::config::ClassifyConfig;
use crate::error::{ClassifyError, Reason};
use crate::regions::{closed, grow, opened, spread, take_enclosed, without_share, without_small};
use crate::roofs::RoofScene;
use crate::roughness::{least_residual, median_residual};

/// A cell without a height or without ground.
pub const UNKNOWN: u8 = 0;
/// Bare ground.
pub const GROUND: u8 = 2;
/// Grass and other plants on the ground, which only a vegetation index tells from it.
pub const LOW_VEGETATION: u8 = 3;
/// Trees and other vegetation higher than the least height.
pub const VEGETATION: u8 = 5;
/// A building.
pub const BUILDING: u8 = 6;
/// Water, which only a vegetation index tells from ground.
pub const WATER: u8 = 9;

/// A building index, which decides where heights are weak.
#[derive(Debug, Clone, Copy)]
pub struct BuildingCue<'a> {
    /// Index of each cell, 0 to 1; NaN where none is known.
    pub index: &'a Grid<f32>,
    /// Cells whose height was not observed or is uncertain. `None` if all are good.
    pub weak: Option<&'a Grid<bool>>,
}

/// What tells crowns that the surface lacks: matching drops small trees, and leaves uncertain
/// heights of the ground in their places.
#[derive(Debug, Clone, Copy)]
pub struct CrownCue<'a> {
    /// Vegetation index of each cell, looked at above the surface in several images, where a crown
    /// would be; NaN where none is known.
    pub index: &'a Grid<f32>,
    /// Cells whose height was not observed or is uncertain.
    pub unsure: &'a Grid<bool>,
}

/// A surface and its height above the ground, on one grid of square cells.
#[derive(Debug, Clone, Copy)]
pub struct ClassifyInput<'a> {
    /// Heights of the surface, metres; NaN is a void.
    pub surface: &'a Grid<f32>,
    /// Height of the surface above the ground, metres; NaN where either is unknown.
    pub above_ground: &'a Grid<f32>,
    /// Vegetation index (NDVI) of each cell, −1 to 1; NaN where none is known.
    pub index: Option<&'a Grid<f32>>,
    /// Whether the pixels of the vegetation index are wider than the cells. Along eaves they hold
    /// roof and lawn, so that what stands is told by its shape.
    pub is_index_coarse: bool,
    /// What an image says about buildings.
    pub cue: Option<BuildingCue<'a>>,
    /// What images say about crowns without heights.
    pub crowns: Option<CrownCue<'a>>,
    /// Cells whose height was not observed, or is rather wrong than right. `None` if all are good.
    pub weak: Option<&'a Grid<bool>>,
    /// Side of a cell, metres.
    pub cell_m: f64,
}

/// Lengths that follow from the noise of a surface.
///
/// A crown differs from a plane, in a window of side w, by a residual that grows as w², because it
/// is curved. So the windows shrink with the root of the residual that a roof may have, and the
/// parts of roofs that a window fits on become smaller. What blurs a surface makes both its noise
/// and its ramps.
struct Scale {
    window_m: f64,
    roughness_m: f64,
    ramp_m: f64,
    /// Distance from a plane up to which cells lie on it, metres.
    tolerance_m: f64,
    /// Least radius of curvature of roofs, metres. A sharp surface shows the branches of crowns,
    /// and the clutter of roofs: both are rough there, and the curvature tells less.
    radius_m: f64,
}

impl Scale {
    fn of(input: &ClassifyInput<'_>, config: &ClassifyConfig) -> Self {
        let mut bare = input.above_ground.map(|above| above.abs() < BARE_M);
        // Filled ground is smooth, and doubtful heights are no ground: neither tells the noise.
        if let Some(weak) = input.weak {
            clear(&mut bare, weak);
        }
        let reach = reach_of(config.window_m, input.cell_m);
        let noise_m = median_residual(input.surface, &bare, reach, WINDOWS_MIN);
        let of_noise = noise_m.map_or(config.roughness_m, |noise| config.ground_residuals * noise);
        let roughness_m = of_noise.clamp(config.least_roughness_m, config.roughness_m);
        let part = roughness_m / config.roughness_m;
        let window_m = (part.sqrt() * config.window_m).max(config.least_window_m);
        let tolerance_m = (NOISE_OF_PLANES * noise_m.unwrap_or(0.0)).clamp(LEAST_TOLERANCE_M, MOST_TOLERANCE_M);
        Self {
            window_m,
            roughness_m,
            ramp_m: part * config.ramp_m,
            tolerance_m,
            radius_m: part * part * config.least_radius_m,
        }
    }
}

/// Tolerance of planes in residuals of the bare ground, and its limits, metres.
const NOISE_OF_PLANES: f64 = 5.0;
const LEAST_TOLERANCE_M: f64 = 0.3;
const MOST_TOLERANCE_M: f64 = 0.6;
/// Height above the ground up to which a cell is bare, metres: above it are cars and hedges.
const BARE_M: f32 = 0.3;
/// Fewest windows on bare ground that tell the noise of a surface.
const WINDOWS_MIN: usize = 100;

/// Distance from a building within which heights are unsure because of its walls, metres.
const WALL_M: f64 = 1.0;
/// Area of smooth cells that is no accident, in windows.
const CHANCE_WINDOWS: f64 = 1.2;

/// Returns half the side of a window in cells, without the middle cell.
fn reach_of(window_m: f64, cell_m: f64) -> usize {
    ((window_m / cell_m - 1.0) / 2.0).round().max(1.0) as usize
}

/// Classes of cells.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Classes {
    /// Class of each cell.
    pub classes: Grid<u8>,
    /// Least residual of a plane around each cell, metres; infinite away from what stands.
    pub roughness: Grid<f32>,
}

/// Finds the class of each cell.
///
/// ```
/// use classes::{BUILDING, ClassifyConfig, ClassifyInput, GROUND, classify};
/// use raster::Grid;
///
/// let mut surface = Grid::filled(60, 60, 0.0f32);
/// for row in 20..40 {
///     surface.row_mut(row)[15..45].fill(5.0);
/// }
/// let input = ClassifyInput {
///     surface: &surface,
///     above_ground: &surface,
///     index: None,
///     is_index_coarse: false,
///     cue: None,
///     crowns: None,
///     weak: None,
///     cell_m: 0.5,
/// };
/// let found = classify(&input, &ClassifyConfig::default())?;
/// assert_eq!((found.classes[(30, 30)], found.classes[(5, 5)]), (BUILDING, GROUND));
/// # Ok::<(), classes::ClassifyError>(())
/// ```
///
/// # Errors
/// [`ClassifyError`] for a parameter outside of its range, and for
/// rasters of different sizes.
pub fn classify(input: &ClassifyInput<'_>, config: &ClassifyConfig) -> Result<Classes, ClassifyError> {
    config.validate()?;
    check(input)?;
    let least_m = config.least_height_m as f32;
    let scale = Scale::of(input, config);
    let scene = RoofScene {
        surface: input.surface,
        above_ground: input.above_ground,
        weak: input.weak,
        cell_m: input.cell_m,
        least_m,
        tolerance_m: scale.tolerance_m,
    };
    let mut stands = scene.stands();
    let roughness = least_residual(input.surface, &stands, reach_of(scale.window_m, input.cell_m));
    let limit_m = scale.roughness_m as f32;
    let cells = |area_m2: f64| (area_m2 / (input.cell_m * input.cell_m)).ceil() as usize;
    let steps = |length_m: f64| (length_m / input.cell_m).round().max(1.0) as usize;
    let green = Greenness::of(input, config);
    let mut buildings = roughness.map(|r| *r < limit_m);
    let planes = scene.planes();
    scene.without_crowns(&mut buildings, (&planes, &roughness), scale.radius_m, config.least_roughness_m);
    clear(&mut buildings, &green.tall);
    let mut likely = vec![false; stands.data().len()];
    if let Some(cue) = &input.cue {
        likely = likely_buildings(input, cue, (&roughness, scale.roughness_m), config);
        for at in (0..likely.len()).filter(|at| likely[*at] && !green.tall.data()[*at]) {
            buildings.data_mut()[at] = true;
            stands.data_mut()[at] = true;
        }
    }
    // A single window may be smooth by chance, and growing would make it large enough.
    let chance_m2 = CHANCE_WINDOWS * scale.window_m * scale.window_m;
    without_small(&mut buildings, cells(chance_m2.min(config.least_building_m2)));
    let mut free = stands.clone();
    clear(&mut free, &green.tall);
    grow(&mut buildings, &free, steps(scale.ramp_m));
    let taken = scene.without_weak_outlines(&mut buildings);
    scene.continue_over_planes(&mut buildings, &planes);
    clear(&mut buildings, &green.tall);
    scene.without_slopes(&mut buildings, &likely);
    without_small(&mut buildings, cells(config.least_building_m2));
    clear(&mut stands, &taken);
    let mut vegetation = stands.clone();
    clear(&mut vegetation, &buildings);
    without_small(&mut vegetation, cells(config.least_vegetation_m2));
    if input.index.is_some() {
        let is_green = |at: usize| green.all.data()[at];
        let known = |at: usize| green.known.data()[at];
        without_share(&mut vegetation, config.least_green_share, known, is_green);
    }
    let mut left = stands;
    clear(&mut left, &vegetation);
    // Scraps that touch a building are parts of it; others are too small for anything.
    grow(&mut buildings, &left, 1);
    take_enclosed(&mut vegetation, &mut buildings, |at| green.tall.data()[at]);
    if let Some(crowns) = &input.crowns {
        let found = without_heights(input, crowns, &buildings, config);
        add(&mut vegetation, &found);
    }
    let mut water = left.map(|_| false);
    if let Some(index) = input.index {
        water.data_mut().iter_mut().enumerate().for_each(|(at, wet)| {
            let is_object = buildings.data()[at] || vegetation.data()[at];
            *wet = !is_object && f64::from(index.data()[at]) <= config.water_index;
        });
        without_small(&mut water, cells(config.least_water_m2));
    }
    let mut classes = Grid::filled(left.width(), left.height(), UNKNOWN);
    for (at, class) in classes.data_mut().iter_mut().enumerate() {
        *class = match input.above_ground.data()[at] {
            h if !h.is_finite() => UNKNOWN,
            _ if buildings.data()[at] => BUILDING,
            _ if vegetation.data()[at] => VEGETATION,
            _ if water.data()[at] => WATER,
            _ if green.all.data()[at] => LOW_VEGETATION,
            _ => GROUND,
        };
    }
    Ok(Classes { classes, roughness })
}

/// What the vegetation index says.
struct Greenness {
    /// Cells with an index.
    known: Grid<bool>,
    /// Green cells.
    all: Grid<bool>,
    /// Green cells that are no buildings.
    tall: Grid<bool>,
}

impl Greenness {
    fn of(input: &ClassifyInput<'_>, config: &ClassifyConfig) -> Self {
        let none = || input.surface.map(|_| false);
        let Some(index) = input.index else { return Self { known: none(), all: none(), tall: none() } };
        let all = index.map(|v| f64::from(*v) >= config.least_index);
        let tall = if input.is_index_coarse { none() } else { all.clone() };
        Self { known: index.map(|v| v.is_finite()), all, tall }
    }
}

/// Returns crowns that the surface lacks: green above the surface where its height is unsure, away
/// from walls, where heights are unsure too, and as wide as a crown.
fn without_heights(
    input: &ClassifyInput<'_>,
    crowns: &CrownCue<'_>,
    buildings: &Grid<bool>,
    config: &ClassifyConfig,
) -> Grid<bool> {
    let steps = |length_m: f64| (length_m / input.cell_m).round().max(1.0) as usize;
    let mut found = crowns.unsure.clone();
    for (at, crown) in found.data_mut().iter_mut().enumerate() {
        *crown = *crown && f64::from(crowns.index.data()[at]) >= config.least_index;
    }
    clear(&mut found, &spread(buildings, steps(WALL_M)));
    let reach = steps(0.5 * config.least_crown_m);
    let mut found = closed(&opened(&found, reach), reach);
    clear(&mut found, buildings);
    without_small(&mut found, (config.least_vegetation_m2 / (input.cell_m * input.cell_m)).ceil() as usize);
    found
}

/// Takes the cells of one mask out of another.
fn clear(mask: &mut Grid<bool>, other: &Grid<bool>) {
    mask.data_mut().iter_mut().zip(other.data()).for_each(|(cell, other)| *cell &= !other);
}

/// Adds the cells of one mask to another.
fn add(mask: &mut Grid<bool>, other: &Grid<bool>) {
    mask.data_mut().iter_mut().zip(other.data()).for_each(|(cell, other)| *cell |= other);
}

/// Returns the cells whose heights are too weak to tell and that the building index says are
/// buildings: their height is not known well, or it or the roughness lies near the threshold.
fn likely_buildings(
    input: &ClassifyInput<'_>,
    cue: &BuildingCue<'_>,
    (roughness, limit_m): (&Grid<f32>, f64),
    config: &ClassifyConfig,
) -> Vec<bool> {
    let least_m = config.least_height_m;
    let is_likely = |at: usize| {
        let (above_m, rough_m) = (f64::from(input.above_ground.data()[at]), f64::from(roughness.data()[at]));
        let is_weak = cue.weak.is_some_and(|weak| weak.data()[at]);
        let is_low = above_m <= least_m && above_m > least_m / config.leniency;
        let is_rough = above_m > least_m && rough_m >= limit_m && rough_m < config.leniency * limit_m;
        f64::from(cue.index.data()[at]) >= config.least_building_index
            && above_m.is_finite()
            && (is_weak || is_low || is_rough)
    };
    (0..input.surface.data().len()).map(is_likely).collect()
}

fn check(input: &ClassifyInput<'_>) -> Result<(), Reason> {
    let expected = (input.surface.width(), input.surface.height());
    let fits = |what, found: Option<(usize, usize)>| match found {
        Some(found) if found != expected => Err(Reason::Size { what, found, expected }),
        _ => Ok(()),
    };
    let above = input.above_ground;
    fits("the raster of heights above ground", Some((above.width(), above.height())))?;
    fits("the vegetation index", input.index.map(|grid| (grid.width(), grid.height())))?;
    fits("the building index", input.cue.map(|cue| (cue.index.width(), cue.index.height())))?;
    let weak = input.cue.and_then(|cue| cue.weak);
    fits("the mask of weak heights", weak.map(|grid| (grid.width(), grid.height())))?;
    fits("the index of crowns", input.crowns.map(|crowns| (crowns.index.width(), crowns.index.height())))?;
    fits("the mask of unsure heights", input.crowns.map(|crowns| (crowns.unsure.width(), crowns.unsure.height())))?;
    fits("the mask of weak cells", input.weak.map(|grid| (grid.width(), grid.height())))?;
    if !(input.cell_m.is_finite() && input.cell_m > 0.0) {
        let (name, expected) = ("the side of a cell", "a positive number of metres");
        return Err(Reason::Parameter { name, found: input.cell_m, expected });
    }
    Ok(())
}
