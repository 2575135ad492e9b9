//! Heights of a grid at the pixels of a tile.
//!
//! Nothing is extrapolated and no void is bridged: a pixel has a height only if all cells that its
//! interpolation needs have one. Bicubic interpolation falls back to bilinear if its sixteen cells
//! are not complete.

use raster::{Grid, bicubic, bilinear};

use serde::{Deserialize, Serialize};

use crate::lattice::TileMap;

/// Interpolation of heights between the cells of a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reading {
    /// The nearest cell: steps stay steps.
    Nearest,
    /// Between four cells.
    #[default]
    Bilinear,
    /// Between sixteen cells (Keys, a = −1/2).
    Cubic,
}

impl Reading {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 3] = [
        ("nearest", Self::Nearest, "The nearest cell"),
        ("bilinear", Self::Bilinear, "Between four cells"),
        ("cubic", Self::Cubic, "Between sixteen cells"),
    ];
}

impl Reading {
    /// Returns the height at a (column, row) of a grid; NaN if there is none.
    #[inline]
    pub fn at(self, grid: &Grid<f32>, column: f64, row: f64) -> f32 {
        match self {
            Self::Nearest => nearest(grid, column, row),
            Self::Bilinear => bilinear(grid, column, row),
            Self::Cubic => bicubic(grid, column, row),
        }
    }
}

/// Returns the heights above `zero_m` (metres above the ellipsoid) at the `size × size` pixels of a
/// tile. `map` leads to the cells of `grid`.
pub fn heights_from_grid(grid: &Grid<f32>, map: &TileMap, size: usize, reading: Reading, zero_m: f64) -> Grid<f32> {
    let mut heights = Grid::filled(size, size, f32::NAN);
    for row in 0..size {
        for (column, height) in heights.row_mut(row).iter_mut().enumerate() {
            let [c, r, shift] = map.at(column as f64, row as f64);
            let found = reading.at(grid, c, r);
            *height = (f64::from(found) + (shift - zero_m)) as f32;
        }
    }
    heights
}

#[inline]
fn nearest(grid: &Grid<f32>, column: f64, row: f64) -> f32 {
    let (column, row) = ((column + 0.5).floor(), (row + 0.5).floor());
    // Casting saturates, so that positions beyond the integers lie outside of the grid too.
    let inside = column >= 0.0 && row >= 0.0;
    inside.then(|| grid.get(column as usize, row as usize)).flatten().copied().unwrap_or(f32::NAN)
}
