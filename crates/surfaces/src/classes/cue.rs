//! What a building index says at the cells of a surface, and where the heights are weak or unsure.

use std::path::Path;

use classes::ClassifyConfig;
use formats::raster::{Dem, read_dem};
use numeric::upper_median;
use raster::Grid;

use super::error::ClassesError;
use crate::eval::EvalJobError;
use crate::eval::on_reference::surface_on_reference;
use crate::surface_layer::{FILLED_FLAGS, SIGMA, layer_beside};
use job::files::FileError;
use sweep::fusion::OBSERVED;

/// A building index at the cells of a surface.
pub(super) struct Cue {
    pub(super) index: Grid<f32>,
    /// Cells whose height was not observed, or whose standard deviation is half the least height of
    /// a building or more.
    pub(super) weak: Grid<bool>,
}

impl Cue {
    /// Reads a building index, and the standard deviations and filled cells of the run that made
    /// the surface, where they lie beside it.
    pub(super) fn read(path: &Path, surface: &Dem, config: &ClassifyConfig) -> Result<Self, ClassesError> {
        let unusable = |error: EvalJobError| ClassesError::Cue(error.into());
        let raster = read_dem(path).map_err(|error| unusable(error.into()))?;
        let outside = raster.heights.data().iter().find(|value| value.is_finite() && !(0.0..=1.0).contains(*value));
        if let Some(&found) = outside {
            return Err(ClassesError::CueRange { path: path.to_owned(), found });
        }
        let index = surface_on_reference(&raster, surface).map_err(unusable)?;
        let mut weak = surface.heights.map(|_| false);
        if let Some(sigma) = beside(surface, SIGMA)? {
            let most_m = (0.5 * config.least_height_m) as f32;
            weak.data_mut().iter_mut().zip(sigma.data()).for_each(|(weak, s)| *weak |= *s >= most_m);
        }
        if let Some(filled) = beside(surface, FILLED_FLAGS)? {
            let observed = f32::from(OBSERVED);
            weak.data_mut().iter_mut().zip(filled.data()).for_each(|(weak, state)| *weak |= *state != observed);
        }
        Ok(Self { index, weak })
    }
}

/// Standard deviation from which a height is unsure, in those of the median cell of the surface. On
/// level ground nine of ten cells are below twice the median.
const UNSURE: f32 = 2.5;

/// Returns the cells of a surface whose heights were not observed or are less certain than most;
/// `None` where no standard deviations lie beside the surface.
pub(super) fn unsure_heights(surface: &Dem) -> Result<Option<Grid<bool>>, ClassesError> {
    let Some(sigma) = beside(surface, SIGMA)? else { return Ok(None) };
    let mut known: Vec<f32> = sigma.data().iter().copied().filter(|s| s.is_finite()).collect();
    let Some(median) = upper_median(&mut known) else { return Ok(None) };
    let mut unsure = sigma.map(|s| *s > UNSURE * median);
    if let Some(filled) = beside(surface, FILLED_FLAGS)? {
        let observed = f32::from(OBSERVED);
        unsure.data_mut().iter_mut().zip(filled.data()).for_each(|(unsure, state)| *unsure |= *state != observed);
    }
    Ok(Some(unsure))
}

/// Reads a raster beside a surface; `None` where there is none of its size.
fn beside(surface: &Dem, name: &str) -> Result<Option<Grid<f32>>, ClassesError> {
    Ok(layer_beside(surface, name).map_err(FileError::write)?)
}
