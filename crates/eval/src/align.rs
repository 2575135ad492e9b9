//! What is removed before two surfaces are compared.

use raster::GeoTransform;
use serde::Serialize;

/// How the evaluated surface is moved onto the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Alignment {
    /// Not at all.
    None,
    /// Vertically, by the median of the differences.
    Z,
    /// Horizontally by the translation with the least NMAD, then vertically by the median.
    Xyz,
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
}
