//! Forests: wide areas in which hardly any cell lies on a plane with its neighbours.
//!
//! In surfaces made from images the crowns of a forest run into each other, and the ground between
//! them is not seen. Such areas are no evidence of the ground, however high or low they lie.

use raster::Grid;
use rayon::prelude::*;

use crate::coarse::{blurred, widened};
use crate::regions::{Regions, quantile};

/// Half-width of the surroundings that a plane is fitted to, metres: less than a crown.
const PLANE_HALF_WIDTH_M: f64 = 2.0;
/// Deviation from that plane above which a cell is rough, metres: the noise of satellite surfaces.
/// Crowns deviate by one to two metres.
const ROUGH_M: f32 = 0.5;
/// Half-width of the surroundings that a forest fills, metres: more than the walls and trees along
/// a street are apart.
const FOREST_HALF_WIDTH_M: f64 = 20.0;
/// Distance from such a cell within which rough cells belong to its forest, metres: those that its
/// surroundings hold.
const FRINGE_M: f64 = 20.0;
/// Share of rough cells in the surroundings of a cell of a forest.
const FOREST_SHARE: f32 = 0.7;
/// Smallest forest, square metres. Smaller groves have ground around them that tells them.
const FOREST_MIN_M2: f64 = 1000.0;
/// Side of the blocks whose lowest cells are compared, metres: a crown and a gap.
const BLOCK_M: f64 = 10.0;
/// Deviation of these cells from the planes around them from which they show no ground, metres.
/// Ground between crowns deviates by 0.1 to 0.9 m, the lower side of a canopy by 1.5 m and more.
const CLOSED_M: f32 = 1.0;
/// Smallest clearing, square metres: what is smooth and smaller may be a gap between crowns that
/// does not reach down to the ground.
const CLEARING_MIN_M2: f64 = 150.0;

/// Returns the cells of forests that hide their ground, and are wider than `widest_m`: the widest
/// window reaches across smaller ones. Where the lowest cells of a rough area agree on one level,
/// they show the ground between the crowns, and the area is left to the openings.
pub(crate) fn forests(surface: &Grid<f32>, cell_m: f64, widest_m: f64) -> Grid<bool> {
    let cells = |metres: f64| (metres / cell_m).round() as usize;
    let radius = cells(PLANE_HALF_WIDTH_M);
    let nowhere = surface.map(|_| false);
    if radius == 0 {
        return nowhere;
    }
    let roughness = roughness(surface, radius);
    let is_rough = roughness.map(|&deviation| deviation > ROUGH_M);
    let share = blurred(&is_rough.map(|&is| if is { 1.0 } else { 0.0 }), cells(FOREST_HALF_WIDTH_M));
    let known = blurred(&roughness.map(|h| if h.is_nan() { 0.0 } else { 1.0 }), cells(FOREST_HALF_WIDTH_M));
    let mut is_inner = is_rough.clone();
    for ((is_inner, share), known) in is_inner.data_mut().iter_mut().zip(share.data()).zip(known.data()) {
        *is_inner &= *share >= FOREST_SHARE * known;
    }
    without_small(&mut is_inner, FOREST_MIN_M2 / (cell_m * cell_m));
    if !is_inner.data().contains(&true) {
        return nowhere;
    }
    let mut is_forest = widened(&is_inner, cells(FRINGE_M));
    is_forest.data_mut().iter_mut().zip(is_rough.data()).for_each(|(is_forest, is_rough)| *is_forest &= is_rough);
    let mut is_open = is_forest.map(|is| !is);
    without_small(&mut is_open, CLEARING_MIN_M2 / (cell_m * cell_m));
    let mut is_forest = is_open.map(|is| !is);
    without_small(&mut is_forest, (widest_m / cell_m).powi(2));
    without_visible_ground(&mut is_forest, surface, cell_m);
    is_forest
}

/// Takes the regions out whose lowest cells agree with each other.
fn without_visible_ground(is_forest: &mut Grid<bool>, surface: &Grid<f32>, cell_m: f64) {
    let side = (BLOCK_M / cell_m).round().max(1.0) as usize;
    let width = surface.width();
    let mut lows = Grid::filled(width.div_ceil(side), surface.height().div_ceil(side), f32::NAN);
    for (at, height) in surface.data().iter().enumerate() {
        let low: &mut f32 = &mut lows[(at % width / side, at / width / side)];
        *low = low.min(*height);
    }
    let deviations = roughness(&lows, 1);
    let regions = Regions::of(is_forest);
    for region in 0..regions.len() {
        let cells = regions.cells(region);
        let at = |cell: u32| deviations[(cell as usize % width / side, cell as usize / width / side)];
        let mut known: Vec<f32> = cells.iter().map(|cell| at(*cell)).filter(|d| !d.is_nan()).collect();
        if quantile(&mut known, 0.5).is_some_and(|deviation| deviation <= CLOSED_M) {
            cells.iter().for_each(|&cell| is_forest.data_mut()[cell as usize] = false);
        }
    }
}

/// Takes regions with fewer cells out of a mask.
fn without_small(mask: &mut Grid<bool>, cells_min: f64) {
    let regions = Regions::of(mask);
    for region in 0..regions.len() {
        let cells = regions.cells(region);
        if (cells.len() as f64) < cells_min {
            cells.iter().for_each(|&cell| mask.data_mut()[cell as usize] = false);
        }
    }
}

/// Returns the root mean square deviation of the heights around each cell from their plane, NaN at
/// voids.
pub(crate) fn roughness(surface: &Grid<f32>, radius: usize) -> Grid<f32> {
    let (width, height) = (surface.width(), surface.height());
    let mut out = surface.clone();
    if width == 0 {
        return out;
    }
    out.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, line)| {
        for (column, cell) in line.iter_mut().enumerate() {
            if cell.is_nan() {
                continue;
            }
            let own = *cell;
            let mut sums = PlaneSums::default();
            for y in row.saturating_sub(radius)..(row + radius + 1).min(height) {
                for x in column.saturating_sub(radius)..(column + radius + 1).min(width) {
                    let z = surface[(x, y)];
                    if !z.is_nan() {
                        sums.add(x as f32 - column as f32, y as f32 - row as f32, z - own);
                    }
                }
            }
            *cell = sums.deviation();
        }
    });
    out
}

/// Sums over points that a plane is fitted to.
#[derive(Default)]
struct PlaneSums {
    n: f32,
    x: f32,
    y: f32,
    z: f32,
    xx: f32,
    xy: f32,
    yy: f32,
    xz: f32,
    yz: f32,
    zz: f32,
}

impl PlaneSums {
    fn add(&mut self, x: f32, y: f32, z: f32) {
        self.n += 1.0;
        self.x += x;
        self.y += y;
        self.z += z;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.xz += x * z;
        self.yz += y * z;
        self.zz += z * z;
    }

    /// Returns the root mean square deviation from the plane; 0 for points on a line.
    fn deviation(&self) -> f32 {
        let n = self.n;
        let (xx, xy, yy) =
            (self.xx - self.x * self.x / n, self.xy - self.x * self.y / n, self.yy - self.y * self.y / n);
        let (xz, yz) = (self.xz - self.x * self.z / n, self.yz - self.y * self.z / n);
        let determinant = xx * yy - xy * xy;
        if determinant <= 0.0 {
            return 0.0;
        }
        let (b, c) = ((xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant);
        let rest = self.zz - self.z * self.z / n - b * xz - c * yz;
        (rest / n).max(0.0).sqrt()
    }
}
