//! Cells of a surface that a satellite sees, and pixels that show them.
//!
//! A cell is seen when nothing of the surface stands in its line of sight (crate `occlusion`). A
//! pixel shows the surface when a seen cell, or a quarter of one, falls on it. Pixels of walls and
//! hidden ground have no such cell.

use crs::CrsError;
use raster::Grid;
use rayon::prelude::*;

use super::{RpcSplatCamera, SplatCamera, SplatSurface};

/// Height above the line of sight up to which a surface does not hide, metres: half a step of a
/// rough surface.
pub(super) const TOLERANCE_M: f64 = 0.3;
/// Number of positions along each side of a cell that are projected into the image.
const SUBCELLS: usize = 2;

/// Returns the cells that are seen from a direction (unit vector towards the sensor). Voids hide
/// nothing and are not seen.
pub fn visible_cells(surface: &SplatSurface<'_>, towards_sensor: [f64; 3]) -> Grid<bool> {
    let heights = surface.heights();
    let mut seen = Grid::filled(heights.width(), heights.height(), false);
    let Some(per_metre) = cells_per_metre(surface, towards_sensor) else { return seen };
    let (along_columns, along_rows) = surface.geotransform().cell_size();
    let obstacle = occlusion::OcclusionSurface::new(heights, (along_columns * along_rows).sqrt());
    if heights.width() > 0 {
        seen.data_mut().par_chunks_mut(heights.width()).enumerate().for_each(|(row, cells)| {
            for (column, cell) in cells.iter_mut().enumerate() {
                let height = f64::from(heights[(column, row)]);
                let hidden = || obstacle.hides(column as f64, row as f64, height, per_metre, TOLERANCE_M);
                *cell = height.is_finite() && !hidden();
            }
        });
    }
    seen
}

/// Returns the columns and rows that the line of sight moves by per metre that it rises; `None`
/// when it does not rise.
pub(super) fn cells_per_metre(surface: &SplatSurface<'_>, towards: [f64; 3]) -> Option<[f64; 2]> {
    let transform = surface.geotransform();
    let (x, y) = transform.map_from_cell(0.0, 0.0);
    let (column, row) = transform.cell_from_map(x + towards[0], y + towards[1])?;
    (towards[2] > 1e-6).then(|| [column / towards[2], row / towards[2]])
}

/// Returns the pixels of an image that show seen cells.
///
/// # Errors
/// [`CrsError`] when PROJ cannot be set up.
pub fn visible_pixels(
    surface: &SplatSurface<'_>,
    seen: &Grid<bool>,
    camera: &RpcSplatCamera<'_>,
) -> Result<Grid<bool>, CrsError> {
    let (width, height) = camera.size();
    let mut shows = Grid::filled(width, height, false);
    let offset = |i: usize| (i as f64 + 0.5) / SUBCELLS as f64 - 0.5;
    let subcells = || (0..SUBCELLS * SUBCELLS).map(|k| (offset(k % SUBCELLS), offset(k / SUBCELLS)));
    let rows: Result<Vec<Vec<[f64; 2]>>, CrsError> = (0..seen.height())
        .into_par_iter()
        .map(|row| {
            let cells = seen.row(row).iter().enumerate().filter(|(_, seen)| **seen);
            let positions = cells.flat_map(|(column, _)| {
                let height = surface.local_height(column as i64, row as i64);
                subcells().map(move |(u, v)| surface.position(column as f64 + u, row as f64 + v, height))
            });
            camera.pixels(positions)
        })
        .collect();
    mark_pixels(&mut shows, &rows?.concat());
    Ok(shows)
}

/// Marks the pixels that positions (sample, line) in an image fall on.
pub(super) fn mark_pixels(shows: &mut Grid<bool>, positions: &[[f64; 2]]) {
    let (width, height) = (shows.width() as f64, shows.height() as f64);
    for [sample, line] in positions {
        let (column, row) = (sample.round(), line.round());
        if column >= 0.0 && row >= 0.0 && column < width && row < height {
            shows[(column as usize, row as usize)] = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::GeoTransform;

    #[test]
    fn a_tower_hides_what_lies_behind_it() {
        let mut heights = Grid::filled(40, 7, 0.0f32);
        (6..=10).for_each(|x| (2..=4).for_each(|y| heights[(x, y)] = 8.0));
        heights[(30, 3)] = f32::NAN;
        let surface = SplatSurface::new(&heights, GeoTransform::north_up(0.0, 0.0, 1.0), [0.0; 3]);
        // The sensor stands in the west at 45°: eight cells east of the tower are hidden.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let seen = visible_cells(&surface, [-half, 0.0, half]);
        let hidden: Vec<usize> = (0..40).filter(|&c| !seen[(c, 3)]).collect();
        // The tower's wall stands half a cell towards its neighbour.
        assert_eq!(hidden, [11, 12, 13, 14, 15, 16, 17, 18, 30]);
        assert!(seen.row(0).iter().all(|&s| s));
        assert!(visible_cells(&surface, [0.0, 0.0, 1.0]).row(3).iter().filter(|s| !**s).count() == 1);
        assert!(visible_cells(&surface, [1.0, 0.0, 0.0]).data().iter().all(|s| !s));
    }
}
