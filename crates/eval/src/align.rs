//! What is removed before two surfaces are compared.

use raster::GeoTransform;
use serde::{Deserialize, Serialize};

/// How the evaluated surface is moved onto the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Alignment {
    /// Not at all.
    None,
    /// Vertically, by the median of the differences.
    Z,
    /// Horizontally by the translation with the least NMAD, then vertically by the median.
    Xyz,
    /// Horizontally by the dependence of the differences on slope and aspect (Nuth and Kääb 2011), then by the median.
    NuthKaab,
}

/// A translation, metres: what was added to the test surface. x and y are along the axes of the reference's map, z is up.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Shift {
    /// Along the map's x axis (east for UTM).
    pub dx_m: f64,
    /// Along the map's y axis (north for UTM).
    pub dy_m: f64,
    /// Upwards.
    pub dz_m: f64,
}

/// Metres along the map's axes for a step of one column (first column of the matrix) and of one row (second).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MetresFromCells([[f64; 2]; 2]);

impl MetresFromCells {
    /// For a grid whose map units are `metres_per_unit` metres long along x and y: (1, 1) for UTM; for degrees the lengths of
    /// a degree at the middle of the grid.
    pub fn new(geotransform: &GeoTransform, metres_per_unit: (f64, f64)) -> Self {
        let (c, (ux, uy)) = (&geotransform.0, metres_per_unit);
        Self([[c[1] * ux, c[2] * ux], [c[4] * uy, c[5] * uy]])
    }

    /// The metres along x and y of a step in cells.
    pub fn apply(&self, columns: f64, rows: f64) -> (f64, f64) {
        let m = &self.0;
        (m[0][0] * columns + m[0][1] * rows, m[1][0] * columns + m[1][1] * rows)
    }

    /// The step in columns and rows of metres along x and y; not finite when the cells have no area.
    pub fn cells(&self, dx_m: f64, dy_m: f64) -> (f64, f64) {
        let (m, det) = (&self.0, self.determinant());
        ((m[1][1] * dx_m - m[0][1] * dy_m) / det, (m[0][0] * dy_m - m[1][0] * dx_m) / det)
    }

    /// The gradient along x and y (metres per metre) of heights that rise by so many metres per column and per row.
    pub fn gradient(&self, per_column: f64, per_row: f64) -> (f64, f64) {
        let (m, det) = (&self.0, self.determinant());
        ((m[1][1] * per_column - m[1][0] * per_row) / det, (m[0][0] * per_row - m[0][1] * per_column) / det)
    }

    /// For cells that are `scale` times as long.
    pub(crate) fn scaled(&self, scale: f64) -> Self {
        Self(self.0.map(|row| row.map(|m| m * scale)))
    }

    /// The area of a cell, square metres.
    pub fn cell_area_m2(&self) -> f64 {
        self.determinant().abs()
    }

    fn determinant(&self) -> f64 {
        self.0[0][0] * self.0[1][1] - self.0[0][1] * self.0[1][0]
    }

    /// Sides of a cell along columns and rows, metres.
    pub fn cell_size_m(&self) -> (f64, f64) {
        let m = &self.0;
        (m[0][0].hypot(m[1][0]), m[0][1].hypot(m[1][1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_down_is_a_step_south() {
        let metres = MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, 0.5), (1.0, 1.0));
        assert_eq!(metres.apply(3.0, 2.0), (1.5, -1.0));
        assert_eq!(metres.cell_size_m(), (0.5, 0.5));
    }

    #[test]
    fn cells_and_gradients_are_met_on_turned_cells_too() {
        let turned = MetresFromCells::new(&GeoTransform([0.0, 0.4, 0.3, 0.0, 0.3, -0.4]), (1.0, 1.0));
        let (dx, dy) = turned.apply(2.0, -3.0);
        let (columns, rows) = turned.cells(dx, dy);
        assert!((columns - 2.0).abs() < 1e-12 && (rows + 3.0).abs() < 1e-12);
        // Heights 0.7 x - 0.2 y.
        let rise = |columns, rows| {
            let (x, y) = turned.apply(columns, rows);
            0.7 * x - 0.2 * y
        };
        let (gx, gy) = turned.gradient(rise(1.0, 0.0), rise(0.0, 1.0));
        assert!((gx - 0.7).abs() < 1e-12 && (gy + 0.2).abs() < 1e-12);
        assert!((turned.cell_area_m2() - 0.25).abs() < 1e-12);
    }
}
