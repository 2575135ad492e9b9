//! Longitude and latitude of the cells of a map grid.
//!
//! Exact at the nodes of a lattice of 64 cells, bilinear between: on a map in metres the error is
//! about d² tan φ / 8R, hundredths of a millimetre for cells of 0.5 m.

use crs::{CrsError, MapProjection};
use geodesy::{GeodesyError, lon_near};
use raster::{GeoTransform, Grid};

/// Cells between nodes.
const SPACING: f64 = 64.0;

/// Positions of the cells of a grid.
#[derive(Debug, Clone)]
pub struct GridGround {
    nodes: Grid<[f64; 2]>,
}

impl GridGround {
    /// The positions of a grid of (columns, rows) `size`.
    ///
    /// # Errors
    /// A grid that reaches beyond its map.
    pub fn new(
        projection: &MapProjection,
        geotransform: &GeoTransform,
        size: (usize, usize),
    ) -> Result<Self, CrsError> {
        let count = |cells: usize| (cells as f64 / SPACING).ceil() as usize + 1;
        let (columns, rows) = (count(size.0), count(size.1));
        let at = |k: usize| geotransform.map_from_cell((k % columns) as f64 * SPACING, (k / columns) as f64 * SPACING);
        let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = (0..columns * rows).map(at).unzip();
        if projection.lonlat_from_map_slices(&mut lon, &mut lat)? > 0 {
            let (x, y) = geotransform.map_from_cell(0.0, 0.0);
            return Err(GeodesyError::OutsideDomain { x, y, crs: "the map of the grid".to_owned() }.into());
        }
        // No seam at the antimeridian.
        let first = lon.first().copied().unwrap_or(0.0);
        let mut nodes = Grid::filled(columns, rows, [0.0; 2]);
        for (node, (lon, lat)) in nodes.data_mut().iter_mut().zip(lon.into_iter().zip(lat)) {
            *node = [lon_near(lon, first), lat];
        }
        Ok(Self { nodes })
    }

    /// Longitude and latitude of a (column, row), degrees.
    #[inline]
    pub fn lonlat(&self, column: f64, row: f64) -> [f64; 2] {
        let along = |value: f64, nodes: usize| {
            let u = value / SPACING;
            let first = (u.max(0.0) as usize).min(nodes.saturating_sub(2));
            (first, u - first as f64)
        };
        let ((i, s), (j, t)) = (along(column, self.nodes.width()), along(row, self.nodes.height()));
        let (top, low) = (self.nodes.row(j), self.nodes.row(j + 1));
        [0, 1].map(|k| {
            let upper = top[i][k] + s * (top[i + 1][k] - top[i][k]);
            let lower = low[i][k] + s * (low[i + 1][k] - low[i][k]);
            upper + t * (lower - upper)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_those_of_the_projection() {
        let projection = MapProjection::from_epsg(32631).unwrap();
        let grid = GeoTransform::north_up(693_773.5, 4_822_631.5, 0.5);
        let ground = GridGround::new(&projection, &grid, (640, 1)).unwrap();
        for (c, r) in [(0.0, 0.0), (31.0, 0.0), (639.0, 0.0), (100.5, 0.0)] {
            let (x, y) = grid.map_from_cell(c, r);
            let (lon, lat) = projection.lonlat_from_map(x, y).unwrap();
            let [a, b] = ground.lonlat(c, r);
            assert!((a - lon).abs() < 5e-10 && (b - lat).abs() < 5e-10);
        }
    }
}
