//! Planes through the known heights around voids.

use super::border::BorderCell;

/// Fewer border cells than this may fit a plane by chance.
const CELLS_MIN: f64 = 12.0;
/// Share of the border cells that must lie on the plane: some are outliers, as everywhere.
const SHARE_MIN: f64 = 0.9;

/// A plane of heights over the grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    origin: [f64; 2],
    /// Height at the origin, and its change per column and row, metres.
    terms: [f64; 3],
    /// Standard deviation of the border's heights around the plane, metres.
    pub(super) deviation_m: f32,
}

impl Plane {
    /// Returns the height in a cell, metres.
    pub(super) fn at(&self, [x, y]: [f32; 2]) -> f32 {
        let [h, slope_x, slope_y] = self.terms;
        (h + slope_x * (f64::from(x) - self.origin[0]) + slope_y * (f64::from(y) - self.origin[1])) as f32
    }
}

/// Sums over the border of a void, relative to its first cell.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    first: Option<[f64; 3]>,
    n: f64,
    x: f64,
    y: f64,
    h: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    xh: f64,
    yh: f64,
    /// Sum of squared distances to the plane, and number of cells on it.
    squares: f64,
    on_plane: f64,
}

impl Sums {
    fn add(&mut self, cell: &BorderCell) {
        let [x, y, h] = [cell.x, cell.y, cell.height_m].map(f64::from);
        let [x0, y0, h0] = *self.first.get_or_insert([x, y, h]);
        let (x, y, h) = (x - x0, y - y0, h - h0);
        self.n += 1.0;
        self.x += x;
        self.y += y;
        self.h += h;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.xh += x * h;
        self.yh += y * h;
    }

    /// Returns the plane of least squares; `None` for too few cells, or cells on a line.
    fn plane(&self) -> Option<Plane> {
        let [x0, y0, h0] = self.first.filter(|_| self.n >= CELLS_MIN)?;
        let (mx, my, mh) = (self.x / self.n, self.y / self.n, self.h / self.n);
        let (xx, xy, yy) = (self.xx - self.n * mx * mx, self.xy - self.n * mx * my, self.yy - self.n * my * my);
        let (xh, yh) = (self.xh - self.n * mx * mh, self.yh - self.n * my * mh);
        let determinant = xx * yy - xy * xy;
        if determinant <= 1e-6 * xx * yy {
            return None;
        }
        let (slope_x, slope_y) = ((xh * yy - yh * xy) / determinant, (yh * xx - xh * xy) / determinant);
        Some(Plane { origin: [x0 + mx, y0 + my], terms: [h0 + mh, slope_x, slope_y], deviation_m: 0.0 })
    }
}

/// Fits a plane to the border of each void, in the order of the voids' numbers from 1; `None` where
/// the border is not on one plane within `tolerance_m`.
pub(super) fn border_planes(cells: &[BorderCell], voids: u32, tolerance_m: f32) -> Vec<Option<Plane>> {
    let place = |cell: &BorderCell| cell.void as usize - 1;
    let mut sums = vec![Sums::default(); voids as usize];
    cells.iter().for_each(|cell| sums[place(cell)].add(cell));
    let mut planes: Vec<Option<Plane>> = sums.iter().map(Sums::plane).collect();
    for cell in cells {
        if let Some(plane) = planes[place(cell)] {
            let off = f64::from(cell.height_m - plane.at([cell.x, cell.y]));
            if off.abs() <= f64::from(tolerance_m) {
                sums[place(cell)].on_plane += 1.0;
                sums[place(cell)].squares += off * off;
            }
        }
    }
    for (plane, sums) in planes.iter_mut().zip(&sums) {
        *plane = plane
            .filter(|_| sums.on_plane >= SHARE_MIN * sums.n)
            .map(|plane| Plane { deviation_m: (sums.squares / sums.on_plane.max(1.0)).sqrt() as f32, ..plane });
    }
    planes
}
