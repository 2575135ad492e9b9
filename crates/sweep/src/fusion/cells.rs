//! One height per cell from the heights of several views.

use numeric::middle_values;
use raster::{Grid, Window};
use rayon::prelude::*;

use super::mesh::{PlacedView, SEEN_WEIGHT, ViewSurface};
use crate::tiles::{paste, tiles};

/// Parameters of the fusion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FusionConfig {
    /// Largest difference of heights on one surface, metres.
    pub same_surface_m: f32,
    /// Largest difference in height of neighbouring pixels that are joined, metres.
    pub tear_m: f32,
    /// Side of the tiles that are fused at a time, cells. It affects memory and parallelism only,
    /// never the result.
    pub tile: usize,
}

/// Surface fused from several views.
#[derive(Debug, Clone)]
pub struct FusedSurface {
    /// Height above the origin, metres; NaN in voids.
    pub height_m: Grid<f32>,
    /// Standard deviation, metres; NaN in voids.
    pub sigma_m: Grid<f32>,
    /// Number of views behind each height.
    pub views: Grid<u8>,
    /// Agreement of the views on each height: `s / (s + o + 1)`, with s the summed weights of the
    /// views that support it and o those of the others; 0 in voids.
    pub confidence: Grid<f32>,
    /// Whether a view has seen the height. A height that none has seen lies where the images are
    /// blank, and continues what is around it in the images.
    pub seen: Grid<bool>,
}

/// A view's height in a cell.
#[derive(Debug, Clone, Copy)]
struct Sample {
    height_m: f32,
    sigma_m: f32,
    weight: f32,
}

/// Fused height of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell {
    height_m: f32,
    sigma_m: f32,
    views: u8,
    confidence: f32,
    seen: bool,
}

/// Fuses the views on a grid of `size` (columns, rows), tile by tile.
///
/// ```
/// use sweep::fusion::{FusionConfig, fuse_views};
///
/// let config = FusionConfig { same_surface_m: 1.5, tear_m: 3.0, tile: 256 };
/// let surface = fuse_views(&[], (40, 30), &config);
/// assert!(surface.height_m.data().iter().all(|h| h.is_nan()));
/// ```
pub fn fuse_views(views: &[PlacedView], size: (usize, usize), config: &FusionConfig) -> FusedSurface {
    let windows = tiles(Window::whole(size.0, size.1), config.tile.max(1));
    let parts: Vec<FusedSurface> = windows
        .par_iter()
        .map(|w| {
            let surfaces: Vec<ViewSurface> = views.iter().map(|v| v.rasterise(*w, config.tear_m)).collect();
            fuse(&surfaces, (w.width, w.height), config.same_surface_m)
        })
        .collect();
    let mut out = FusedSurface::empty(size);
    for (w, part) in windows.iter().zip(&parts) {
        paste(&mut out.height_m, *w, &part.height_m);
        paste(&mut out.sigma_m, *w, &part.sigma_m);
        paste(&mut out.views, *w, &part.views);
        paste(&mut out.confidence, *w, &part.confidence);
        paste(&mut out.seen, *w, &part.seen);
    }
    out
}

impl FusedSurface {
    fn empty((columns, rows): (usize, usize)) -> Self {
        Self {
            height_m: Grid::filled(columns, rows, f32::NAN),
            sigma_m: Grid::filled(columns, rows, f32::NAN),
            views: Grid::filled(columns, rows, 0),
            confidence: Grid::filled(columns, rows, 0.0),
            seen: Grid::filled(columns, rows, false),
        }
    }
}

/// Fuses the views' surfaces on one window of the grid.
fn fuse(surfaces: &[ViewSurface], size: (usize, usize), same_surface_m: f32) -> FusedSurface {
    let mut out = FusedSurface::empty(size);
    let mut samples = Vec::with_capacity(surfaces.len());
    for i in 0..size.0 * size.1 {
        samples.clear();
        let held = surfaces.iter().map(|s| Sample {
            height_m: s.height_m.data()[i],
            sigma_m: s.sigma_m.data()[i],
            weight: s.weight.data()[i],
        });
        samples.extend(held.filter(|s| !s.height_m.is_nan()));
        if let Some(cell) = fuse_cell(&mut samples, same_surface_m) {
            out.height_m.data_mut()[i] = cell.height_m;
            out.sigma_m.data_mut()[i] = cell.sigma_m;
            out.views.data_mut()[i] = cell.views;
            out.confidence.data_mut()[i] = cell.confidence;
            out.seen.data_mut()[i] = cell.seen;
        }
    }
    out
}

/// Finds the best supported surface among the samples; `None` if there are none.
fn fuse_cell(samples: &mut [Sample], same_surface_m: f32) -> Option<Cell> {
    samples.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
    let (mut best, mut most, mut from) = (0..0, 0.0, 0);
    for to in 1..=samples.len() {
        while samples[to - 1].height_m - samples[from].height_m > same_surface_m {
            from += 1;
        }
        let weight: f32 = samples[from..to].iter().map(|s| s.weight).sum();
        // With ≥ the upper surface wins a tie.
        if weight >= most {
            (best, most) = (from..to, weight);
        }
    }
    let mode = &samples[best];
    let all: f32 = samples.iter().map(|s| s.weight).sum();
    // The median is robust within the mode. The deviation is that of a weighted mean of its
    // samples, taken as independent.
    let information: f32 = mode.iter().map(|s| 1.0 / s.sigma_m.max(1e-3).powi(2)).sum();
    Some(Cell {
        height_m: median(mode)?,
        sigma_m: information.sqrt().recip(),
        views: mode.len().min(255) as u8,
        confidence: most / (all + 1.0),
        seen: most >= SEEN_WEIGHT,
    })
}

fn median(sorted: &[Sample]) -> Option<f32> {
    let (low, high) = middle_values(sorted)?;
    Some(0.5 * (low.height_m + high.height_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(samples: &[(f32, f32)]) -> Option<Cell> {
        let sample = |&(height_m, weight): &(f32, f32)| Sample { height_m, sigma_m: 0.1, weight };
        fuse_cell(&mut samples.iter().map(sample).collect::<Vec<_>>(), 1.0)
    }

    #[test]
    fn two_surfaces_in_a_cell_give_the_better_supported_one_and_the_upper_in_a_tie() {
        let held = |samples: &[(f32, f32)]| cell(samples).map(|c| (c.height_m, c.views));
        assert_eq!(held(&[(10.0, 1.0), (30.0, 1.0)]), Some((30.0, 1)));
        assert_eq!(held(&[(10.2, 1.0), (30.0, 1.0), (10.0, 1.0)]), Some((10.1, 2)));
        assert_eq!(held(&[]), None);
    }

    #[test]
    fn heights_at_borders_stand_back_for_one_inside_a_surface() {
        let c = cell(&[(30.0, 0.25), (10.0, 1.0), (30.1, 0.25), (30.2, 0.25)]).unwrap();
        assert_eq!((c.height_m, c.views), (10.0, 1));
        assert!((c.confidence - 1.0 / 2.75).abs() < 1e-6);
        assert!((cell(&[(30.0, 0.25), (30.1, 0.25)]).unwrap().height_m - 30.05).abs() < 1e-5);
    }

    #[test]
    fn a_height_that_no_view_has_seen_stands_back_for_any_other() {
        let c = cell(&[(30.0, 1e-4), (30.1, 1e-4), (10.0, 0.0125)]).unwrap();
        assert!(c.height_m == 10.0 && c.seen);
        assert!(!cell(&[(30.0, 1e-4), (30.1, 1e-4)]).unwrap().seen);
    }
}
