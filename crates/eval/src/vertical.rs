//! Conversion of a grid of heights from one vertical datum to another.
//!
//! The difference of two datums at a position hardly depends on the height there and changes
//! slowly. It is evaluated on a lattice of cells and interpolated bilinearly (geoid grids have 15′
//! and more between their nodes). For grids of coarse cells the lattice is finer, down to every
//! cell.

use crs::{CrsError, HeightConverter, MapProjection};
use raster::{GeoTransform, Grid};

/// Largest distance of the lattice's nodes, metres on the ground.
const SPACING_M: f64 = 500.0;
/// Largest distance of the lattice's nodes, cells.
const SPACING_CELLS: f64 = 64.0;

/// Converts the heights of a grid in place, from the datum of `from` to the datum of `to`.
///
/// `projection` belongs to the grid's map coordinates. `cell_m` is the longer side of a cell in
/// metres. A cell becomes void where a geoid grid has no value.
///
/// # Errors
/// [`CrsError`] if PROJ cannot make a transformation.
pub fn convert_heights(
    heights: &mut Grid<f32>,
    geotransform: &GeoTransform,
    cell_m: f64,
    projection: &MapProjection,
    from: &HeightConverter,
    to: &HeightConverter,
) -> Result<(), CrsError> {
    let spacing = (SPACING_M / cell_m).clamp(1.0, SPACING_CELLS).floor() as usize;
    let (width, height) = (heights.width(), heights.height());
    let nodes = lattice(width, height, spacing, geotransform, projection, from, to)?;
    for row in 0..height {
        let (j, v) = (row / spacing, (row % spacing) as f64 / spacing as f64);
        for (column, cell) in heights.row_mut(row).iter_mut().enumerate() {
            let (i, u) = (column / spacing, (column % spacing) as f64 / spacing as f64);
            let (top, low) = (between(&nodes, i, j, u), between(&nodes, i, j + 1, u));
            *cell = (f64::from(*cell) + top + v * (low - top)) as f32;
        }
    }
    Ok(())
}

/// Returns the height difference between the datums at every `spacing`-th cell, and at one node
/// past the last.
fn lattice(
    width: usize,
    height: usize,
    spacing: usize,
    geotransform: &GeoTransform,
    projection: &MapProjection,
    from: &HeightConverter,
    to: &HeightConverter,
) -> Result<Grid<f64>, CrsError> {
    let mut nodes = Grid::filled(width / spacing + 2, height / spacing + 2, 0.0);
    for j in 0..nodes.height() {
        let at = |i: usize| geotransform.map_from_cell((i * spacing) as f64, (j * spacing) as f64);
        let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = (0..nodes.width()).map(at).unzip();
        projection.lonlat_from_map_slices(&mut lon, &mut lat)?;
        from.ellipsoid_from_datum_slices(&lon, &lat, nodes.row_mut(j))?;
        to.datum_from_ellipsoid_slices(&lon, &lat, nodes.row_mut(j))?;
    }
    Ok(nodes)
}

fn between(nodes: &Grid<f64>, i: usize, j: usize, u: f64) -> f64 {
    let (left, right) = (nodes[(i, j)], nodes[(i + 1, j)]);
    left + u * (right - left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::VerticalDatum;

    #[test]
    fn the_lattice_agrees_with_the_conversion_of_each_cell_and_back() {
        let geotransform = GeoTransform::north_up(436_078.0, 3_357_752.0, 0.5);
        let projection = MapProjection::from_epsg(32617).unwrap();
        let (ellipsoid, egm96) = (
            HeightConverter::new(VerticalDatum::Ellipsoid).unwrap(),
            HeightConverter::new(VerticalDatum::Egm96).unwrap(),
        );
        let mut heights = Grid::filled(150, 130, 12.5f32);
        heights[(3, 4)] = f32::NAN;
        convert_heights(&mut heights, &geotransform, 0.5, &projection, &egm96, &ellipsoid).unwrap();
        for (column, row) in [(0, 0), (149, 129), (77, 64), (63, 65)] {
            let (x, y) = geotransform.map_from_cell(column as f64, row as f64);
            let (lon, lat) = projection.lonlat_from_map(x, y).unwrap();
            let expected = egm96.ellipsoid_from_datum(lon, lat, 12.5).unwrap();
            assert!((f64::from(heights[(column, row)]) - expected).abs() < 1e-5, "{expected}");
            assert!((expected - 12.5).abs() > 10.0, "the geoid is far from the ellipsoid in Florida: {expected}");
        }
        assert!(heights[(3, 4)].is_nan());
        convert_heights(&mut heights, &geotransform, 0.5, &projection, &ellipsoid, &egm96).unwrap();
        assert!((heights[(100, 100)] - 12.5).abs() < 1e-5);
    }
}
