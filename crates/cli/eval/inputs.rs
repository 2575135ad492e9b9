//! Two surface models, classes, mask and terrain, read and brought to one grid and one vertical datum.
//!
//! What a file leaves open is decided here, and every decision that could be wrong is noted for the output.

use std::path::Path;

use anyhow::ensure;
use eval::{Alignment, CellMap, MetresFromCells};
use io::points::{PointCloud, is_point_cloud};
use io::raster::{Dem, read_dem};
use raster::Grid;

use super::Args;
use super::grids::{
    cell_map, definition, metres_per_unit, metres_per_unit_at, numbers_on_reference, surface_on_reference,
};
use super::vertical::{Stated, bring_terrain};

/// Cells beyond the search radius for which the map between the grids must hold.
const MARGIN_CELLS: f64 = 4.0;
/// A reference made from points is worth a note when fewer of its cells hold one.
const SPARSE: f64 = 0.7;
/// Classes of points that nobody has classified.
const UNCLASSIFIED: [i32; 2] = [0, 1];

/// What is compared.
pub(super) struct Inputs {
    pub(super) test: Dem,
    pub(super) reference: Dem,
    pub(super) test_from_reference: CellMap,
    pub(super) metres_from_cells: MetresFromCells,
    /// On the reference grid, with where they come from.
    pub(super) classes: Option<(Grid<Option<i32>>, String)>,
    /// On the reference grid.
    pub(super) mask: Option<Grid<bool>>,
    /// On the reference grid, above its datum.
    pub(super) terrain: Option<Grid<f32>>,
    pub(super) confidence: Option<Grid<f32>>,
    /// The datum of both, in words.
    pub(super) vertical: String,
    /// Decisions and doubts.
    pub(super) notes: Vec<String>,
}

impl Inputs {
    pub(super) fn read(args: &Args, alignment: Alignment) -> anyhow::Result<Self> {
        let mut notes = Vec::new();
        let mut test = read_dem(&args.test)?;
        let (reference, point_classes) = reference(args, &test, &mut notes)?;
        for dem in [&test, &reference] {
            if dem.crs_wkt.is_none() {
                notes.push(format!("no coordinate system, taken as that of the other file: {}", dem.path.display()));
            }
        }
        let metres_from_cells = MetresFromCells::new(&reference.geotransform, metres_per_unit(&reference)?);
        let (along_columns, along_rows) = metres_from_cells.cell_size_m();
        let margin = args.search_m / along_columns.min(along_rows) + MARGIN_CELLS;
        // A radius that is too wide, or no number, is refused by the search itself.
        let margin = if margin.is_finite() { margin.clamp(MARGIN_CELLS, 1e4) as usize } else { 0 };
        let test_from_reference = cell_map(&reference, &test.geotransform, definition(&test), margin)?;
        let stated =
            Stated { test: args.test_vertical.or(test.vertical), reference: args.ref_vertical.or(reference.vertical) };
        let datum = stated.reconcile(&mut test, alignment, &mut notes)?;
        let classes = match &args.classes {
            Some(path) => {
                Some((numbers_on_reference(path, "class", &reference, &mut notes)?, path.display().to_string()))
            }
            None => point_classes.map(|classes| (classes, "those of the reference's points".to_owned())),
        };
        let mask = args.mask.as_deref().map(|path| numbers_on_reference(path, "mask", &reference, &mut notes));
        let confidence = args.confidence.as_deref().map(|path| on_test_grid(path, &test)).transpose()?;
        let terrain = args.dtm.as_deref().map(|path| -> anyhow::Result<Grid<f32>> {
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
            confidence,
            vertical: datum.map_or_else(|| "not stated".into(), |datum| datum.to_string()),
            test,
            reference,
            notes,
        })
    }
}

/// A raster on the very grid of the test.
fn on_test_grid(path: &Path, test: &Dem) -> anyhow::Result<Grid<f32>> {
    let found = read_dem(path)?;
    let size = |dem: &Dem| (dem.heights.width(), dem.heights.height());
    ensure!(
        size(&found) == size(test) && found.geotransform == test.geotransform,
        "found {:?} cells from {:?}, expected the grid of {} ({:?} cells): {}",
        size(&found),
        found.geotransform.0,
        test.path.display(),
        size(test),
        path.display()
    );
    Ok(found.heights)
}

/// The reference, and the classes of its points where it is a classified cloud.
fn reference(args: &Args, test: &Dem, notes: &mut Vec<String>) -> anyhow::Result<(Dem, Option<Grid<Option<i32>>>)> {
    if !is_point_cloud(&args.reference) {
        return Ok((read_dem(&args.reference)?, None));
    }
    let test_metres = metres_per_unit(test)?;
    let (along_columns, along_rows) = MetresFromCells::new(&test.geotransform, test_metres).cell_size_m();
    let cell_m = args.ref_cell.unwrap_or(along_columns.max(along_rows));
    ensure!(cell_m.is_finite() && cell_m > 0.0, "--ref-cell is {cell_m}, expected a positive number of metres");
    let cloud = PointCloud::open(&args.reference)?;
    let metres = metres_per_unit_at(cloud.crs_definition(), cloud.centre().1, &args.reference)?;
    // The corners of the test's cells, where its grid is of the same kind: then nothing is interpolated.
    let anchor = (test.geotransform.0[0], test.geotransform.0[3]);
    let gridded = cloud.highest((cell_m / metres.0, cell_m / metres.1), anchor)?;
    let (dem, classes) = (gridded.dem, gridded.classes);
    let filled = dem.heights.data().iter().filter(|h| h.is_finite()).count();
    let share = filled as f64 / dem.heights.data().len().max(1) as f64;
    notes.push(format!(
        "the reference is a point cloud: the highest of {} points in each cell of {cell_m} m ({} left out)",
        gridded.points, gridded.left_out
    ));
    if share < SPARSE {
        notes.push(format!("only {:.0} % of the reference's cells hold a point: see --ref-cell", 100.0 * share));
    }
    let classified = classes.data().iter().flatten().any(|class| !UNCLASSIFIED.contains(class));
    Ok((dem, classified.then_some(classes)))
}
