//! Planes of a surface, grown from its smoothest places, and how flat the surface is around a cell.
//!
//! A plane grows over the cells that lie within a tolerance of it; the least-squares plane follows
//! as it grows. On a surface that is curved with a radius R, a plane of the area A leaves a
//! residual r ≈ A / (22 R). So A / r tells the radius of curvature, whatever the tolerance: crowns
//! have radii of a few metres, roofs are flat between their edges.

use raster::Grid;

use crate::regions::beside;

/// Half-width of the windows from which planes start, cells: the fewest that tell a residual.
pub(crate) const START_REACH: usize = 2;
/// Growth of the number of cells after which the plane is fitted again.
const REFIT: f64 = 1.4;
/// Area of a cell that lies on no plane, as a share of the smallest area that tells anything: it
/// keeps its logarithm finite.
const NO_PLANE_CELLS: f64 = 2.0;
/// Residual that stands for cells in no window, metres: a broken crown.
const BROKEN_M: f32 = 2.0;

/// Planes on a surface.
pub(crate) struct Planes {
    /// Number of the plane of each cell, from 1; 0 is none.
    pub(crate) numbers: Grid<u32>,
    /// Cells of each plane; the first is for cells without one.
    pub(crate) cells: Vec<usize>,
}

/// Sums of a least-squares plane, relative to the cell it starts from.
#[derive(Debug, Clone, Copy, Default)]
struct Fit {
    n: f64,
    x: f64,
    y: f64,
    z: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    xz: f64,
    yz: f64,
}

impl Fit {
    fn add(&mut self, x: f64, y: f64, z: f64) {
        self.n += 1.0;
        self.x += x;
        self.y += y;
        self.z += z;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.xz += x * z;
        self.yz += y * z;
    }

    /// The plane as height at the start, and rise per cell along both axes.
    fn plane(&self) -> [f64; 3] {
        let [x, y, z] = [self.x, self.y, self.z].map(|sum| sum / self.n);
        let (a, b, c) = (self.xx / self.n - x * x, self.xy / self.n - x * y, self.yy / self.n - y * y);
        let (p, q) = (self.xz / self.n - x * z, self.yz / self.n - y * z);
        let determinant = a * c - b * b;
        if determinant < 1e-9 {
            return [z, 0.0, 0.0];
        }
        let (along, across) = ((p * c - q * b) / determinant, (q * a - p * b) / determinant);
        [z - along * x - across * y, along, across]
    }
}

/// Grows planes over the cells that `count`, within `tolerance_m` of each.
pub(crate) fn planes(surface: &Grid<f32>, counts: &Grid<bool>, residuals: &Grid<f32>, tolerance_m: f64) -> Planes {
    let (width, height) = (surface.width(), surface.height());
    let is_start = |at: usize| counts.data()[at] && f64::from(residuals.data()[at]) <= tolerance_m;
    let mut starts: Vec<usize> = (0..width * height).filter(|at| is_start(*at)).collect();
    starts.sort_by(|a, b| residuals.data()[*a].total_cmp(&residuals.data()[*b]).then(a.cmp(b)));
    let mut numbers = Grid::filled(width, height, 0u32);
    let mut sizes = vec![0];
    for start in starts {
        if numbers.data()[start] != 0 {
            continue;
        }
        let number = sizes.len() as u32;
        let (column, row) = ((start % width) as f64, (start / width) as f64);
        let base = f64::from(surface.data()[start]);
        let place =
            |at: usize| ((at % width) as f64 - column, (at / width) as f64 - row, f64::from(surface.data()[at]) - base);
        let mut window = Fit::default();
        for y in (start / width).saturating_sub(START_REACH)..(start / width + START_REACH + 1).min(height) {
            for x in (start % width).saturating_sub(START_REACH)..(start % width + START_REACH + 1).min(width) {
                if counts[(x, y)] {
                    let (dx, dy, dz) = place(y * width + x);
                    window.add(dx, dy, dz);
                }
            }
        }
        let (mut plane, mut fit, mut refit_at) = (window.plane(), Fit::default(), REFIT * window.n);
        let (mut cells, mut next) = (vec![start], 0);
        numbers.data_mut()[start] = number;
        while let Some(&at) = cells.get(next) {
            next += 1;
            let (x, y, z) = place(at);
            fit.add(x, y, z);
            if fit.n >= refit_at {
                (plane, refit_at) = (fit.plane(), REFIT * fit.n);
            }
            for near in beside(width, height, at) {
                if numbers.data()[near] != 0 || !counts.data()[near] {
                    continue;
                }
                let (x, y, z) = place(near);
                if (z - plane[0] - plane[1] * x - plane[2] * y).abs() < tolerance_m {
                    numbers.data_mut()[near] = number;
                    cells.push(near);
                }
            }
        }
        sizes.push(cells.len());
    }
    Planes { numbers, cells: sizes }
}

/// Returns the area of the planes over their residual around each cell that `counts`, square metres
/// per metre: geometric means over the cells that count within `reach` cells along both axes.
pub(crate) fn flatness(
    planes: &Planes,
    roughness: &Grid<f32>,
    counts: &Grid<bool>,
    (reach, cell_m): (usize, f64),
    least_m: f64,
) -> Grid<f32> {
    let mut logarithms = roughness.map(|_| 0.0f64);
    for (at, cell) in logarithms.data_mut().iter_mut().enumerate().filter(|(at, _)| counts.data()[*at]) {
        let number = planes.numbers.data()[at] as usize;
        let cells = if number == 0 { NO_PLANE_CELLS } else { planes.cells[number] as f64 };
        let rough_m = f64::from(roughness.data()[at].min(BROKEN_M)).max(least_m);
        *cell = (cells * cell_m * cell_m / rough_m).ln();
    }
    let (sums, known) = (box_sums(&logarithms, reach), box_sums(&counts.map(|is| f64::from(u8::from(*is))), reach));
    let mut flat = roughness.map(|_| 0.0f32);
    for (at, cell) in flat.data_mut().iter_mut().enumerate().filter(|(at, _)| counts.data()[*at]) {
        *cell = (sums.data()[at] / known.data()[at].max(1.0)).exp() as f32;
    }
    flat
}

/// Sums over the cells within `reach` along both axes.
pub(crate) fn box_sums(values: &Grid<f64>, reach: usize) -> Grid<f64> {
    let (width, height) = (values.width(), values.height());
    let mut along = values.clone();
    for row in 0..height {
        let mut until = vec![0.0; width + 1];
        for (x, value) in values.row(row).iter().enumerate() {
            until[x + 1] = until[x] + value;
        }
        for (x, sum) in along.row_mut(row).iter_mut().enumerate() {
            *sum = until[(x + reach + 1).min(width)] - until[x.saturating_sub(reach)];
        }
    }
    let mut sums = values.map(|_| 0.0);
    for row in 0..height {
        for near in row.saturating_sub(reach)..(row + reach + 1).min(height) {
            for (sum, value) in sums.row_mut(row).iter_mut().zip(along.row(near)) {
                *sum += value;
            }
        }
    }
    sums
}
