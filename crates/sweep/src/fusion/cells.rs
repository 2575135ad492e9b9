//! One height per cell from the heights of several views.

use numeric::middle_values;
use raster::{Grid, Window};
use rayon::prelude::*;

use super::mesh::{PlacedView, SEEN_WEIGHT, ViewSurface};
use super::regularise::{HeightLattice, MARGIN, regularised};
use crate::tiles::{paste, tiles};

/// Parameters of the fusion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FusionConfig {
    /// Largest difference of heights on one surface, metres.
    pub same_surface_m: f32,
    /// Largest difference in height of neighbouring pixels that are joined, metres.
    pub tear_m: f32,
    /// Distance of two height hypotheses, metres.
    pub step_m: f64,
    /// Height that those of the views count from, metres above the ellipsoid.
    pub origin_m: f64,
    /// Side of the tiles that are fused at a time, cells, rounded up to whole blocks of
    /// [`BLOCK`]. Tiles of many surfaces are smaller. It affects memory and parallelism only, never
    /// the result.
    pub tile: usize,
}

/// Side of the blocks of cells that are regularised together. They lie on a fixed lattice of the
/// grid, so that the result does not depend on tiles or threads.
pub const BLOCK: usize = 256;
/// Largest memory of the views' surfaces in a tile of several blocks, bytes: three surfaces in a
/// tile of 1024 × 1024 cells.
const SAMPLED_BYTES: usize = 48_000_000;
/// Bytes of a view's surface in a cell: height, deviation and weight.
const SAMPLE_BYTES: usize = 12;

/// Surface fused from several views.
#[derive(Debug, Clone)]
pub struct FusedSurface {
    /// Height above the origin, metres; NaN in voids.
    pub height_m: Grid<f32>,
    /// Height of each cell by itself, the median of the views that support it: what the scatter
    /// between cells is measured on. Metres; NaN in voids.
    pub single_m: Grid<f32>,
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
    view: usize,
    height_m: f32,
    sigma_m: f32,
    weight: f32,
}

/// Fused height of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell {
    height_m: f32,
    single_m: f32,
    sigma_m: f32,
    views: u8,
    confidence: f32,
    seen: bool,
}

/// Fuses the views on a grid of `size` (columns, rows), tile by tile. A view that was placed
/// several times, from several lattices of pixels, counts once: its heights share its weight, and
/// they tell as much as one of them. All that was placed of a view must follow each other.
///
/// ```
/// use sweep::fusion::{FusionConfig, fuse_views};
///
/// let config = FusionConfig { same_surface_m: 1.5, tear_m: 3.0, step_m: 0.5, origin_m: 0.0, tile: 256 };
/// let surface = fuse_views(&[], (40, 30), &config);
/// assert!(surface.height_m.data().iter().all(|h| h.is_nan()));
/// ```
pub fn fuse_views(views: &[PlacedView], size: (usize, usize), config: &FusionConfig) -> FusedSurface {
    let fits = |side: &usize| (side + 2 * MARGIN).pow(2) * SAMPLE_BYTES * views.len() <= SAMPLED_BYTES;
    let largest = config.tile.max(1).div_ceil(BLOCK);
    let side = (1..=largest).map(|blocks| blocks * BLOCK).take_while(fits).last().unwrap_or(BLOCK);
    let windows = tiles(Window::whole(size.0, size.1), side);
    let parts: Vec<Vec<(Window, FusedSurface)>> =
        windows.par_iter().map(|w| fuse_tile(views, size, *w, config)).collect();
    let mut out = FusedSurface::empty(size);
    for (w, part) in parts.iter().flatten() {
        paste(&mut out.height_m, *w, &part.height_m);
        paste(&mut out.single_m, *w, &part.single_m);
        paste(&mut out.sigma_m, *w, &part.sigma_m);
        paste(&mut out.views, *w, &part.views);
        paste(&mut out.confidence, *w, &part.confidence);
        paste(&mut out.seen, *w, &part.seen);
    }
    out
}

/// Fuses the views in one tile, block by block.
fn fuse_tile(
    views: &[PlacedView],
    size: (usize, usize),
    tile: Window,
    config: &FusionConfig,
) -> Vec<(Window, FusedSurface)> {
    let whole = Window::whole(size.0, size.1);
    let with_margin = |w: Window| w.grown(MARGIN).intersection(&whole).unwrap_or(w);
    let lattice = HeightLattice { step_m: config.step_m, origin_m: config.origin_m };
    let all = with_margin(tile);
    let mut sampled: Vec<ViewSurface> = views.iter().map(|view| view.rasterise(all, config.tear_m)).collect();
    for of_view in sampled.chunk_by_mut(|a, b| a.view == b.view) {
        let share = 1.0 / of_view.len() as f32;
        of_view.iter_mut().for_each(|s| s.weight.data_mut().iter_mut().for_each(|weight| *weight *= share));
    }
    let fused = |block: Window| {
        let around = with_margin(block);
        let surfaces: Vec<ViewSurface> = sampled.iter().map(|surface| surface.part(inside(around, all))).collect();
        let chosen_m = regularised(&surfaces, (around.width, around.height), lattice);
        let core = inside(block, around);
        let surfaces: Vec<ViewSurface> = surfaces.iter().map(|surface| surface.part(core)).collect();
        (block, fuse(&surfaces, &chosen_m.window(core, f32::NAN), config.same_surface_m))
    };
    tiles(tile, BLOCK).into_iter().map(fused).collect()
}

/// Returns a window relative to the first cell of another one.
fn inside(w: Window, of: Window) -> Window {
    Window { x: w.x - of.x, y: w.y - of.y, ..w }
}

impl FusedSurface {
    fn empty((columns, rows): (usize, usize)) -> Self {
        Self {
            height_m: Grid::filled(columns, rows, f32::NAN),
            single_m: Grid::filled(columns, rows, f32::NAN),
            sigma_m: Grid::filled(columns, rows, f32::NAN),
            views: Grid::filled(columns, rows, 0),
            confidence: Grid::filled(columns, rows, 0.0),
            seen: Grid::filled(columns, rows, false),
        }
    }
}

/// Fuses the views' surfaces on one window of the grid at its regularised heights.
fn fuse(surfaces: &[ViewSurface], chosen_m: &Grid<f32>, same_surface_m: f32) -> FusedSurface {
    let mut out = FusedSurface::empty((chosen_m.width(), chosen_m.height()));
    let mut samples = Vec::with_capacity(surfaces.len());
    for (i, chosen_m) in chosen_m.data().iter().enumerate() {
        samples.clear();
        let held = surfaces.iter().map(|s| Sample {
            view: s.view,
            height_m: s.height_m.data()[i],
            sigma_m: s.sigma_m.data()[i],
            weight: s.weight.data()[i],
        });
        samples.extend(held.filter(|s| !s.height_m.is_nan()));
        if let Some(cell) = fuse_cell(&mut samples, *chosen_m, same_surface_m) {
            out.height_m.data_mut()[i] = cell.height_m;
            out.single_m.data_mut()[i] = cell.single_m;
            out.sigma_m.data_mut()[i] = cell.sigma_m;
            out.views.data_mut()[i] = cell.views;
            out.confidence.data_mut()[i] = cell.confidence;
            out.seen.data_mut()[i] = cell.seen;
        }
    }
    out
}

/// Fuses the samples that support the chosen height; `None` if there are none. Those of one view
/// follow each other.
fn fuse_cell(samples: &mut Vec<Sample>, chosen_m: f32, same_surface_m: f32) -> Option<Cell> {
    let all: f32 = samples.iter().map(|s| s.weight).sum();
    samples.retain(|s| (s.height_m - chosen_m).abs() <= same_surface_m);
    // The deviation is that of a weighted mean of the views, taken as independent. Several heights
    // of one view are not: they tell as much as one of them.
    let told = |s: &Sample| 1.0 / s.sigma_m.max(1e-3).powi(2);
    let (mut views, mut information) = (0usize, 0.0f32);
    for of_view in samples.chunk_by(|a, b| a.view == b.view) {
        views += 1;
        information += of_view.iter().map(told).sum::<f32>() / of_view.len() as f32;
    }
    samples.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
    let (low, high) = middle_values(samples)?;
    let support: f32 = samples.iter().map(|s| s.weight).sum();
    Some(Cell {
        height_m: chosen_m,
        single_m: 0.5 * (low.height_m + high.height_m),
        sigma_m: information.sqrt().recip(),
        views: views.min(255) as u8,
        confidence: support / (all + 1.0),
        seen: support >= SEEN_WEIGHT,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(samples: &[(f32, f32)], chosen_m: f32) -> Option<Cell> {
        let sample =
            |(view, &(height_m, weight)): (usize, &(f32, f32))| Sample { view, height_m, sigma_m: 0.1, weight };
        fuse_cell(&mut samples.iter().enumerate().map(sample).collect(), chosen_m, 1.0)
    }

    #[test]
    fn the_heights_of_one_view_tell_as_much_as_one_of_them() {
        let of_two_views = [0, 0, 0, 1, 1].map(|view| Sample { view, height_m: 10.0, sigma_m: 0.1, weight: 0.4 });
        let c = fuse_cell(&mut of_two_views.to_vec(), 10.0, 1.0).unwrap();
        assert_eq!(c.views, 2);
        assert!((c.sigma_m - 0.1 / 2f32.sqrt()).abs() < 1e-6, "{}", c.sigma_m);
    }

    #[test]
    fn only_samples_on_the_chosen_surface_support_it() {
        let c = cell(&[(10.2, 1.0), (30.0, 1.0), (10.0, 0.25)], 10.1).unwrap();
        assert_eq!((c.height_m, c.views, c.seen), (10.1, 2, true));
        assert!((c.single_m - 10.1).abs() < 1e-5);
        assert!((c.confidence - 1.25 / 3.25).abs() < 1e-6);
        assert!(
            cell(&[(10.0, 1.0)], 20.0).is_none()
                && cell(&[], 20.0).is_none()
                && cell(&[(10.0, 1.0)], f32::NAN).is_none()
        );
    }

    #[test]
    fn a_height_that_no_view_has_seen_is_told() {
        assert!(!cell(&[(30.0, 1e-4), (30.1, 1e-4)], 30.0).unwrap().seen);
        assert!(cell(&[(10.0, 0.0125)], 10.0).unwrap().seen);
    }
}
