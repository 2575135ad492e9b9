//! One height per cell from several views' heights.

use raster::{Grid, Window};
use rayon::prelude::*;

use super::mesh::{PlacedView, ViewSurface};
use crate::level::{paste, tiles};

/// Parameters of the fusion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FusionConfig {
    /// Heights closer than this belong to one surface, metres.
    pub same_surface_m: f32,
    /// Neighbouring pixels further apart in height than this are not joined, metres.
    pub tear_m: f32,
    /// Side of the tiles that are fused at a time, cells: memory and parallelism, never the result.
    pub tile: usize,
}

/// The fused surface.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Height above the origin, metres; NaN in voids.
    pub height_m: Grid<f32>,
    /// Standard deviation, metres; NaN in voids.
    pub sigma_m: Grid<f32>,
    /// Number of views behind each height.
    pub views: Grid<u8>,
}

/// Fuses the views on a grid of `size` (columns, rows), tile by tile.
pub fn fuse_views(views: &[PlacedView], size: (usize, usize), config: &FusionConfig) -> Surface {
    let windows = tiles(Window::whole(size.0, size.1), config.tile.max(1));
    let parts: Vec<Surface> = windows
        .par_iter()
        .map(|w| {
            let surfaces: Vec<ViewSurface> = views.iter().map(|v| v.rasterise(*w, config.tear_m)).collect();
            fuse(&surfaces, (w.width, w.height), config.same_surface_m)
        })
        .collect();
    let mut out = Surface::empty(size);
    for (w, part) in windows.iter().zip(&parts) {
        paste(&mut out.height_m, *w, &part.height_m);
        paste(&mut out.sigma_m, *w, &part.sigma_m);
        paste(&mut out.views, *w, &part.views);
    }
    out
}

impl Surface {
    fn empty((columns, rows): (usize, usize)) -> Self {
        Self {
            height_m: Grid::filled(columns, rows, f32::NAN),
            sigma_m: Grid::filled(columns, rows, f32::NAN),
            views: Grid::filled(columns, rows, 0),
        }
    }
}

/// Fuses the views' surfaces on one window of the grid.
fn fuse(surfaces: &[ViewSurface], size: (usize, usize), same_surface_m: f32) -> Surface {
    let mut out = Surface::empty(size);
    let mut samples = Vec::with_capacity(surfaces.len());
    for i in 0..size.0 * size.1 {
        samples.clear();
        let held = surfaces.iter().map(|s| (s.height_m.data()[i], s.sigma_m.data()[i]));
        samples.extend(held.filter(|(height, _)| !height.is_nan()));
        if let Some((height, sigma, views)) = fuse_cell(&mut samples, same_surface_m) {
            out.height_m.data_mut()[i] = height;
            out.sigma_m.data_mut()[i] = sigma;
            out.views.data_mut()[i] = views;
        }
    }
    out
}

/// Height, deviation and support of the best supported surface among (height, deviation) samples.
fn fuse_cell(samples: &mut [(f32, f32)], same_surface_m: f32) -> Option<(f32, f32, u8)> {
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut best, mut from) = (0..0, 0);
    for to in 1..=samples.len() {
        while samples[to - 1].0 - samples[from].0 > same_surface_m {
            from += 1;
        }
        // ≥: in a tie the upper surface wins.
        if to - from >= best.len() {
            best = from..to;
        }
    }
    let mode = &samples[best];
    let middle = median(mode)?;
    // The median is robust within the mode; the deviation is that of the mean of its members, as they are independent.
    let information: f32 = mode.iter().map(|(_, s)| 1.0 / s.max(1e-3).powi(2)).sum();
    Some((middle, information.sqrt().recip(), mode.len().min(255) as u8))
}

fn median(sorted: &[(f32, f32)]) -> Option<f32> {
    let n = sorted.len();
    let (low, high) = (sorted.get((n.max(1) - 1) / 2)?, sorted.get(n / 2)?);
    Some(0.5 * (low.0 + high.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_surfaces_in_a_cell_give_the_better_supported_one_and_the_upper_in_a_tie() {
        let cell = |heights: &[f32]| {
            let mut s: Vec<(f32, f32)> = heights.iter().map(|h| (*h, 0.1)).collect();
            fuse_cell(&mut s, 1.0)
        };
        assert_eq!(cell(&[10.0, 30.0]).map(|c| (c.0, c.2)), Some((30.0, 1)));
        assert_eq!(cell(&[10.2, 30.0, 10.0]).map(|c| (c.0, c.2)), Some((10.1, 2)));
        assert_eq!(cell(&[]), None);
    }
}
