//! Which cells of a surface a satellite sees, and which pixels show them.
//!
//! A cell is seen when no cell on the way to the sensor stands higher than the line of sight: the line is followed from cell to
//! cell over the surface until it is above everything. A pixel shows the surface when a seen cell, or a quarter of one, falls
//! on it; walls and hidden ground have no such cell.

use geodesy::GeodesyError;
use raster::Grid;
use rayon::prelude::*;

use super::{RpcSplatCamera, SplatCamera, Surface};

/// Surfaces up to this far above the line of sight do not hide: half a step of a rough surface.
const TOLERANCE_M: f64 = 0.3;
/// Positions along each side of a cell that are looked up in the image.
const SUBCELLS: usize = 2;

/// Which cells are seen from a direction (unit vector towards the sensor). Voids hide nothing and are not seen.
pub fn visible_cells(surface: &Surface<'_>, towards_sensor: [f64; 3]) -> Grid<bool> {
    let heights = surface.heights();
    let mut seen = Grid::filled(heights.width(), heights.height(), false);
    let highest = heights.data().iter().copied().filter(|h| h.is_finite()).fold(f32::NEG_INFINITY, f32::max);
    let top = f64::from(highest) - surface.origin()[2];
    let Some(step) = step_in_cells(surface, towards_sensor) else { return seen };
    if heights.width() > 0 {
        seen.data_mut().par_chunks_mut(heights.width()).enumerate().for_each(|(row, cells)| {
            for (column, cell) in cells.iter_mut().enumerate() {
                *cell = is_seen(surface, [column as f64, row as f64], step, top);
            }
        });
    }
    seen
}

/// Columns, rows and metres that the line of sight takes with each cell; straight up is one metre at a time.
fn step_in_cells(surface: &Surface<'_>, towards: [f64; 3]) -> Option<[f64; 3]> {
    let transform = surface.geotransform();
    let (x, y) = transform.map_from_cell(0.0, 0.0);
    let (column, row) = transform.cell_from_map(x + towards[0], y + towards[1])?;
    let cells = column.abs().max(row.abs());
    let length = if cells > 1e-6 { 1.0 / cells } else { 1.0 };
    (towards[2] > 0.0).then_some([column * length, row * length, towards[2] * length])
}

fn is_seen(surface: &Surface<'_>, from: [f64; 2], step: [f64; 3], top: f64) -> bool {
    let mut at = [from[0], from[1], surface.local_height(from[0] as i64, from[1] as i64)];
    if !at[2].is_finite() {
        return false;
    }
    let (width, height) = (surface.heights().width() as f64, surface.heights().height() as f64);
    while at[2] < top {
        at = [at[0] + step[0], at[1] + step[1], at[2] + step[2]];
        let (column, row) = (at[0].round(), at[1].round());
        if column < 0.0 || row < 0.0 || column >= width || row >= height {
            return true;
        }
        // A void is NaN and hides nothing.
        if surface.local_height(column as i64, row as i64) > at[2] + TOLERANCE_M {
            return false;
        }
        if step[0] == 0.0 && step[1] == 0.0 {
            return true;
        }
    }
    true
}

/// The pixels of an image that show seen cells.
///
/// # Errors
/// PROJ that cannot be set up.
pub fn visible_pixels(
    surface: &Surface<'_>,
    seen: &Grid<bool>,
    camera: &RpcSplatCamera<'_>,
) -> Result<Grid<bool>, GeodesyError> {
    let (width, height) = camera.size();
    let mut shows = Grid::filled(width, height, false);
    let offset = |i: usize| (i as f64 + 0.5) / SUBCELLS as f64 - 0.5;
    let subcells = || (0..SUBCELLS * SUBCELLS).map(|k| (offset(k % SUBCELLS), offset(k / SUBCELLS)));
    let rows: Result<Vec<Vec<[f64; 2]>>, GeodesyError> = (0..seen.height())
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
    for [sample, line] in rows?.into_iter().flatten() {
        let (column, row) = (sample.round(), line.round());
        if column >= 0.0 && row >= 0.0 && column < width as f64 && row < height as f64 {
            shows[(column as usize, row as usize)] = true;
        }
    }
    Ok(shows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::GeoTransform;

    #[test]
    fn a_tower_hides_what_lies_behind_it() {
        let mut heights = Grid::filled(40, 5, 0.0f32);
        heights[(10, 2)] = 8.0;
        heights[(30, 2)] = f32::NAN;
        let surface = Surface::new(&heights, GeoTransform::north_up(0.0, 0.0, 1.0), [0.0; 3]);
        // The sensor stands in the west at 45°: eight cells east of the tower are hidden.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let seen = visible_cells(&surface, [-half, 0.0, half]);
        let hidden: Vec<usize> = (0..40).filter(|&c| !seen[(c, 2)]).collect();
        assert_eq!(hidden, [11, 12, 13, 14, 15, 16, 17, 30]);
        assert!(seen.row(1).iter().all(|&s| s));
        assert!(visible_cells(&surface, [0.0, 0.0, 1.0]).row(2).iter().filter(|s| !**s).count() == 1);
        assert!(visible_cells(&surface, [1.0, 0.0, 0.0]).data().iter().all(|s| !s));
    }
}
