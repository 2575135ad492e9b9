//! A surface model as local positions: metres from an origin along the axes of its map.
//!
//! Slopes are differences to the neighbours: the smaller one where both sides agree in sign, zero
//! where they do not (minmod). So a cell beside a wall belongs to the roof or to the street and
//! does not lean on the wall.

use raster::{GeoTransform, Grid};

/// Slope above which a height difference is a wall between cells, metres per metre.
pub(super) const SLOPE_MAX: f64 = 2.0;

/// Heights on a map grid, with the origin of local positions.
#[derive(Debug, Clone, Copy)]
pub struct SplatSurface<'a> {
    heights: &'a Grid<f32>,
    geotransform: GeoTransform,
    origin: [f64; 3],
}

impl<'a> SplatSurface<'a> {
    /// Creates a surface on a map whose unit is the metre. NaN marks a void. The origin is easting,
    /// northing and height.
    pub fn new(heights: &'a Grid<f32>, geotransform: GeoTransform, origin: [f64; 3]) -> Self {
        Self { heights, geotransform, origin }
    }

    /// Returns a rounded origin in the middle of the grid, at its lowest height; `None` for a grid
    /// of voids.
    pub fn middle(heights: &Grid<f32>, geotransform: GeoTransform) -> Option<[f64; 3]> {
        let lowest = heights.data().iter().copied().filter(|h| h.is_finite()).reduce(f32::min)?;
        let middle = |cells: usize| (cells as f64 - 1.0) / 2.0;
        let (x, y) = geotransform.map_from_cell(middle(heights.width()), middle(heights.height()));
        Some([x.round(), y.round(), f64::from(lowest).floor()])
    }

    /// Heights on the map, metres.
    pub fn heights(&self) -> &'a Grid<f32> {
        self.heights
    }

    /// Position of the grid on the map.
    pub fn geotransform(&self) -> GeoTransform {
        self.geotransform
    }

    /// Origin of local positions: easting, northing, height.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Returns the local position of a (fractional) cell at a local height.
    pub fn position(&self, column: f64, row: f64, local_height_m: f64) -> [f64; 3] {
        let (x, y) = self.geotransform.map_from_cell(column, row);
        [x - self.origin[0], y - self.origin[1], local_height_m]
    }

    /// Returns the local height of a cell; NaN outside the grid and in voids.
    pub fn local_height(&self, column: i64, row: i64) -> f64 {
        let at = usize::try_from(column).ok().zip(usize::try_from(row).ok());
        let height = at.and_then(|(column, row)| self.heights.get(column, row));
        height.map_or(f64::NAN, |&h| f64::from(h) - self.origin[2])
    }

    /// Steps on the map of one column and of one row, metres.
    pub fn steps(&self) -> [[f64; 2]; 2] {
        let c = &self.geotransform.0;
        [[c[1], c[4]], [c[2], c[5]]]
    }

    /// Rise per column and per row at a cell, metres, limited to the steepest slope.
    pub(super) fn slope(&self, column: usize, row: usize) -> [f64; 2] {
        let (c, r) = (column as i64, row as i64);
        let here = self.local_height(c, r);
        let (width, height) = self.geotransform.cell_size();
        let along = |before: f64, after: f64, cell: f64| {
            let slope = minmod(here - before, after - here);
            slope.clamp(-SLOPE_MAX * cell, SLOPE_MAX * cell)
        };
        [
            along(self.local_height(c - 1, r), self.local_height(c + 1, r), width),
            along(self.local_height(c, r - 1), self.local_height(c, r + 1), height),
        ]
    }
}

fn minmod(before: f64, after: f64) -> f64 {
    match (before.is_finite(), after.is_finite()) {
        (true, true) if before * after > 0.0 => {
            if before.abs() < after.abs() {
                before
            } else {
                after
            }
        }
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_is_kept_and_a_wall_is_not_leant_on() {
        // Columns rise by half a metre, then jump by ten.
        let heights = Grid::from_vec(6, 1, vec![0.0, 0.5, 1.0, 11.0, 11.5, f32::NAN]).unwrap();
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(100.0, 50.0, 0.5), [100.0, 50.0, 0.0]);
        let slopes: Vec<f64> = (0..5).map(|c| surface.slope(c, 0)[0]).collect();
        assert_eq!(slopes, [0.0, 0.5, 0.5, 0.5, 0.0]);
        assert_eq!(surface.position(0.0, 0.0, 3.0), [0.25, -0.25, 3.0]);
        assert_eq!(SplatSurface::middle(&heights, surface.geotransform()), Some([102.0, 50.0, 0.0]));
        let void = Grid::filled(2, 2, f32::NAN);
        assert_eq!(SplatSurface::middle(&void, surface.geotransform()), None);
    }
}
