//! Maps of a run that are reduced to a size that can be looked at: the pictures beside the rasters,
//! the layers of the page, and their styles for QGIS.
//!
//! Heights, σ and confidence are averaged over squares of cells. Codes and counts are those of the
//! cell in the middle of the square, because a mean of codes is no code.

use std::path::Path;

use formats::raster::write_world_file;
use raster::{Grid, Light, Window};
use reconstruct::DsmGrid;
use report::MapLayer;
use sweep::fusion::FILLED;

use crate::error::DsmError;
use crate::writing::layers::{FILLED_FLAGS, HEIGHT_PERCENTILES, HEIGHTS, LAYERS, Layer, SIGMA};
use job::files::FileError;

/// Largest width and height of the pictures beside the rasters, of the layers of the page, and of
/// the thumbnail, pixels.
const PICTURE_SIDE: usize = 4096;
const LAYER_SIDE: usize = 1000;
const THUMBNAIL_SIDE: usize = 256;
/// Distance and width of the stripes over filled cells, and their grey value.
const HATCH: (usize, usize, u8) = (8, 1, 30);

/// Reads a window of a raster of a run, by its place in [`LAYERS`]; NaN is no-data.
pub(crate) type ReadLayer<'a> = &'a dyn Fn(usize, Window) -> Result<Grid<f32>, DsmError>;

/// The maps of a run, reduced for the page.
#[derive(Debug, Clone)]
pub(crate) struct RunMaps {
    /// In the order of [`LAYERS`].
    maps: Vec<Grid<f32>>,
    /// Whether the cell was filled.
    pub(crate) filled: Grid<bool>,
    cell_m: f64,
}

impl RunMaps {
    /// Reads and reduces the maps.
    ///
    /// # Errors
    /// Those of `read`.
    pub(crate) fn read(grid: &DsmGrid, read: ReadLayer<'_>) -> Result<Self, DsmError> {
        let factor = factor(grid.size, LAYER_SIDE);
        let maps: Vec<Grid<f32>> =
            (0..LAYERS.len()).map(|layer| reduced(read, layer, grid.size, factor)).collect::<Result<_, _>>()?;
        let filled = maps[FILLED_FLAGS].map(|v| *v == f32::from(FILLED));
        Ok(Self { maps, filled, cell_m: grid.gsd_m * factor as f64 })
    }

    /// Returns the heights, metres.
    pub(crate) fn heights(&self) -> &Grid<f32> {
        &self.maps[HEIGHTS]
    }

    /// Returns the standard deviations, metres.
    pub(crate) fn sigma(&self) -> &Grid<f32> {
        &self.maps[SIGMA]
    }

    /// Returns the layers of the page.
    pub(crate) fn layers(&self) -> Vec<MapLayer> {
        let shown = |(place, (layer, map)): (usize, (&Layer, &Grid<f32>))| {
            let (name, caption) = layer.on_page?;
            let legend = (layer.legend)(map);
            let picture = if place == HEIGHTS { relief(map, self.cell_m) } else { legend.picture(map) };
            Some(MapLayer { name: name.to_owned(), picture, caption: caption.to_owned(), legend: Some(legend) })
        };
        LAYERS.iter().zip(&self.maps).enumerate().filter_map(shown).collect()
    }

    /// Writes the style for QGIS of each raster below the folder of a run.
    ///
    /// # Errors
    /// [`DsmError::File`].
    pub(crate) fn write_styles(&self, folder: &Path) -> Result<(), DsmError> {
        for (layer, map) in LAYERS.iter().zip(&self.maps) {
            let style = (layer.legend)(map).qml();
            formats::write_bytes(folder.join(layer.style), style.as_bytes(), false).map_err(FileError::from)?;
        }
        Ok(())
    }
}

/// Writes hillshade, coloured relief and a thumbnail, with their world files. Filled cells are
/// hatched in the relief, and cells without a height have a colour of their own in all of them.
///
/// # Errors
/// Those of `read`; [`DsmError::Image`] and [`DsmError::File`] when a file cannot be written.
pub(crate) fn write_pictures(folder: &Path, grid: &DsmGrid, read: ReadLayer<'_>) -> Result<(), DsmError> {
    let side = factor(grid.size, PICTURE_SIDE);
    let heights = reduced(read, HEIGHTS, grid.size, side)?;
    let filled = reduced(read, FILLED_FLAGS, grid.size, side)?;
    let cell_m = grid.gsd_m * side as f64;
    let shade = raster::hillshade(&heights, (cell_m, cell_m), Light::default());
    formats::raster::write_png_rgb(folder.join("hillshade.png"), &raster::shade_picture(&shade), false)?;
    drop(shade);
    let mut picture = relief(&heights, cell_m);
    hatch(&mut picture, &filled);
    formats::raster::write_png_rgb(folder.join("relief.png"), &picture, false)?;
    for name in ["hillshade.png", "relief.png"] {
        write_world_file(&folder.join(name), grid.geotransform, side).map_err(FileError::from)?;
    }
    drop((heights, filled, picture));
    let side = factor(grid.size, THUMBNAIL_SIDE);
    let small = relief(&reduced(read, HEIGHTS, grid.size, side)?, grid.gsd_m * side as f64);
    formats::raster::write_png_rgb(folder.join("thumbnail.png"), &small, false)?;
    let thumbnail = folder.join("thumbnail.png");
    write_world_file(&thumbnail, grid.geotransform, side).map_err(FileError::from)?;
    Ok(())
}

/// Returns the coloured relief of heights in cells of `cell_m`.
fn relief(heights: &Grid<f32>, cell_m: f64) -> Grid<[u8; 3]> {
    let shade = raster::hillshade(heights, (cell_m, cell_m), Light::default());
    let (low, high) =
        raster::height_percentiles(heights, HEIGHT_PERCENTILES.0, HEIGHT_PERCENTILES.1).unwrap_or((0.0, 1.0));
    raster::coloured_relief(heights, &shade, low, high)
}

/// Draws stripes over filled cells.
fn hatch(picture: &mut Grid<[u8; 3]>, filled: &Grid<f32>) {
    let (distance, width, grey) = HATCH;
    for y in 0..picture.height() {
        for (x, (pixel, filled)) in picture.row_mut(y).iter_mut().zip(filled.row(y)).enumerate() {
            if *filled == f32::from(FILLED) && (x + y) % distance < width {
                *pixel = pixel.map(|c| ((u16::from(c) + 2 * u16::from(grey)) / 3) as u8);
            }
        }
    }
}

/// Returns the side of the squares of cells that become one pixel.
fn factor(size: (usize, usize), most: usize) -> usize {
    size.0.max(size.1).div_ceil(most).max(1)
}

/// Reads a map and reduces it by `factor`.
fn reduced(read: ReadLayer<'_>, layer: usize, size: (usize, usize), factor: usize) -> Result<Grid<f32>, DsmError> {
    let (width, height) = size;
    let mut out = Grid::filled(width.div_ceil(factor), height.div_ceil(factor), f32::NAN);
    for y in 0..out.height() {
        let top = y * factor;
        let strip = Window { x: 0, y: top as i64, width, height: factor.min(height - top) };
        let cells = read(layer, strip)?;
        if !LAYERS[layer].is_averaged() {
            let middle = cells.row(cells.height() / 2);
            let of = |x: usize| middle[(x * factor + factor / 2).min(width - 1)];
            out.row_mut(y).iter_mut().enumerate().for_each(|(x, cell)| *cell = of(x));
            continue;
        }
        let mut sums = vec![(0.0f64, 0u32); out.width()];
        for row in 0..cells.height() {
            for (x, h) in cells.row(row).iter().enumerate().filter(|(_, h)| !h.is_nan()) {
                let (sum, n) = &mut sums[x / factor];
                *sum += f64::from(*h);
                *n += 1;
            }
        }
        for (cell, (sum, n)) in out.row_mut(y).iter_mut().zip(sums).filter(|(_, (_, n))| *n > 0) {
            *cell = (sum / f64::from(n)) as f32;
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_not_averaged_and_heights_are() {
        let cells: Vec<f32> = vec![1.0, 1.0, 10.0, f32::NAN, 3.0, 1.0, 10.0, 4.0];
        let whole = Grid::from_vec(4, 2, cells).unwrap();
        let read = |_: usize, window: Window| Ok(whole.window(window, f32::NAN));
        let heights = reduced(&read, HEIGHTS, (4, 2), 2).unwrap();
        assert_eq!(heights.data(), [1.5, 8.0]);
        let source = LAYERS.iter().position(|layer| layer.stem == "source").unwrap();
        let codes = reduced(&read, source, (4, 2), 2).unwrap();
        assert_eq!(codes.data(), [1.0, 4.0]);
    }
}
