//! Rectangular blocks of cells with their plane, and sums over rectangles that make them cheap to
//! fit.
//!
//! On a whole rectangle, columns and rows are uncorrelated, so the least-squares plane is z̄ + a (u
//! − ū) + b (v − v̄) with a = Σ (u − ū) z / Σ (u − ū)², and the sums come from tables of prefix
//! sums (Crow 1984) in four reads each. Heights are relative to the mean of the table, so that
//! squares keep their digits.

use raster::Grid;

use super::SplatSurface;

/// The plane of a block: local height at its middle, rise per column and per row, metres.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Plane {
    /// Local height at the middle of the block.
    pub middle_m: f64,
    /// Rise per column.
    pub by_column_m: f64,
    /// Rise per row.
    pub by_row_m: f64,
}

/// A rectangle of cells on one plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplatBlock {
    /// First column.
    pub column: usize,
    /// First row.
    pub row: usize,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Its plane.
    pub plane: Plane,
}

impl SplatBlock {
    /// The middle of the block in cells.
    pub fn middle(&self) -> [f64; 2] {
        let half = |n: usize| (n as f64 - 1.0) / 2.0;
        [self.column as f64 + half(self.width), self.row as f64 + half(self.height)]
    }

    /// The height of the plane at a cell, local metres.
    pub fn height_at(&self, column: f64, row: f64) -> f64 {
        let [c, r] = self.middle();
        self.plane.middle_m + self.plane.by_column_m * (column - c) + self.plane.by_row_m * (row - r)
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.width * self.height
    }
}

/// A rectangle of cells, relative to the corner of its table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rectangle {
    pub(super) column: usize,
    pub(super) row: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Rectangle {
    pub(super) fn cells(&self) -> usize {
        self.width * self.height
    }

    /// Returns both sides of a cut before column or row `at` of the rectangle.
    pub(super) fn cut(&self, along_columns: bool, at: usize) -> [Self; 2] {
        if along_columns {
            [Self { width: at, ..*self }, Self { column: self.column + at, width: self.width - at, ..*self }]
        } else {
            [Self { height: at, ..*self }, Self { row: self.row + at, height: self.height - at, ..*self }]
        }
    }
}

/// Number of sums: cells with a height, z, z u, z v, z², slopes by column and row; cells with a
/// colour, red, green, blue, and the squares of the colours.
const CHANNELS: usize = 12;

/// Sums over a rectangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums([f64; CHANNELS]);

/// Prefix sums over a part of a surface.
pub(super) struct Tables {
    column: usize,
    row: usize,
    stride: usize,
    /// Height that the others are relative to, metres.
    mean: f64,
    sums: Vec<[f64; CHANNELS]>,
}

/// A plane fitted to a rectangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub(super) plane: Plane,
    /// Sum of the squared distances to the plane, m².
    pub(super) squares: f64,
}

impl Tables {
    /// Computes the tables of a rectangle of the surface.
    pub(super) fn new(surface: &SplatSurface<'_>, colours: Option<&Grid<[f32; 3]>>, part: Rectangle) -> Self {
        let height = |column: usize, row: usize| surface.local_height(column as i64, row as i64);
        let cells = || {
            (part.row..part.row + part.height)
                .flat_map(|r| (part.column..part.column + part.width).map(move |c| (c, r)))
        };
        let (mut sum, mut count) = (0.0, 0usize);
        for z in cells().map(|(c, r)| height(c, r)).filter(|z| z.is_finite()) {
            (sum, count) = (sum + z, count + 1);
        }
        let mean = sum / count.max(1) as f64;
        let stride = part.width + 1;
        let mut sums = vec![[0.0; CHANNELS]; stride * (part.height + 1)];
        for v in 0..part.height {
            let mut along = [0.0; CHANNELS];
            for u in 0..part.width {
                let (column, row) = (part.column + u, part.row + v);
                let cell = cell_values(height(column, row) - mean, [u as f64, v as f64], surface.slope(column, row));
                let colour = colours.map_or([f32::NAN; 3], |colours| colours[(column, row)]).map(f64::from);
                let colour = if colour.iter().all(|c| c.is_finite()) {
                    [1.0, colour[0], colour[1], colour[2], colour.iter().map(|c| c * c).sum()]
                } else {
                    [0.0; 5]
                };
                for (i, value) in cell.into_iter().chain(colour).enumerate() {
                    along[i] += value;
                    sums[(v + 1) * stride + u + 1][i] = sums[v * stride + u + 1][i] + along[i];
                }
            }
        }
        Self { column: part.column, row: part.row, stride, mean, sums }
    }

    fn at(&self, u: usize, v: usize) -> &[f64; CHANNELS] {
        &self.sums[v * self.stride + u]
    }

    /// Returns the sums over a rectangle whose corner is relative to the corner of the table.
    pub(super) fn over(&self, part: Rectangle) -> Sums {
        let (left, right, top, bottom) = (part.column, part.column + part.width, part.row, part.row + part.height);
        let (a, b, c, d) = (self.at(left, top), self.at(right, top), self.at(left, bottom), self.at(right, bottom));
        Sums(std::array::from_fn(|i| d[i] - b[i] - c[i] + a[i]))
    }

    /// Fits the least-squares plane to a rectangle without voids.
    pub(super) fn fit(&self, part: Rectangle, sums: &Sums) -> Fit {
        let s = &sums.0;
        let count = part.cells() as f64;
        let middle = |first: usize, size: usize| first as f64 + (size as f64 - 1.0) / 2.0;
        let spread = |size: usize| (size * size) as f64 - 1.0;
        let (suu, svv) = (count * spread(part.width) / 12.0, count * spread(part.height) / 12.0);
        let z = s[1] / count;
        // A single column or row determines no slope across it: the mean of the cells' own slopes
        // is used.
        let along = |moment: f64, spread: f64, slope: f64| if spread > 0.0 { moment / spread } else { slope / count };
        let a = along(s[2] - middle(part.column, part.width) * s[1], suu, s[5]);
        let b = along(s[3] - middle(part.row, part.height) * s[1], svv, s[6]);
        let squares = (s[4] - count * z * z - a * a * suu - b * b * svv).max(0.0);
        Fit { plane: Plane { middle_m: z + self.mean, by_column_m: a, by_row_m: b }, squares }
    }

    /// Returns the block of a rectangle.
    pub(super) fn block(&self, part: Rectangle, plane: Plane) -> SplatBlock {
        let Rectangle { column, row, width, height } = part;
        SplatBlock { column: self.column + column, row: self.row + row, width, height, plane }
    }
}

fn cell_values(z: f64, [u, v]: [f64; 2], slope: [f64; 2]) -> [f64; 7] {
    if z.is_finite() { [1.0, z, z * u, z * v, z * z, slope[0], slope[1]] } else { [0.0; 7] }
}

impl Sums {
    /// Number of cells with a height.
    pub(super) fn with_height(&self) -> f64 {
        self.0[0]
    }

    /// Sum of the squared distances of the heights from their mean, m².
    pub(super) fn height_squares(&self) -> f64 {
        let s = &self.0;
        (s[4] - s[1] * s[1] / s[0].max(1.0)).max(0.0)
    }

    /// Sum of the squared distances of the colours from their mean, averaged over the channels.
    pub(super) fn colour_squares(&self) -> f64 {
        let s = &self.0;
        let sums = s[8] * s[8] + s[9] * s[9] + s[10] * s[10];
        (s[11] - sums / s[7].max(1.0)).max(0.0) / 3.0
    }

    /// Number of cells with a colour.
    pub(super) fn with_colour(&self) -> f64 {
        self.0[7]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use raster::GeoTransform;

    proptest! {
        /// Against the normal equations, written out.
        #[test]
        fn planes_are_those_of_least_squares(values in prop::collection::vec(-20.0..60.0f32, 63), w in 1..9usize, h in 1..7usize) {
            let heights = Grid::from_vec(9, 7, values).unwrap();
            let surface = SplatSurface::new(&heights, GeoTransform::north_up(0.0, 0.0, 1.0), [0.0, 0.0, 10.0]);
            let whole = Rectangle { column: 0, row: 0, width: 9, height: 7 };
            let tables = Tables::new(&surface, None, whole);
            let part = Rectangle { column: 9 - w, row: 7 - h, width: w, height: h };
            prop_assume!(w > 1 && h > 1);
            let fit = tables.fit(part, &tables.over(part));
            let block = tables.block(part, fit.plane);
            let residual = |c: usize, r: usize| surface.local_height(c as i64, r as i64) - block.height_at(c as f64, r as f64);
            let cells: Vec<(usize, usize)> = (7 - h..7).flat_map(|r| (9 - w..9).map(move |c| (c, r))).collect();
            let sum = |f: &dyn Fn(usize, usize) -> f64| cells.iter().map(|&(c, r)| f(c, r)).sum::<f64>();
            prop_assert!(sum(&residual).abs() < 1e-6);
            prop_assert!(sum(&|c, r| residual(c, r) * c as f64).abs() < 1e-5);
            prop_assert!(sum(&|c, r| residual(c, r) * r as f64).abs() < 1e-5);
            prop_assert!((sum(&|c, r| residual(c, r).powi(2)) - fit.squares).abs() < 1e-5);
        }
    }
}
