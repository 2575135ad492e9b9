//! The ortho of a tile as an 8-bit picture, and the maps of the page of a list.

use std::path::Path;

use formats::raster::{ImageSource, LumaRule, RasterError, write_png_rgb, write_world_file};
use raster::Grid;
use report::MapLayer;

use super::error::TilesError;
use super::manifest::{TileFate, TileRecord, TilesReport};
use job::files::FileError;
use job::report_page::{relief_layer, shown_range, thinned};

/// Tiles that are shown on the page.
const SHOWN: usize = 4;

/// Writes red, green and blue of an ortho, or its first band as grey, with a world file. Returns
/// the values that are black and white in each band. Cells without a value are black.
pub(super) fn write(ortho: &Path, picture: &Path) -> Result<Vec<[f32; 2]>, TilesError> {
    let source = ImageSource::open(ortho)?;
    let Shown { pixels, ranges } = shown(&source)?;
    write_png_rgb(picture, &pixels, true).map_err(FileError::from)?;
    if let Some(place) = source.info().geotransform {
        write_world_file(picture, place, 1).map_err(FileError::from)?;
    }
    Ok(ranges)
}

/// An ortho as an 8-bit picture.
struct Shown {
    pixels: Grid<[u8; 3]>,
    /// Values that are black and white in each band.
    ranges: Vec<[f32; 2]>,
}

/// Returns an ortho as a picture. Cells without a value are black.
fn shown(source: &ImageSource) -> Result<Shown, TilesError> {
    let bands: Vec<usize> = match &source.info().luma {
        LumaRule::Rgb(bands) => bands.to_vec(),
        _ => vec![1],
    };
    let window = source.window();
    let read = |band: &usize| source.read_samples(*band, window);
    let values = bands.iter().map(read).collect::<Result<Vec<Grid<f32>>, RasterError>>()?;
    let ranges: Vec<[f32; 2]> = values.iter().map(|band| shown_range(band).into()).collect();
    let shown = |band: usize, cell: usize| {
        let ([low, high], value) = (ranges[band], values[band].data()[cell]);
        // Void cells are NaN, which becomes 0.
        (255.0 * (value - low) / (high - low).max(f32::MIN_POSITIVE)).round() as u8
    };
    let mut pixels = Grid::filled(window.width, window.height, [0u8; 3]);
    for (cell, pixel) in pixels.data_mut().iter_mut().enumerate() {
        *pixel = [0, 1, 2].map(|i| shown(i.min(bands.len() - 1), cell));
    }
    Ok(Shown { pixels, ranges })
}

/// Returns heights and orthos of the first tiles of a list for its page.
pub(super) fn layers(folder: &Path, report: &TilesReport, pixel_m: f64) -> Result<Vec<MapLayer>, TilesError> {
    let there = report.tiles.iter().filter(|tile| !matches!(tile.fate, TileFate::Failed { .. }));
    let mut layers = Vec::new();
    for TileRecord { id, .. } in there.take(SHOWN) {
        let heights = ImageSource::open(folder.join(id).join("height.tif"))?;
        let heights = heights.read_samples(1, heights.window())?;
        let caption = "Heights relative to the camera, shaded.";
        layers.push(relief_layer(&format!("{id}: heights"), caption, &heights, pixel_m));
        let ortho = shown(&ImageSource::open(folder.join(id).join("ortho.tif"))?)?;
        layers.push(MapLayer {
            name: format!("{id}: ortho"),
            picture: thinned(&ortho.pixels).0,
            caption: "The images on the pixels of the heights; black where nothing is seen.".to_owned(),
            legend: None,
        });
    }
    Ok(layers)
}
