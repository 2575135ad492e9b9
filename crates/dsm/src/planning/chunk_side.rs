//! Side and layout of the chunks of a large scene.
//!
//! A chunk has a core, which is kept, and a rim of ground around it, as wide as what decides the
//! content of a cell.

use std::collections::HashMap;

use raster::Window;
use reconstruct::{DsmGrid, HeightRange, SURROUNDINGS_M};

use crate::config::DsmConfig;
use crate::error::DsmError;
use crate::images::image_windows::GroundBox;
use crate::images::scene_image::SceneImage;
use crate::memory;

/// Largest side of a chunk, cells: larger ones save little.
const SIDE_MAX: usize = 8192;
/// Least side of a chunk, cells: smaller ones are mostly rim.
pub(crate) const SIDE_MIN: usize = 256;
/// Pixels read around what shows a chunk with its rim. Patches and the aggregation reach out, on
/// coarse levels by several pixels of the image for each of their own.
pub(crate) const MARGIN_PX: usize = 96;
/// Pixels around what shows a chunk with its rim in which heights are searched on the finest level,
/// pixels of it: patches reach two, and a path of the aggregation forgets its start within a few
/// tens. The rim, which only tells speckle and what fills a void, lies between these pixels and
/// what is kept.
pub(crate) const FINEST_MARGIN_PX: usize = 32;
/// Windows begin and end on multiples of this, pixels: whole pixels of seven levels.
pub(crate) const ALIGNED: usize = 64;

/// Returns the largest side of a chunk that the memory allows, cells, when its heights lie in
/// `range`.
///
/// # Errors
/// [`DsmError::Memory`] when the memory allows none, [`DsmError::Camera`] and [`DsmError::Crs`] in
/// the middle of the grid.
pub(crate) fn choose_side(
    config: &DsmConfig,
    images: &[SceneImage],
    grid: &DsmGrid,
    range: HeightRange,
) -> Result<usize, DsmError> {
    let projection = grid.projection()?;
    let needed = |side: usize| {
        let chunk = Window {
            x: (grid.size.0 / 2) as i64 - (side / 2) as i64,
            y: (grid.size.1 / 2) as i64 - (side / 2) as i64,
            width: side,
            height: side,
        };
        let extent = grid.part(chunk.grown(rim(grid)));
        let ground = GroundBox::new(&extent, &projection, range)?;
        let window = |image: &SceneImage| {
            let span = ground.span_in(image, MARGIN_PX)?;
            Ok(aligned(span).intersection(&image.whole()))
        };
        let windows = images.iter().map(window).collect::<Result<Vec<_>, DsmError>>()?;
        Ok::<u64, DsmError>(needed_mb(config, &windows.into_iter().flatten().collect::<Vec<_>>(), &extent))
    };
    if let Some(side) = config.chunk {
        return memory::check(config, needed(side)?).map(|()| side);
    }
    let smallest = needed(SIDE_MIN)?;
    memory::check(config, smallest)?;
    let mut side = SIDE_MIN;
    while side < SIDE_MAX && needed(side + SIDE_MIN)? <= memory::limit_mb(config) {
        side += SIDE_MIN;
    }
    Ok(side)
}

/// Returns the memory needed to compute a grid from windows of the images, megabytes.
pub(crate) fn needed_mb(config: &DsmConfig, windows: &[Window], grid: &DsmGrid) -> u64 {
    let pixels: Vec<u64> = windows.iter().map(memory::area).collect();
    memory::needed_mb(&pixels, memory::area(&grid.whole()), config.preset.tuning().lattices)
}

/// Returns the cells of a core with its rim, inside the grid.
pub(crate) fn with_rim(grid: &DsmGrid, core: Window) -> Window {
    core.grown(rim(grid)).intersection(&grid.whole()).unwrap_or(core)
}

/// Returns the width of the rim around a core, cells.
fn rim(grid: &DsmGrid) -> usize {
    (SURROUNDINGS_M / grid.gsd_m).ceil() as usize
}

/// Returns cores of about equal size that cover the grid, row after row. They are at most `side`
/// cells wide and high.
pub(crate) fn cores(size: (usize, usize), side: usize) -> Vec<Window> {
    let cuts = |length: usize| {
        let n = length.div_ceil(side).max(1);
        (0..n).map(move |i| (length * i / n, length * (i + 1) / n))
    };
    let window = |(x0, x1): (usize, usize), (y0, y1): (usize, usize)| Window {
        x: x0 as i64,
        y: y0 as i64,
        width: x1 - x0,
        height: y1 - y0,
    };
    cuts(size.1).flat_map(|y| cuts(size.0).map(move |x| window(x, y))).collect()
}

/// Cores that share what is found for a block of them.
pub(crate) struct Blocks {
    /// Cells of each block: the least window that holds its cores.
    pub(crate) windows: Vec<Window>,
    /// Position of each core's block; `None` for a core that is as wide or high as its rim.
    pub(crate) of_core: Vec<Option<usize>>,
}

/// Returns the blocks of cores that are narrower than their rim. A block is about four rims wide,
/// so that it is swept with its rim at little more than twice the cost of its cells.
pub(crate) fn blocks(grid: &DsmGrid, cores: &[Window]) -> Blocks {
    let rim = rim(grid);
    let mut windows: Vec<Window> = Vec::new();
    let mut positions = HashMap::new();
    let block_of = |core: &Window| {
        if core.width.max(core.height) >= rim {
            return None;
        }
        let along = |from: i64, length: usize| (from + length as i64 / 2) / (4 * rim) as i64;
        let place = (along(core.x, core.width), along(core.y, core.height));
        let position = *positions.entry(place).or_insert_with(|| {
            windows.push(*core);
            windows.len() - 1
        });
        windows[position] = windows[position].union(core);
        Some(position)
    };
    let of_core = cores.iter().map(block_of).collect();
    Blocks { windows, of_core }
}

/// Returns the quarters of a core.
pub(crate) fn quarters(core: Window) -> Vec<Window> {
    let half = core.width.max(core.height).div_ceil(2);
    let moved = |w: Window| Window { x: w.x + core.x, y: w.y + core.y, ..w };
    cores((core.width, core.height), half).into_iter().map(moved).collect()
}

/// Returns a window widened to multiples of [`ALIGNED`].
pub(crate) fn aligned(w: Window) -> Window {
    let along = |from: i64, length: usize| {
        let start = from.div_euclid(ALIGNED as i64) * ALIGNED as i64;
        (start, ((from - start) as usize + length).next_multiple_of(ALIGNED))
    };
    let ((x, width), (y, height)) = (along(w.x, w.width), along(w.y, w.height));
    Window { x, y, width, height }
}

#[cfg(test)]
mod tests {
    use raster::GeoTransform;

    use super::*;

    #[test]
    fn cores_cover_every_cell_once() {
        for (size, side, n) in [((1000, 700), 300, 12), ((256, 256), 256, 1), ((257, 10), 256, 2)] {
            let cores = cores(size, side);
            assert_eq!(cores.len(), n);
            let cells: usize = cores.iter().map(|c| c.width * c.height).sum();
            assert_eq!(cells, size.0 * size.1);
            assert!(cores.iter().all(|c| c.width <= side && c.height <= side));
            let apart = |a: &Window, b: &Window| a.intersection(b).is_none();
            assert!((0..n).all(|i| (0..i).all(|j| apart(&cores[i], &cores[j]))));
            let parts: Vec<Window> = cores.iter().flat_map(|c| quarters(*c)).collect();
            assert_eq!(parts.iter().map(|c| c.width * c.height).sum::<usize>(), cells);
            assert!(parts.iter().all(|p| cores.iter().filter(|c| c.intersection(p) == Some(*p)).count() == 1));
        }
    }

    #[test]
    fn blocks_hold_their_cores_and_wide_cores_have_none() {
        let geotransform = GeoTransform::north_up(500_000.0, 3_300_000.0, 0.5);
        let grid = DsmGrid { epsg: 32617, geotransform, size: (3000, 2000), gsd_m: 0.5 };
        let rim = rim(&grid);
        let narrow = cores(grid.size, rim / 4);
        let found = blocks(&grid, &narrow);
        for (core, block) in narrow.iter().zip(&found.of_core) {
            assert_eq!(found.windows[block.unwrap()].intersection(core), Some(*core));
        }
        assert!(found.windows.iter().all(|w| w.width.max(w.height) <= 5 * rim), "{:?}", found.windows);
        assert!(blocks(&grid, &cores(grid.size, rim * 2)).of_core.iter().all(Option::is_none));
    }

    #[test]
    fn windows_begin_and_end_on_whole_pixels_of_all_levels() {
        let window = aligned(Window { x: -5, y: 70, width: 100, height: 58 });
        assert_eq!(window, Window { x: -64, y: 64, width: 192, height: 64 });
    }
}
