//! Heights of triangles at the pixels of a tile: the first hit of a vertical ray from above.

use bvh::{Bvh, Ray};
use raster::Grid;
use rayon::prelude::*;

use crate::lattice::TileMap;

/// Triangles with their place on a map.
#[derive(Debug, Clone, Copy)]
pub struct PlacedTriangles<'a> {
    /// The triangles, in metres from `origin`.
    pub bvh: &'a Bvh,
    /// Map coordinates of their zero.
    pub origin: [f64; 3],
    /// Their lowest and highest z, metres above `origin`.
    pub z_span: (f64, f64),
}

impl PlacedTriangles<'_> {
    /// Returns the z of the highest triangle at a position on the map (`up` is −1: the ray goes
    /// down), or of the lowest one (1).
    fn met(&self, x: f64, y: f64, up: f64) -> Option<f64> {
        let start = if up < 0.0 { self.z_span.1 + 1.0 } else { self.z_span.0 - 1.0 };
        let ray = Ray {
            origin: [x - self.origin[0], y - self.origin[1], start],
            direction: [0.0, 0.0, up],
            end: self.z_span.1 - self.z_span.0 + 2.0,
        };
        self.bvh.closest_hit(&ray).map(|hit| self.origin[2] + start + up * hit.t)
    }
}

/// Returns the heights above `zero_m` (metres above the ellipsoid) of the highest triangles at the
/// `size × size` pixels of a tile, NaN where there is no triangle. `map` leads from pixels to the
/// map of the triangles.
pub fn heights_from_triangles(triangles: &PlacedTriangles<'_>, map: &TileMap, size: usize, zero_m: f64) -> Grid<f32> {
    let mut heights = Grid::filled(size, size, f32::NAN);
    heights.data_mut().par_chunks_mut(size.max(1)).enumerate().for_each(|(row, cells)| {
        for (column, height) in cells.iter_mut().enumerate() {
            let [x, y, shift] = map.at(column as f64, row as f64);
            if let Some(z) = triangles.met(x, y, -1.0) {
                *height = (z + (shift - zero_m)) as f32;
            }
        }
    });
    heights
}

/// Returns the heights above `zero_m` of the lowest triangles, as [`heights_from_triangles`] does
/// those of the highest: the surfaces of the ground of buildings that have one. Only pixels at most
/// `reach` from the middle of the tile have heights, along each axis.
pub fn lowest_from_triangles(
    triangles: &PlacedTriangles<'_>,
    map: &TileMap,
    (size, reach): (usize, usize),
    zero_m: f64,
) -> Grid<f32> {
    let mut heights = Grid::filled(size, size, f32::NAN);
    let near = (size / 2).saturating_sub(reach + 1)..(size / 2 + reach + 1).min(size);
    for row in near.clone() {
        for column in near.clone() {
            let [x, y, shift] = map.at(column as f64, row as f64);
            if let Some(z) = triangles.met(x, y, 1.0) {
                heights[(column, row)] = (z + (shift - zero_m)) as f32;
            }
        }
    }
    heights
}
