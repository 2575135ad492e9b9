//! A vegetation index of multispectral images at the cells of a surface.
//!
//! Each image is laid on the surface as an ortho is, with the pointing correction that the run
//! found for it or for the panchromatic image of the same pass. A cell takes the index of the image
//! that sees it most steeply, as what the surface lacks leans away from the sensor. Crowns that the
//! surface lacks are looked for above it: there the images agree about them, and disagree about
//! what lies beside.

use std::path::{Path, PathBuf};

use classes::{SpectralCells, black_level, nir_gain, vegetation_index};
use formats::raster::{Dem, ImageSource};
use numeric::Progress;
use raster::Grid;
use serde::Serialize;

use super::config::ClassesConfig;
use super::error::ClassesError;
use crate::ortho::{self, OrthoError, OrthoSurface};
use job::corrections::Corrections;

/// Height above the surface at which crowns are looked for that the surface lacks, metres: a little
/// above the middle of a small crown over the ground that stands in its place.
const CROWN_M: f32 = 3.0;

/// An image that gave the vegetation index.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct IndexImage {
    /// The image.
    pub path: PathBuf,
    /// Band of red, counted from 1.
    pub red_band: usize,
    /// Band of near infrared, counted from 1.
    pub nir_band: usize,
    /// Values of a black surface in both: path radiance and dark current.
    pub black: [f32; 2],
    /// Factor that brings the near infrared to the scale of red, so that roofs are grey.
    pub nir_gain: f32,
    /// Whether the pointing was corrected.
    pub corrected: bool,
    /// Angle from the vertical, degrees.
    pub incidence_deg: f64,
    /// Cells that the image sees.
    pub cells_seen: usize,
}

/// The vegetation index of multispectral images.
pub(super) struct ImageIndex {
    /// On the surface, from the steepest image that sees a cell.
    pub(super) index: Grid<f32>,
    /// Above the surface, the mean of the images that see a cell.
    pub(super) of_crowns: Grid<f32>,
    pub(super) images: Vec<IndexImage>,
}

impl ImageIndex {
    /// Makes the index of the multispectral images of a configuration. `roofs` are cells of
    /// buildings.
    pub(super) fn of_images(
        config: &ClassesConfig,
        surface: &Dem,
        roofs: &Grid<bool>,
        progress: &dyn Progress,
    ) -> Result<Self, ClassesError> {
        let ground = OrthoSurface::of(surface.clone(), None, progress)?;
        let above = ground.raised(CROWN_M)?;
        let corrections = Corrections::for_surface(&config.surface, &config.corrections)?;
        let layer = Layer { config, ground, above, corrections: &corrections };
        let nothing = || surface.heights.map(|_| f32::NAN);
        let (mut index, mut sums, mut counts) = (nothing(), nothing(), surface.heights.map(|_| 0u16));
        let mut found = Vec::new();
        for path in &config.multispectral {
            progress.check_cancelled()?;
            found.push(layer.look(path, roofs, progress)?);
        }
        found.sort_by(|a, b| a.0.incidence_deg.total_cmp(&b.0.incidence_deg));
        for (_, on_surface, above) in &found {
            for (at, value) in index.data_mut().iter_mut().enumerate() {
                if value.is_nan() {
                    *value = on_surface.data()[at];
                }
                let crown = above.data()[at];
                if crown.is_finite() {
                    let sum = &mut sums.data_mut()[at];
                    *sum = if sum.is_nan() { crown } else { *sum + crown };
                    counts.data_mut()[at] += 1;
                }
            }
        }
        sums.data_mut().iter_mut().zip(counts.data()).for_each(|(sum, count)| *sum /= f32::from(*count));
        Ok(Self { index, of_crowns: sums, images: found.into_iter().map(|(image, ..)| image).collect() })
    }
}

/// What the images are laid on.
struct Layer<'a> {
    config: &'a ClassesConfig,
    /// The surface.
    ground: OrthoSurface,
    /// The surface at the height of crowns that it lacks.
    above: OrthoSurface,
    corrections: &'a Corrections,
}

impl Layer<'_> {
    /// Returns the index of one image on the surface and above it.
    fn look(
        &self,
        path: &Path,
        roofs: &Grid<bool>,
        progress: &dyn Progress,
    ) -> Result<(IndexImage, Grid<f32>, Grid<f32>), ClassesError> {
        let source = ImageSource::open(path)?;
        let bands = source
            .index_bands(self.config.red_band.as_ref(), self.config.nir_band.as_ref())?
            .ok_or_else(|| ClassesError::NoIndexBands { path: path.to_owned(), bands: source.info().bands })?;
        let camera = self.corrections.camera(path, progress).map_err(OrthoError::from)?;
        let image = self.ground.image(path, source, camera.clone())?;
        let (width, height) = (self.ground.dsm.heights.width() as f64, self.ground.dsm.heights.height() as f64);
        let (corrected, incidence_deg) = (image.corrected, image.eyeline.incidence_deg(width / 2.0, height / 2.0));
        let laid = ortho::lay(&self.ground, image, progress)?;
        let (red, nir) = (&laid.bands[bands.red - 1], &laid.bands[bands.nir - 1]);
        let black = [red, nir].map(black_level);
        let mut cells = SpectralCells { red, nir, black, nir_gain: 1.0 };
        cells.nir_gain = nir_gain(&cells, roofs);
        let index = vegetation_index(&cells);
        let image = self.above.image(path, ImageSource::open(path)?, camera)?;
        let above = ortho::lay(&self.above, image, progress)?;
        let (red, nir) = (&above.bands[bands.red - 1], &above.bands[bands.nir - 1]);
        let above = vegetation_index(&SpectralCells { red, nir, ..cells });
        let image = IndexImage {
            path: path.to_owned(),
            red_band: bands.red,
            nir_band: bands.nir,
            black,
            nir_gain: cells.nir_gain,
            corrected,
            incidence_deg,
            cells_seen: laid.counts.first().map_or(0, |counts| counts.seen),
        };
        Ok((image, index, above))
    }
}
