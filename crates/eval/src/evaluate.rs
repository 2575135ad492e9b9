//! Evaluation of one surface against another: alignment, then errors over all cells, per class, per
//! slope and at edges, and the objects above the terrain.

use crate::alignment::align::{AlignmentMethod, MetresFromCells, Shift};
use crate::alignment::cell_map::CellMap;
use crate::alignment::nuth_kaab::{NuthKaab, NuthKaabSummary};
use crate::alignment::resample::{bilinear, nearest};
use crate::alignment::search::{Measure, Search, SearchSummary};
use crate::error::EvalError;
use crate::measures::breakdown::{Cells, ClassMetrics, CoverageMetrics, EdgeMetrics, SlopeMetrics};
use crate::measures::calibration::{Reliability, SigmaReport, reliability, sigma_report};
use crate::measures::edges::{EdgeRule, edge_zone};
use crate::measures::gradient::slope_deg;
use crate::measures::metrics::Metrics;
use crate::measures::objects::{Objects, ObjectsFound};
use crate::measures::origin::{CellOrigin, OriginSplit, split};
use crate::measures::sharpness::{Sharpness, sharpness};
use crate::measures::standing::{Standing, standing};
use crate::measures::terrain::{TerrainSource, estimated_terrain, terrain_from_ground};
use numeric::percentile;
use raster::Grid;
use rayon::prelude::*;

/// Class of bare ground in the LAS specification.
const GROUND: i32 = 2;
/// Class of buildings in the LAS specification.
const BUILDING: i32 = 6;
/// Lowest share of the reference's cells in the ground class from which the terrain is taken from
/// that class.
const LEAST_GROUND_SHARE: f64 = 0.02;

/// Input of an evaluation. Heights are metres above the same vertical datum. Cells that are not
/// finite are void.
#[derive(Debug, Clone, Copy)]
pub struct EvalInput<'a> {
    /// Evaluated surface.
    pub test: &'a Grid<f32>,
    /// Trusted surface. Errors are measured at its cells.
    pub reference: &'a Grid<f32>,
    /// Positions of the reference's cells in the test grid. For [`AlignmentMethod::Xyz`] and
    /// [`AlignmentMethod::NuthKaab`] it must hold as far outside the reference as the search
    /// reaches.
    pub test_from_reference: &'a CellMap,
    /// Size and orientation of the reference's cells.
    pub metres_from_cells: MetresFromCells,
    /// Class of each reference cell, on the reference grid. `None` marks a cell without a class.
    pub classes: Option<&'a Grid<Option<i32>>>,
    /// Reference cells that count, on the reference grid. All count without a mask.
    pub mask: Option<&'a Grid<bool>>,
    /// Bare ground on the reference grid, above the same datum. Without it, the terrain is taken
    /// from the ground class or estimated.
    pub terrain: Option<&'a Grid<f32>>,
    /// Confidence of each cell of the test, on the test grid; higher is better. It is used to
    /// evaluate the most confident cells alone, and for the reliability table.
    pub confidence: Option<&'a Grid<f32>>,
    /// Standard deviation of each height of the test, on the test grid, metres. Cells that are not
    /// finite or not positive have none.
    pub sigma_m: Option<&'a Grid<f32>>,
    /// Origin of each height of the test, on the test grid. Without it, all heights count as
    /// observed.
    pub origins: Option<&'a Grid<CellOrigin>>,
    /// Object in each reference cell, on the reference grid: 0 or `None` is ground, −1 a tree, and
    /// a positive number is a building.
    pub objects: Option<&'a Grid<Option<i32>>>,
}

impl<'a> EvalInput<'a> {
    /// Returns the input with two surfaces and nothing else.
    pub fn new(
        test: &'a Grid<f32>,
        reference: &'a Grid<f32>,
        test_from_reference: &'a CellMap,
        metres_from_cells: MetresFromCells,
    ) -> Self {
        Self {
            test,
            reference,
            test_from_reference,
            metres_from_cells,
            classes: None,
            mask: None,
            terrain: None,
            confidence: None,
            sigma_m: None,
            origins: None,
            objects: None,
        }
    }
}

/// Settings of an evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct EvalConfig {
    /// Shift that is removed first.
    pub alignment: AlignmentMethod,
    /// Radius of the horizontal search, metres.
    pub search_m: f64,
    /// Thresholds of `completeness_<t>` and `pag_<t>`, metres.
    pub thresholds_m: Vec<f64>,
    /// Classes whose cells are excluded from everything, including the alignment.
    pub skip: Vec<i32>,
    /// Lowest height above the terrain of a standing object, metres.
    pub standing_m: f64,
    /// Absolute error below which a height is right in the reliability table, metres.
    pub right_below_m: f64,
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self {
            alignment: AlignmentMethod::Xyz,
            search_m: 5.0,
            thresholds_m: vec![0.5, 1.0, 2.5, 7.5],
            skip: Vec::new(),
            standing_m: 2.0,
            right_below_m: 1.0,
        }
    }
}

/// Result of an evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Translation that was added to the test surface.
    pub shift: Shift,
    /// Summary of the search of [`AlignmentMethod::Xyz`].
    pub search: Option<SearchSummary>,
    /// Summary of [`AlignmentMethod::NuthKaab`].
    pub nuth_kaab: Option<NuthKaabSummary>,
    /// Metrics over all cells that are not skipped.
    pub overall: Metrics,
    /// Metrics per class, in rising order. Empty without classes.
    pub classes: Vec<ClassMetrics>,
    /// Metrics per slope of the reference. Cells beside a void have no slope.
    pub slopes: Vec<SlopeMetrics>,
    /// Definition of an edge.
    pub edge_rule: EdgeRule,
    /// Metrics near and away from the reference's height jumps.
    pub edges: EdgeMetrics,
    /// Overreach at roof edges: at edges of the building class if the reference has one, at all
    /// edges with level sides otherwise.
    pub sharpness: Sharpness,
    /// Completeness of the objects above the terrain.
    pub standing: Standing,
    /// Metrics of the most confident cells. Empty without a confidence.
    pub coverages: Vec<CoverageMetrics>,
    /// Observed and filled cells apart. `None` without their origins.
    pub origins: Option<OriginSplit>,
    /// Calibration of the standard deviations. `None` without them.
    pub sigma: Option<SigmaReport>,
    /// Reliability of the confidence. `None` without one.
    pub reliability: Option<Reliability>,
    /// Buildings that are lost or damaged, and trees. `None` without the objects.
    pub objects: Option<ObjectsFound>,
    /// Overreach along the outlines of the numbered buildings. `None` without the objects.
    pub outlines: Option<Sharpness>,
    /// Number of valid cells of the reference that the class or the mask excludes.
    pub skipped_cells: usize,
    /// Test − reference after the alignment, metres, on the reference grid. NaN where either is
    /// void or skipped.
    pub errors: Grid<f32>,
    /// Test surface after the alignment, on the reference grid. NaN where it is void.
    pub aligned: Grid<f32>,
}

/// Aligns the test surface with the reference and measures its errors.
///
/// ```
/// use eval::{CellMap, EvalConfig, EvalInput, MetresFromCells, evaluate};
/// use raster::{GeoTransform, Grid};
///
/// let reference = Grid::filled(40, 30, 120.0);
/// let test = Grid::filled(40, 30, 120.5);
/// let geotransform = GeoTransform::north_up(0.0, 0.0, 1.0);
/// let cells = CellMap::affine(&geotransform, &geotransform)?;
/// let metres = MetresFromCells::new(&geotransform, (1.0, 1.0));
/// let config = EvalConfig { alignment: eval::AlignmentMethod::None, ..EvalConfig::default() };
/// let found = evaluate(&EvalInput::new(&test, &reference, &cells, metres), &config)?;
/// assert_eq!(found.overall.errors.map(|errors| errors.mean), Some(0.5));
/// # Ok::<(), eval::EvalError>(())
/// ```
///
/// # Errors
/// [`EvalError`] if a setting is unusable, if the reference is empty, if the two surfaces share no
/// cell, if a grid has another shape than the reference, or if the ground does not allow the
/// alignment.
pub fn evaluate(input: &EvalInput<'_>, config: &EvalConfig) -> Result<Evaluation, EvalError> {
    check(input, config)?;
    let counted = counted(input, &config.skip);
    let valid = |grid: &Grid<f32>| grid.data().iter().filter(|h| h.is_finite()).count();
    let reference_cells = valid(&counted);
    let skipped_cells = valid(input.reference) - reference_cells;
    if reference_cells == 0 {
        return Err(EvalError::EmptyReference { skipped: skipped_cells });
    }
    let HorizontalShift { cells, search, nuth_kaab } =
        horizontal_shift(&EvalInput { reference: &counted, ..*input }, config)?;
    let mut aligned = moved(input, cells);
    let mut errors = differences(&aligned, &counted);
    let offset = percentile(&mut finite(&errors), 50.0).ok_or(EvalError::NoOverlap { reference_cells })?;
    let (dx_m, dy_m) = input.metres_from_cells.apply(cells.0, cells.1);
    let mut shift = Shift { dx_m, dy_m, dz_m: 0.0 };
    if config.alignment != AlignmentMethod::None {
        shift.dz_m = 0.0 - offset;
        for grid in [&mut errors, &mut aligned] {
            grid.data_mut().iter_mut().for_each(|e| *e -= offset);
        }
    }
    let aligned = aligned.map(|&h| h as f32);
    let zone = edge_zone(input.reference, input.metres_from_cells);
    let confidence = input.confidence.map(|layer| at_reference(input, layer, cells, f32::NAN));
    let sigma_m = input.sigma_m.map(|layer| at_reference(input, layer, cells, f32::NAN));
    let origins = input.origins.map(|layer| at_reference(input, layer, cells, CellOrigin::Void));
    let part = Cells { reference: &counted, errors: &errors, thresholds_m: &config.thresholds_m };
    Ok(Evaluation {
        shift,
        search,
        nuth_kaab,
        overall: Metrics::of(&mut finite(&errors), reference_cells, &config.thresholds_m),
        classes: part.per_class(input.classes),
        slopes: part.per_slope(&slope_deg(input.reference, input.metres_from_cells)),
        edge_rule: EdgeRule::of(input.metres_from_cells),
        edges: part.at_edges(&zone),
        sharpness: roof_edges(input, &counted, &aligned),
        standing: standing_of(input, config, &counted, &aligned),
        coverages: confidence.as_ref().map_or_else(Vec::new, |confidence| part.per_coverage(confidence)),
        origins: origins.as_ref().map(|origins| split(part, origins, &zone, input.classes)),
        sigma: sigma_m.map(|sigma_m| sigma_report(&errors, &sigma_m, origins.as_ref())),
        reliability: confidence.map(|confidence| reliability(&errors, &confidence, config.right_below_m)),
        objects: input.objects.map(|numbers| objects(input, numbers, &counted, &errors)),
        outlines: input.objects.map(|numbers| outlines(input, numbers, &counted, &aligned)),
        skipped_cells,
        errors: errors.map(|&e| e as f32),
        aligned,
    })
}

/// Returns a layer of the test at every reference cell, each from the nearest cell. The test is
/// moved by `shift` reference cells. Cells outside of the test get `outside`.
fn at_reference<T: Copy>(input: &EvalInput<'_>, layer: &Grid<T>, shift: (f64, f64), outside: T) -> Grid<T> {
    let (width, height) = (input.reference.width(), input.reference.height());
    let mut out = Grid::filled(width, height, outside);
    for (i, out) in out.data_mut().iter_mut().enumerate() {
        let (column, row) = ((i % width) as f64, (i / width) as f64);
        let (x, y) = input.test_from_reference.position(column - shift.0, row - shift.1);
        *out = nearest(layer, x, y).unwrap_or(outside);
    }
    out
}

fn check(input: &EvalInput<'_>, config: &EvalConfig) -> Result<(), EvalError> {
    let positive = |name, value: f64| {
        if value.is_finite() && value > 0.0 { Ok(()) } else { Err(EvalError::NotPositive { name, value }) }
    };
    config.thresholds_m.iter().try_for_each(|&t| positive("a threshold", t))?;
    positive("the search radius", config.search_m)?;
    positive("the least height of what stands", config.standing_m)?;
    positive("the error below which a height is right", config.right_below_m)?;
    let (width, height) = (input.reference.width(), input.reference.height());
    let fits = |what, size: Option<(usize, usize)>| match size {
        Some((found_width, found_height)) if (found_width, found_height) != (width, height) => {
            Err(EvalError::Shape { what, found_width, found_height, width, height })
        }
        _ => Ok(()),
    };
    fits("class", input.classes.map(|g| (g.width(), g.height())))?;
    fits("mask", input.mask.map(|g| (g.width(), g.height())))?;
    fits("terrain", input.terrain.map(|g| (g.width(), g.height())))?;
    fits("building", input.objects.map(|g| (g.width(), g.height())))?;
    let (width, height) = (input.test.width(), input.test.height());
    let layers = [
        ("confidence", input.confidence.map(|g| (g.width(), g.height()))),
        ("standard deviation", input.sigma_m.map(|g| (g.width(), g.height()))),
        ("origin", input.origins.map(|g| (g.width(), g.height()))),
    ];
    for (what, size) in layers {
        if let Some((found_width, found_height)) = size.filter(|size| *size != (width, height)) {
            return Err(EvalError::Shape { what, found_width, found_height, width, height });
        }
    }
    if input.classes.is_none() && !config.skip.is_empty() {
        return Err(EvalError::SkipWithoutClasses);
    }
    Ok(())
}

/// Returns the reference without the cells that the class or the mask excludes.
fn counted(input: &EvalInput<'_>, skip: &[i32]) -> Grid<f32> {
    input.reference.without(|i| {
        let class = input.classes.and_then(|classes| *classes.data().get(i)?);
        let masked = input.mask.is_some_and(|mask| mask.data().get(i) == Some(&false));
        masked || class.is_some_and(|class| skip.contains(&class))
    })
}

/// Horizontal shift, and the summary of the method that found it.
#[derive(Default)]
struct HorizontalShift {
    /// Shift in reference cells.
    cells: (f64, f64),
    search: Option<SearchSummary>,
    nuth_kaab: Option<NuthKaabSummary>,
}

fn horizontal_shift(input: &EvalInput<'_>, config: &EvalConfig) -> Result<HorizontalShift, EvalError> {
    let (reference, metres_from_cells) = (input.reference, input.metres_from_cells);
    match config.alignment {
        AlignmentMethod::None | AlignmentMethod::Z => Ok(HorizontalShift::default()),
        AlignmentMethod::Xyz => {
            let (test, test_from_reference) = (input.test, input.test_from_reference);
            let search = Search { reference, test, test_from_reference, metres_from_cells, measure: Measure::Nmad };
            let (cells, summary) = search.run(config.search_m)?;
            Ok(HorizontalShift { cells, search: Some(summary), nuth_kaab: None })
        }
        AlignmentMethod::NuthKaab => {
            let at = |shift| differences(&moved(input, shift), reference).map(|&d| d as f32);
            if at((0.0, 0.0)).data().iter().all(|d| d.is_nan()) {
                let reference_cells = reference.data().iter().filter(|h| h.is_finite()).count();
                return Err(EvalError::NoOverlap { reference_cells });
            }
            let (cells, summary) = NuthKaab { reference, metres_from_cells, differences: &at }.run(config.search_m)?;
            Ok(HorizontalShift { cells, search: None, nuth_kaab: Some(summary) })
        }
    }
}

/// Returns the test at every reference cell, NaN where it is void. The test is moved by `shift`
/// reference cells.
fn moved(input: &EvalInput<'_>, shift: (f64, f64)) -> Grid<f64> {
    let mut heights = Grid::filled(input.reference.width(), input.reference.height(), f64::NAN);
    let width = input.reference.width().max(1);
    heights.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, heights)| {
        for (column, height) in heights.iter_mut().enumerate() {
            let (x, y) = input.test_from_reference.position(column as f64 - shift.0, row as f64 - shift.1);
            *height = bilinear(input.test, x, y).unwrap_or(f64::NAN);
        }
    });
    heights
}

/// Returns test − reference, NaN where either is void.
fn differences(test: &Grid<f64>, reference: &Grid<f32>) -> Grid<f64> {
    let cells = test.data().iter().zip(reference.data());
    let cells = cells.map(|(test, &h)| if h.is_finite() { test - f64::from(h) } else { f64::NAN }).collect();
    Grid::from_vec(reference.width(), reference.height(), cells).unwrap_or_else(|| Grid::filled(0, 0, f64::NAN))
}

fn finite(errors: &Grid<f64>) -> Vec<f64> {
    errors.data().iter().copied().filter(|e| e.is_finite()).collect()
}

/// Measures the overreach at the edges of buildings if the reference has their class, at all edges
/// otherwise.
fn roof_edges(input: &EvalInput<'_>, counted: &Grid<f32>, aligned: &Grid<f32>) -> Sharpness {
    let classes = input.classes.filter(|classes| classes.data().contains(&Some(BUILDING)));
    let counts = |cell: (usize, usize), _| {
        counted.get(cell.0, cell.1).is_some_and(|h| h.is_finite())
            && classes.is_none_or(|classes| classes.get(cell.0, cell.1) == Some(&Some(BUILDING)))
    };
    sharpness(input.reference, aligned, input.metres_from_cells, counts)
}

/// Judges the numbered buildings and the trees.
fn objects(
    input: &EvalInput<'_>,
    numbers: &Grid<Option<i32>>,
    counted: &Grid<f32>,
    errors: &Grid<f64>,
) -> ObjectsFound {
    Objects { reference: counted, errors, numbers, cell_area_m2: input.metres_from_cells.cell_area_m2() }.found()
}

/// Measures the overreach where a numbered building borders on anything else.
fn outlines(input: &EvalInput<'_>, numbers: &Grid<Option<i32>>, counted: &Grid<f32>, aligned: &Grid<f32>) -> Sharpness {
    let number = |(column, row): (usize, usize)| numbers.get(column, row).copied().flatten().unwrap_or(0);
    let counts = |high: (usize, usize), low| {
        let is_counted = counted.get(high.0, high.1).is_some_and(|h| h.is_finite());
        is_counted && number(high) > 0 && number(low) != number(high)
    };
    sharpness(input.reference, aligned, input.metres_from_cells, counts)
}

fn standing_of(input: &EvalInput<'_>, config: &EvalConfig, counted: &Grid<f32>, aligned: &Grid<f32>) -> Standing {
    let estimate;
    let terrain = match (input.terrain, ground_cells(input)) {
        (Some(terrain), _) => (terrain, TerrainSource::Given),
        (None, Some((classes, cells))) => {
            estimate = terrain_from_ground(input.reference, |i| classes.data().get(i) == Some(&Some(GROUND)));
            (&estimate, TerrainSource::GroundClass { cells })
        }
        (None, None) => {
            let source;
            (estimate, source) = estimated_terrain(input.reference, input.metres_from_cells);
            (&estimate, source)
        }
    };
    let counts = |i: usize| counted.data().get(i).is_some_and(|h| h.is_finite());
    let area = input.metres_from_cells.cell_area_m2();
    standing((input.reference, aligned), terrain, area, config.standing_m, counts)
}

/// Returns the classes and the number of ground cells of the reference, if these are enough for a
/// terrain.
fn ground_cells<'a>(input: &EvalInput<'a>) -> Option<(&'a Grid<Option<i32>>, usize)> {
    let classes = input.classes?;
    let valid = || input.reference.data().iter().zip(classes.data()).filter(|(h, _)| h.is_finite());
    let ground = valid().filter(|(_, class)| **class == Some(GROUND)).count();
    (ground as f64 >= LEAST_GROUND_SHARE * valid().count() as f64 && ground > 0).then_some((classes, ground))
}
