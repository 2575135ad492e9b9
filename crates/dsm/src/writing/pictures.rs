//! Maps of a run that are reduced to a size that can be looked at: the pictures beside the rasters,
//! the layers of the page, and their styles for QGIS.
//!
//! Heights, σ and confidence are averaged over squares of cells. Codes and counts are those of the
//! cell in the middle of the square, because a mean of codes is no code.

use std::path::Path;

use io::raster::write_world_file;
use raster::{Grid, Light, Window};
use report::{Legend, LightEnd, MapLayer};
use surfaces::surface_layer::FILLED;
use sweep::fusion::CellSource;

use crate::error::DsmError;
use crate::planning::grid::DsmGrid;
use job::files::FileError;

/// Largest width and height of the pictures beside the rasters, of the layers of the page, and of
/// the thumbnail, pixels.
const PICTURE_SIDE: usize = 4096;
const LAYER_SIDE: usize = 1000;
const THUMBNAIL_SIDE: usize = 256;
/// Percentiles of the heights between which colours are spread, so that one mast does not take them
/// from the rest.
const HEIGHT_PERCENTILES: (f64, f64) = (1.0, 99.0);
/// Percentile of σ at which its colours end.
const SIGMA_PERCENTILE: f64 = 98.0;
/// Distance and width of the stripes over filled cells, and their grey value.
const HATCH: (usize, usize, u8) = (8, 1, 30);

/// One of the rasters of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layer {
    /// Heights above the vertical datum, metres.
    Heights,
    /// Standard deviations, metres.
    Sigma,
    /// Numbers of views.
    Views,
    /// Probabilities that the height is right.
    Confidence,
    /// 1 where a height was filled.
    Filled,
    /// Codes of [`CellSource`].
    Source,
}

impl Layer {
    const fn is_averaged(self) -> bool {
        matches!(self, Self::Heights | Self::Sigma | Self::Confidence)
    }
}

/// Reads a window of a raster of a run; NaN is no-data.
pub(crate) type ReadLayer<'a> = &'a dyn Fn(Layer, Window) -> Result<Grid<f32>, DsmError>;

/// The maps of a run, reduced for the page.
#[derive(Debug, Clone)]
pub(crate) struct RunMaps {
    /// Heights, metres.
    pub(crate) heights: Grid<f32>,
    /// Standard deviations, metres.
    pub(crate) sigma: Grid<f32>,
    views: Grid<f32>,
    confidence: Grid<f32>,
    source: Grid<f32>,
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
        let map = |layer: Layer| reduced(read, layer, grid.size, factor);
        Ok(Self {
            heights: map(Layer::Heights)?,
            sigma: map(Layer::Sigma)?,
            views: map(Layer::Views)?,
            confidence: map(Layer::Confidence)?,
            source: map(Layer::Source)?,
            filled: map(Layer::Filled)?.map(|v| *v == f32::from(FILLED)),
            cell_m: grid.gsd_m * factor as f64,
        })
    }

    /// Returns the legends of the rasters, with the name of their files.
    fn legends(&self) -> [(&'static str, Legend); 6] {
        let (low, high) =
            raster::height_percentiles(&self.heights, HEIGHT_PERCENTILES.0, HEIGHT_PERCENTILES.1).unwrap_or((0.0, 1.0));
        let sigma = raster::height_percentiles(&self.sigma, 0.0, SIGMA_PERCENTILE).map_or(1.0, |(_, high)| high);
        let views = self.views.data().iter().copied().filter(|v| v.is_finite()).fold(2.0, f32::max);
        [
            ("dsm", Legend::heights(low, high, "m")),
            ("sigma", Legend::sequential(0.0, f64::from(sigma), LightEnd::Low, "m")),
            ("views", Legend::sequential(0.0, f64::from(views), LightEnd::High, "views")),
            ("confidence", Legend::sequential(0.0, 1.0, LightEnd::High, "")),
            ("filled", filled_legend()),
            ("source", source_legend()),
        ]
    }

    /// Returns the layers of the page.
    pub(crate) fn layers(&self) -> Vec<MapLayer> {
        let [heights, sigma, views, confidence, _, source] = self.legends().map(|(_, legend)| legend);
        let relief = relief(&self.heights, self.cell_m);
        let layer = |name: &str, picture, legend, caption: &str| MapLayer {
            name: name.to_owned(),
            picture,
            caption: caption.to_owned(),
            legend: Some(legend),
        };
        let (of_sigma, of_views) = (sigma.picture(&self.sigma), views.picture(&self.views));
        let (of_confidence, of_source) = (confidence.picture(&self.confidence), source.picture(&self.source));
        vec![
            layer("Heights", relief, heights, "Heights above the vertical datum, shaded from the north-west."),
            layer("σ", of_sigma, sigma, "Standard deviation of the height; an estimate where the cell was filled."),
            layer("Source", of_source, source, "Where each height comes from, or why there is none."),
            layer("Confidence", of_confidence, confidence, "Probability that the height is right to a few σ."),
            layer("Views", of_views, views, "Number of views that observed the height; none where it was filled."),
        ]
    }

    /// Writes a style of QGIS beside each raster, under the raster's name.
    ///
    /// # Errors
    /// [`DsmError::File`].
    pub(crate) fn write_styles(&self, folder: &Path) -> Result<(), DsmError> {
        for (name, legend) in self.legends() {
            io::write_bytes(folder.join(format!("{name}.qml")), legend.qml().as_bytes(), false)
                .map_err(FileError::from)?;
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
    let heights = reduced(read, Layer::Heights, grid.size, side)?;
    let filled = reduced(read, Layer::Filled, grid.size, side)?;
    let cell_m = grid.gsd_m * side as f64;
    let shade = raster::hillshade(&heights, (cell_m, cell_m), Light::default());
    io::raster::write_png_rgb(folder.join("hillshade.png"), &raster::shade_picture(&shade), false)?;
    drop(shade);
    let mut picture = relief(&heights, cell_m);
    hatch(&mut picture, &filled);
    io::raster::write_png_rgb(folder.join("relief.png"), &picture, false)?;
    for name in ["hillshade.png", "relief.png"] {
        write_world_file(&folder.join(name), grid.geotransform, side).map_err(FileError::from)?;
    }
    drop((heights, filled, picture));
    let side = factor(grid.size, THUMBNAIL_SIDE);
    let small = relief(&reduced(read, Layer::Heights, grid.size, side)?, grid.gsd_m * side as f64);
    io::raster::write_png_rgb(folder.join("thumbnail.png"), &small, false)?;
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
fn reduced(read: ReadLayer<'_>, layer: Layer, size: (usize, usize), factor: usize) -> Result<Grid<f32>, DsmError> {
    let (width, height) = size;
    let mut out = Grid::filled(width.div_ceil(factor), height.div_ceil(factor), f32::NAN);
    for y in 0..out.height() {
        let top = y * factor;
        let strip = Window { x: 0, y: top as i64, width, height: factor.min(height - top) };
        let cells = read(layer, strip)?;
        if !layer.is_averaged() {
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

/// Returns the colours of the origins of heights: greens and blues for heights, browns and greys
/// for voids.
pub fn source_legend() -> Legend {
    let code = |source: CellSource, colour: [u8; 3], text| (source.code(), colour, text);
    Legend::Codes(vec![
        code(CellSource::Observed, [86, 160, 96], "observed"),
        code(CellSource::FilledHidden, [86, 140, 200], "filled: hidden ground"),
        code(CellSource::FilledSurface, [240, 200, 80], "filled: surface that does not match"),
        code(CellSource::FilledNarrow, [150, 205, 225], "filled: narrow gap"),
        code(CellSource::FilledStreet, [170, 130, 200], "filled: street between roofs"),
        code(CellSource::Unmatched, [200, 90, 60], "void: no match"),
        code(CellSource::Blank, [120, 90, 70], "void: one grey value"),
        code(CellSource::Hidden, [70, 70, 110], "void: hidden"),
        code(CellSource::Masked, [40, 40, 40], "void: masked"),
    ])
}

/// Returns the colours of observed and filled cells.
pub fn filled_legend() -> Legend {
    Legend::Codes(vec![(0, [86, 160, 96], "observed"), (FILLED, [240, 200, 80], "filled")])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_not_averaged_and_heights_are() {
        let cells: Vec<f32> = vec![1.0, 1.0, 10.0, f32::NAN, 3.0, 1.0, 10.0, 4.0];
        let whole = Grid::from_vec(4, 2, cells).unwrap();
        let read = |_: Layer, window: Window| Ok(whole.window(window, f32::NAN));
        let heights = reduced(&read, Layer::Heights, (4, 2), 2).unwrap();
        assert_eq!(heights.data(), [1.5, 8.0]);
        let codes = reduced(&read, Layer::Source, (4, 2), 2).unwrap();
        assert_eq!(codes.data(), [1.0, 4.0]);
    }

    #[test]
    fn every_source_has_a_colour() {
        let Legend::Codes(codes) = source_legend() else { unreachable!("the sources are codes") };
        let mut colours: Vec<[u8; 3]> = codes.iter().map(|(_, colour, _)| *colour).collect();
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(colours.len(), 9);
    }
}
