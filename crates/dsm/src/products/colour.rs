//! Colours of the cells of a surface, from an ortho.
//!
//! Eight-bit samples become 16 bits by a factor of 257. Other samples are stretched between their
//! 0.5 % and 99.5 % quantiles over all bands, because viewers expect the full range. Cells that the
//! ortho does not show take the mean of the colours around them.

use std::path::Path;

use formats::raster::{ImageSource, LumaRule, SampleType};
use raster::{Grid, fill_voids};
use serde::Serialize;

use super::error::ProductsError;
use super::scene::SurfaceOfRun;

/// Share of the samples beyond each end of the stretch.
const TAIL: f64 = 0.005;
/// Most samples that the quantiles are taken from.
const SAMPLES: usize = 1 << 20;

/// Where colours come from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ColourReport {
    /// Bands that were taken: 3 for red, green and blue, 1 for grey.
    pub bands: usize,
    /// Samples that became black and white.
    pub stretch: (f32, f32),
    /// Cells with a height that the ortho does not show, whose colour is that of their
    /// surroundings.
    pub cells_filled: usize,
}

/// Reads the colours of the cells of a surface.
pub(super) fn colours(surface: &SurfaceOfRun, ortho: &Path) -> Result<(Grid<[u16; 3]>, ColourReport), ProductsError> {
    let source = ImageSource::open(ortho)?;
    let place = source.info().geotransform.ok_or_else(|| ProductsError::OrthoPlace { path: ortho.to_owned() })?;
    let numbers = match &source.info().luma {
        LumaRule::Rgb(numbers) => numbers.to_vec(),
        LumaRule::Single(number) => vec![*number],
        _ => vec![1],
    };
    let mut bands = Vec::with_capacity(numbers.len());
    for &number in &numbers {
        let samples = source.read_samples(number, source.window())?;
        let is_same = place == surface.dem.geotransform && (samples.width(), samples.height()) == surface.size();
        bands.push(if is_same { samples } else { moved(&samples, place, surface) });
    }
    let is_void = |cell: usize| bands.iter().any(|band| band.data()[cell].is_nan());
    let heights = surface.dem.heights.data();
    let cells_filled = (0..heights.len()).filter(|&cell| heights[cell].is_finite() && is_void(cell)).count();
    let stretch = match source.info().sample {
        SampleType::U8 => (0.0, 255.0),
        _ => quantiles(&bands).unwrap_or((0.0, 1.0)),
    };
    if bands.iter().all(|band| band.data().iter().all(|v| v.is_nan())) {
        return Err(ProductsError::OrthoElsewhere { path: ortho.to_owned() });
    }
    let full: Vec<Grid<f32>> = bands.iter().map(fill_voids).collect();
    let (width, height) = surface.size();
    let mut out = Grid::filled(width, height, [0u16; 3]);
    for (cell, colour) in out.data_mut().iter_mut().enumerate() {
        *colour = [0, 1, 2].map(|channel| stretched(full[channel % full.len()].data()[cell], stretch));
    }
    Ok((out, ColourReport { bands: full.len(), stretch, cells_filled }))
}

/// Returns the nearest samples of a raster at the cells of a surface.
fn moved(samples: &Grid<f32>, place: raster::GeoTransform, surface: &SurfaceOfRun) -> Grid<f32> {
    let (width, height) = surface.size();
    let mut out = Grid::filled(width, height, f32::NAN);
    for (cell, value) in out.data_mut().iter_mut().enumerate() {
        let (x, y) = surface.dem.geotransform.map_from_cell((cell % width) as f64, (cell / width) as f64);
        let near = place.cell_from_map(x, y).map(|(column, row)| (column.round(), row.round()));
        if let Some((column, row)) = near.filter(|(column, row)| *column >= 0.0 && *row >= 0.0) {
            *value = samples.get(column as usize, row as usize).copied().unwrap_or(f32::NAN);
        }
    }
    out
}

fn stretched(sample: f32, (low, high): (f32, f32)) -> u16 {
    (65_535.0 * ((sample - low) / (high - low)).clamp(0.0, 1.0)).round() as u16
}

/// Returns the quantiles of the samples of all bands, or nothing for a single value.
fn quantiles(bands: &[Grid<f32>]) -> Option<(f32, f32)> {
    let cells: usize = bands.iter().map(|band| band.data().len()).sum();
    let known = bands.iter().flat_map(|band| band.data()).filter(|v| v.is_finite());
    let mut some: Vec<f32> = known.step_by((cells / SAMPLES).max(1)).copied().collect();
    some.sort_by(f32::total_cmp);
    let at = |share: f64| some.get((share * some.len().saturating_sub(1) as f64) as usize).copied();
    let (low, high) = (at(TAIL)?, at(1.0 - TAIL)?);
    (low < high).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_stretched_to_sixteen_bits() {
        assert_eq!([0.0, 128.0, 255.0, 300.0].map(|v| stretched(v, (0.0, 255.0))), [0, 32_896, 65_535, 65_535]);
        let band = Grid::from_vec(1000, 1, (0..1000).map(|v| v as f32).collect()).unwrap();
        assert_eq!(quantiles(std::slice::from_ref(&band)), Some((4.0, 994.0)));
        assert_eq!(quantiles(&[Grid::filled(3, 3, 7.0)]), None);
        assert_eq!(quantiles(&[Grid::filled(3, 3, f32::NAN)]), None);
    }
}
