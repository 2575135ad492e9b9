//! Heights of triangles at the pixels of a tile: the first hit of a vertical ray from above.

use bvh::{Bvh, Ray};
use raster::Grid;
use rayon::prelude::*;

use crate::lattice::TileMap;

/// Returns the heights above `zero_m` (metres above the ellipsoid) at the `size × size` pixels of a
/// tile, NaN where there is no triangle.
///
/// The triangles are in metres from `origin` on the map of the model; `map` leads from pixels to
/// that map. `z_span` is the lowest and highest z of the triangles.
pub fn heights_from_triangles(
    bvh: &Bvh,
    origin: [f64; 3],
    z_span: (f64, f64),
    map: &TileMap,
    size: usize,
    zero_m: f64,
) -> Grid<f32> {
    let mut heights = Grid::filled(size, size, f32::NAN);
    let start = z_span.1 + 1.0;
    heights.data_mut().par_chunks_mut(size.max(1)).enumerate().for_each(|(row, cells)| {
        for (column, height) in cells.iter_mut().enumerate() {
            let [x, y, shift] = map.at(column as f64, row as f64);
            let ray = Ray {
                origin: [x - origin[0], y - origin[1], start],
                direction: [0.0, 0.0, -1.0],
                end: start - z_span.0 + 1.0,
            };
            if let Some(hit) = bvh.closest_hit(&ray) {
                *height = (origin[2] + start - hit.t + (shift - zero_m)) as f32;
            }
        }
    });
    heights
}
