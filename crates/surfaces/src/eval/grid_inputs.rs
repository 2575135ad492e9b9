//! The inputs of a comparison of height grids, read and brought to one grid and one vertical datum.
//!
//! Where a file leaves something open, a choice is made here. Every choice that could be wrong is
//! noted for the report.

use eval::{CellMap, MetresFromCells};
use formats::points::{CellLattice, PointCloud, is_point_cloud};
use formats::raster::{Dem, read_dem};
use geodesy::MapPoint;
use raster::Grid;

use super::error::EvalJobError;
use super::grid_config::GridEvalConfig;
use super::grid_layers::TestLayers;
use super::on_reference::{
    cell_map, definition, metres_per_unit, metres_per_unit_at, numbers_on_reference, surface_on_reference,
};
use super::surface_doubts::undeclared_constant;
use super::vertical::{StatedDatums, bring_terrain};
use job::error::SettingError;

/// Cells beyond the search radius for which the map between the grids must hold: reach of the
/// interpolation.
const MARGIN_CELLS: f64 = 4.0;
/// A reference from points gets a note if a smaller share of its cells holds a point.
const SPARSE: f64 = 0.7;
/// LAS classes of points that were never classified.
const UNCLASSIFIED: [i32; 2] = [0, 1];

/// Inputs of a comparison of height grids.
pub(crate) struct GridInputs {
    pub(crate) test: Dem,
    pub(crate) reference: Dem,
    pub(crate) test_from_reference: CellMap,
    pub(crate) metres_from_cells: MetresFromCells,
    /// Classes on the reference grid, with their origin in words.
    pub(crate) classes: Option<(ClassGrid, String)>,
    /// Cells that count, on the reference grid.
    pub(crate) mask: Option<Grid<bool>>,
    /// Terrain heights on the reference grid, above the datum of the reference.
    pub(crate) terrain: Option<Grid<f32>>,
    /// Numbers of the buildings and trees on the reference grid.
    pub(crate) objects: Option<Grid<Option<i32>>>,
    /// Origin, standard deviation and confidence of the heights, on the grid of the test.
    pub(crate) layers: TestLayers,
    /// Vertical datum of both surfaces, in words.
    pub(crate) vertical: String,
    /// Choices and doubts that a reader must know.
    pub(crate) notes: Vec<String>,
}

impl GridInputs {
    /// Reads all inputs of a configuration.
    pub(crate) fn read(config: &GridEvalConfig) -> Result<Self, EvalJobError> {
        let mut notes = Vec::new();
        let mut test = read_dem(&config.test)?;
        let (reference, point_classes) = reference(config, &test, &mut notes)?;
        for dem in [&test, &reference] {
            if dem.crs_wkt.is_none() {
                notes.push(format!("no coordinate system, taken as that of the other file: {}", dem.path.display()));
            }
        }
        notes.extend([&test, &reference].into_iter().filter_map(undeclared_constant));
        let metres_from_cells = MetresFromCells::new(&reference.geotransform, metres_per_unit(&reference)?);
        let (along_columns, along_rows) = metres_from_cells.cell_size_m();
        let margin = config.search_m / along_columns.min(along_rows) + MARGIN_CELLS;
        // The search itself refuses a radius that is too large or not finite.
        let margin = if margin.is_finite() { margin.clamp(MARGIN_CELLS, 1e4) as usize } else { 0 };
        let test_from_reference = cell_map(&reference, &test.geotransform, definition(&test), margin)?;
        let stated = StatedDatums {
            test: config.test_vertical.or(test.vertical),
            reference: config.reference_vertical.or(reference.vertical),
        };
        let datum = stated.reconcile(&mut test, config.alignment, &mut notes)?;
        let classes = match &config.classes {
            Some(path) => {
                Some((numbers_on_reference(path, "class", &reference, &mut notes)?, path.display().to_string()))
            }
            None => point_classes.map(|classes| (classes, "those of the reference's points".to_owned())),
        };
        let mask = config.mask.as_deref().map(|path| numbers_on_reference(path, "mask", &reference, &mut notes));
        let objects = config.objects.as_deref();
        let objects = objects.map(|path| numbers_on_reference(path, "building", &reference, &mut notes)).transpose()?;
        let layers = TestLayers::read(config, &test, &mut notes)?;
        let terrain = config.terrain.as_deref().map(|path| -> Result<Grid<f32>, EvalJobError> {
            let mut terrain = read_dem(path)?;
            bring_terrain(&mut terrain, datum, &mut notes)?;
            surface_on_reference(&terrain, &reference)
        });
        Ok(Self {
            test_from_reference,
            metres_from_cells,
            classes,
            mask: mask.transpose()?.map(|mask| mask.map(|&value| value.is_some_and(|value| value != 0))),
            terrain: terrain.transpose()?,
            objects,
            layers,
            vertical: datum.map_or_else(|| "not stated".into(), |datum| datum.to_string()),
            test,
            reference,
            notes,
        })
    }
}

/// Classes of the cells, `None` where a cell has none.
type ClassGrid = Grid<Option<i32>>;

/// Reads the reference, and the classes of its points if it is a classified cloud.
fn reference(
    config: &GridEvalConfig,
    test: &Dem,
    notes: &mut Vec<String>,
) -> Result<(Dem, Option<ClassGrid>), EvalJobError> {
    if !is_point_cloud(&config.reference) {
        return Ok((read_dem(&config.reference)?, None));
    }
    let test_metres = metres_per_unit(test)?;
    let (along_columns, along_rows) = MetresFromCells::new(&test.geotransform, test_metres).cell_size_m();
    let cell_m = config.reference_cell_m.unwrap_or(along_columns.max(along_rows));
    if !(cell_m.is_finite() && cell_m > 0.0) {
        return Err(SettingError::new("the cell size of the reference", cell_m, "a positive number of metres").into());
    }
    let cloud = PointCloud::open(&config.reference)?;
    let metres = metres_per_unit_at(cloud.crs_definition(), cloud.centre().y, &config.reference)?;
    // Anchored at the corner of the test grid: if the cells have the same size, nothing is
    // interpolated.
    let anchor = MapPoint { x: test.geotransform.0[0], y: test.geotransform.0[3] };
    let lattice = CellLattice { cell_x: cell_m / metres.0, cell_y: cell_m / metres.1, anchor };
    let gridded = cloud.highest(lattice)?;
    let (dem, classes) = (gridded.dem, gridded.classes);
    let filled = dem.heights.data().iter().filter(|h| h.is_finite()).count();
    let share = filled as f64 / dem.heights.data().len().max(1) as f64;
    notes.push(format!(
        "the reference is a point cloud: the highest of {} points in each cell of {cell_m} m ({} left out)",
        gridded.points, gridded.left_out
    ));
    if share < SPARSE {
        notes
            .push(format!("only {:.0} % of the reference's cells hold a point: larger cells hold more", 100.0 * share));
    }
    let classified = classes.data().iter().flatten().any(|class| !UNCLASSIFIED.contains(class));
    Ok((dem, classified.then_some(classes)))
}
