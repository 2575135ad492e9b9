//! Co-registration methods, and the shift that they find.

use raster::GeoTransform;
use serde::{Deserialize, Serialize};

/// Method that moves the evaluated surface onto the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum AlignmentMethod {
    /// No shift.
    None,
    /// Vertical shift by the median of the differences.
    Z,
    /// Horizontal shift with the least NMAD, then a vertical shift by the median.
    Xyz,
    /// Horizontal shift from the dependence of the differences on slope and aspect (Nuth and Kääb
    /// 2011), then a vertical shift by the median.
    NuthKaab,
}

impl AlignmentMethod {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 4] = [
        ("none", Self::None, "Nothing is removed"),
        ("z", Self::Z, "The median of the differences"),
        ("xyz", Self::Xyz, "The translation with the least NMAD, then the median of the differences"),
        (
            "nuth-kaab",
            Self::NuthKaab,
            "The translation that follows from slopes and aspects (Nuth and Kääb 2011), then the median of the differences",
        ),
    ];
}

/// Translation that was added to the test surface, metres. x and y are along the axes of the
/// reference's map, z is up.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Shift {
    /// Along the map's x axis (east for UTM).
    pub dx_m: f64,
    /// Along the map's y axis (north for UTM).
    pub dy_m: f64,
    /// Upwards.
    pub dz_m: f64,
}

/// Linear map from steps in cells to metres along the map's axes. The first column of the matrix is
/// a step of one column, the second a step of one row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MetresFromCells([[f64; 2]; 2]);

impl MetresFromCells {
    /// Returns the map of a grid whose map units are `metres_per_unit` metres long along x and y.
    /// Use (1, 1) for UTM, and the lengths of a degree at the middle of the grid for degrees.
    ///
    /// ```
    /// use eval::MetresFromCells;
    /// use raster::GeoTransform;
    ///
    /// let grid = GeoTransform::north_up(500_000.0, 4_000_000.0, 0.5);
    /// let metres = MetresFromCells::new(&grid, (1.0, 1.0));
    /// assert_eq!(metres.apply(3.0, 2.0), (1.5, -1.0));
    /// ```
    pub fn new(geotransform: &GeoTransform, metres_per_unit: (f64, f64)) -> Self {
        let (c, (ux, uy)) = (&geotransform.0, metres_per_unit);
        Self([[c[1] * ux, c[2] * ux], [c[4] * uy, c[5] * uy]])
    }

    /// Returns the metres along x and y of a step in cells.
    pub fn apply(&self, columns: f64, rows: f64) -> (f64, f64) {
        let m = &self.0;
        (m[0][0] * columns + m[0][1] * rows, m[1][0] * columns + m[1][1] * rows)
    }

    /// Returns the step in columns and rows for metres along x and y. It is not finite if the cells
    /// have no area.
    pub fn cells(&self, dx_m: f64, dy_m: f64) -> (f64, f64) {
        let (m, det) = (&self.0, self.determinant());
        ((m[1][1] * dx_m - m[0][1] * dy_m) / det, (m[0][0] * dy_m - m[1][0] * dx_m) / det)
    }

    /// Returns the gradient along x and y, in metres per metre, of heights that rise by
    /// `per_column` and `per_row` metres per cell.
    pub fn gradient(&self, per_column: f64, per_row: f64) -> (f64, f64) {
        let (m, det) = (&self.0, self.determinant());
        ((m[1][1] * per_column - m[1][0] * per_row) / det, (m[0][0] * per_row - m[0][1] * per_column) / det)
    }

    /// Returns the map for cells that are `scale` times as long.
    pub(crate) fn scaled(&self, scale: f64) -> Self {
        Self(self.0.map(|row| row.map(|m| m * scale)))
    }

    /// Returns the area of a cell, square metres.
    pub fn cell_area_m2(&self) -> f64 {
        self.determinant().abs()
    }

    fn determinant(&self) -> f64 {
        self.0[0][0] * self.0[1][1] - self.0[0][1] * self.0[1][0]
    }

    /// Returns the sides of a cell along columns and rows, metres.
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
