//! What each view sees of the grid: the direction of its lines of sight there, and the cells that
//! its image shows.
//!
//! The pixel of a cell is interpolated between cells of a lattice that are projected exactly, at
//! the mean height known around them. Off the ground the pixel is wrong, by the lean of the view
//! times the height: at the border of an image or beside a cloud, where a cell counts as imaged
//! that is not.

use camera::{CameraError, RpcCamera};
use crs::MapProjection;
use geodesy::LonLatHeight;
use raster::{Grid, level_from_level0};
use rayon::prelude::*;
use sweep::SweepView;
use sweep::fusion::GridSight;

use crate::error::ReconstructError;
use crate::grid::DsmGrid;

/// Distance of the lattice's cells. Over so few cells an RPC is linear to far below a pixel.
const LATTICE: usize = 32;
/// Lines of sight are followed up and down by this much, metres: the height of a tower.
const ALONG_M: f64 = 50.0;

/// Reach of a gap inside of an image, pixels: the patches that are compared reach two pixels into
/// it, and a height of two storeys off the ground around moves a place by some more.
const GAP_REACH: usize = 8;

/// The camera of a view and the valid pixels of one level. It takes a fraction of the view's
/// memory.
pub(crate) struct ViewPixels {
    camera: RpcCamera,
    level: u32,
    valid: Grid<bool>,
    /// Pixels in and beside gaps inside of the image; `None` where there are none.
    gaps: Option<Grid<bool>>,
}

impl ViewPixels {
    /// Takes from a view what tells where it sees.
    pub(crate) fn of(view: &SweepView, level: usize) -> Self {
        let valid = view.levels[level].map(|v| !v.is_nan());
        let gaps = inner_gaps(&valid);
        Self { camera: view.camera.clone(), level: level as u32, valid, gaps }
    }

    /// Returns whether the image shows the place (column, row) of its level.
    fn shows(&self, [column, row]: [f64; 2]) -> bool {
        let (x, y) = (column.round(), row.round());
        x >= 0.0 && y >= 0.0 && self.valid.get(x as usize, y as usize).is_some_and(|v| *v)
    }

    /// Returns whether the place lies in or beside a gap inside of the image.
    fn has_gap(&self, [column, row]: [f64; 2]) -> bool {
        let (x, y) = (column.round(), row.round());
        let at = |gaps: &Grid<bool>| x >= 0.0 && y >= 0.0 && gaps.get(x as usize, y as usize).is_some_and(|v| *v);
        self.gaps.as_ref().is_some_and(at)
    }
}

/// Returns what the views see of the cells. `height_m` holds the known heights above `origin_m`. A
/// view whose camera fails in the middle of the grid sees nothing.
///
/// # Errors
/// [`ReconstructError::Crs`].
pub(crate) fn grid_sights(
    views: &[ViewPixels],
    grid: &DsmGrid,
    height_m: &Grid<f32>,
    origin_m: f64,
) -> Result<Vec<GridSight>, ReconstructError> {
    let projection = grid.projection()?;
    let lattice = Lattice::new(grid, &projection, height_m, origin_m)?;
    let sight = |view: &ViewPixels| {
        let cells_per_m = cells_per_m(&view.camera, grid, &projection, lattice.middle).ok()?;
        let images = lattice.marked(view, grid.size, ViewPixels::shows);
        let gaps = lattice.marked(view, grid.size, ViewPixels::has_gap);
        Some(GridSight { cells_per_m, images, gaps })
    };
    Ok(views.par_iter().filter_map(sight).collect())
}

/// Returns the columns and rows that a line of sight moves per metre up, at a place of the scene.
fn cells_per_m(
    camera: &RpcCamera,
    grid: &DsmGrid,
    projection: &MapProjection,
    middle: LonLatHeight,
) -> Result<[f64; 2], CameraError> {
    let pixel = camera.project(middle)?;
    let place = |height_m: f64| {
        let ground = camera.localize(pixel, height_m)?;
        let at = projection.map_from_lonlat(ground.lon_deg, ground.lat_deg).map_err(|_| CameraError::NotFinite)?;
        grid.geotransform.cell_from_map(at.x, at.y).ok_or(CameraError::NotFinite)
    };
    let (low, high) = (place(middle.height_m - ALONG_M)?, place(middle.height_m + ALONG_M)?);
    Ok([high.0 - low.0, high.1 - low.1].map(|moved| moved / (2.0 * ALONG_M)))
}

/// Ground points on a lattice of cells, the last of which lie beyond the grid.
struct Lattice {
    points: Grid<LonLatHeight>,
    middle: LonLatHeight,
}

impl Lattice {
    fn new(
        grid: &DsmGrid,
        projection: &MapProjection,
        height_m: &Grid<f32>,
        origin_m: f64,
    ) -> Result<Self, ReconstructError> {
        let (columns, rows) = (grid.size.0.div_ceil(LATTICE) + 1, grid.size.1.div_ceil(LATTICE) + 1);
        let mut x = Vec::with_capacity(columns * rows);
        let mut y = Vec::with_capacity(columns * rows);
        let middle = (0.5 * grid.size.0 as f64, 0.5 * grid.size.1 as f64);
        let nodes = (0..rows).flat_map(|v| (0..columns).map(move |u| ((u * LATTICE) as f64, (v * LATTICE) as f64)));
        for (column, row) in nodes.chain([middle]) {
            let at = grid.geotransform.map_from_cell(column, row);
            x.push(at.0);
            y.push(at.1);
        }
        projection.lonlat_from_map_slices(&mut x, &mut y)?;
        let known = |cells: &mut dyn Iterator<Item = &f32>| mean(cells.filter(|h| !h.is_nan()));
        let typical_m = known(&mut height_m.data().iter()).unwrap_or(0.0);
        let around_m = |u: usize, v: usize| {
            let span = |i: usize, n: usize| (i * LATTICE).saturating_sub(LATTICE).min(n)..((i + 1) * LATTICE).min(n);
            let columns = span(u, grid.size.0);
            known(&mut span(v, grid.size.1).flat_map(|row| &height_m.row(row)[columns.clone()]))
        };
        let point = |i: usize, height_m: f64| LonLatHeight { lon_deg: x[i], lat_deg: y[i], height_m };
        let heights = (0..columns * rows).map(|i| origin_m + around_m(i % columns, i / columns).unwrap_or(typical_m));
        let points: Vec<LonLatHeight> = heights.enumerate().map(|(i, h)| point(i, h)).collect();
        let middle = point(columns * rows, origin_m + typical_m);
        let points = Grid::from_vec(columns, rows, points).unwrap_or_else(|| Grid::filled(0, 0, middle));
        Ok(Self { points, middle })
    }

    /// Marks the cells at whose places a view has something. It has nothing beside a point where
    /// its camera fails.
    fn marked(
        &self,
        view: &ViewPixels,
        size: (usize, usize),
        has: impl Fn(&ViewPixels, [f64; 2]) -> bool,
    ) -> Grid<bool> {
        let pixel = |ground: &LonLatHeight| match view.camera.project(*ground) {
            Ok(p) => [p.sample, p.line].map(|v| level_from_level0(v, view.level)),
            Err(_) => [f64::NAN; 2],
        };
        let pixels = self.points.map(pixel);
        let mut out = Grid::filled(size.0, size.1, false);
        for y in 0..size.1 {
            let (v, b) = (y / LATTICE, (y % LATTICE) as f64 / LATTICE as f64);
            for (x, marked) in out.row_mut(y).iter_mut().enumerate() {
                let (u, a) = (x / LATTICE, (x % LATTICE) as f64 / LATTICE as f64);
                let [p, q, r, s] = [(u, v), (u + 1, v), (u, v + 1), (u + 1, v + 1)].map(|at| pixels[at]);
                let between = |i: usize| {
                    let (above, below) = (p[i] + a * (q[i] - p[i]), r[i] + a * (s[i] - r[i]));
                    above + b * (below - above)
                };
                *marked = has(view, [between(0), between(1)]);
            }
        }
        out
    }
}

/// Marks the pixels in and beside gaps that valid pixels enclose; `None` where there are none. What
/// is void up to the border of an image is where the image ends.
fn inner_gaps(valid: &Grid<bool>) -> Option<Grid<bool>> {
    let (width, height) = (valid.width(), valid.height());
    if valid.data().iter().all(|v| *v) {
        return None;
    }
    let mut is_inner = valid.map(|v| !*v);
    let border = (0..width).flat_map(|x| [(x, 0), (x, height - 1)]);
    let mut open: Vec<(usize, usize)> = border.chain((0..height).flat_map(|y| [(0, y), (width - 1, y)])).collect();
    while let Some(at) = open.pop() {
        if is_inner.get(at.0, at.1) != Some(&true) {
            continue;
        }
        is_inner[at] = false;
        let (x, y) = at;
        open.extend([(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)]);
    }
    if !is_inner.data().contains(&true) {
        return None;
    }
    let mut out = valid.map(|_| false);
    for (i, _) in is_inner.data().iter().enumerate().filter(|(_, inner)| **inner) {
        let (x, y) = (i % width, i / width);
        for row in y.saturating_sub(GAP_REACH)..(y + GAP_REACH + 1).min(height) {
            out.row_mut(row)[x.saturating_sub(GAP_REACH)..(x + GAP_REACH + 1).min(width)].fill(true);
        }
    }
    Some(out)
}

fn mean<'a>(values: impl Iterator<Item = &'a f32>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0u32), |(sum, n), v| (sum + f64::from(*v), n + 1));
    (n > 0).then(|| sum / f64::from(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_what_valid_pixels_enclose() {
        let mut valid = Grid::filled(60, 50, true);
        (0..20).for_each(|y| (0..6).for_each(|x| valid[(x, y)] = false));
        assert_eq!(inner_gaps(&valid), None);
        (30..33).for_each(|y| (30..34).for_each(|x| valid[(x, y)] = false));
        let gaps = inner_gaps(&valid).unwrap();
        assert!(gaps[(31, 31)] && gaps[(30 - GAP_REACH, 31)] && !gaps[(30 - GAP_REACH - 1, 31)] && !gaps[(2, 2)]);
        assert_eq!(inner_gaps(&Grid::filled(4, 4, false)), None);
    }
}
