//! A vegetation index of multispectral images at the cells of a surface.
//!
//! Each image is laid on the surface as an ortho is, with the pointing correction that the run
//! found for it or for the panchromatic image of the same pass. A cell takes the index of the image
//! that sees it most steeply, as what the surface lacks leans away from the sensor. Crowns that the
//! surface lacks are looked for above it: there the images agree about them, and disagree about
//! what lies beside.

use std::path::{Path, PathBuf};

use classes::{SpectralCells, black_level, nir_gain, vegetation_index};
use crs::Crs;
use io::raster::{Band, BandData, CogRaster, Dem, ImageSource, IndexBands, write_cog};
use numeric::Progress;
use raster::{Grid, Window};
use serde::Serialize;

use super::config::ClassesConfig;
use super::error::ClassesError;
use crate::ortho::{self, OrthoConfig, OrthoReport};
use job::corrections::Corrections;
use job::files::FileError;
use job::threads;

/// Height above the surface at which crowns are looked for that the surface lacks, metres: a little
/// above the middle of a small crown over the ground that stands in its place.
const CROWN_M: f32 = 3.0;
/// Names in the work folder.
const LIFTED: &str = "lifted.tif";
const ORTHO: &str = "ortho.tif";

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
        (surface, crs): (&Dem, Crs),
        roofs: &Grid<bool>,
        progress: &dyn Progress,
    ) -> Result<Self, ClassesError> {
        let work = tempfile::tempdir().map_err(|source| FileError::Folder { path: std::env::temp_dir(), source })?;
        let lifted = work.path().join(LIFTED);
        let heights = surface.heights.map(|height| height + CROWN_M);
        let bands = [Band { description: "height_m", data: BandData::F32(&heights) }];
        write_cog(&lifted, &CogRaster::new(&bands, surface.geotransform, crs), false).map_err(FileError::from)?;
        let corrections = Corrections::for_surface(&config.surface, &config.corrections)?;
        let layer = Layer { config, surface, corrections: &corrections, ortho: work.path().join(ORTHO) };
        let nothing = || surface.heights.map(|_| f32::NAN);
        let (mut index, mut sums, mut counts) = (nothing(), nothing(), surface.heights.map(|_| 0u16));
        let mut found = Vec::new();
        for path in &config.multispectral {
            progress.check_cancelled()?;
            found.push(layer.look(path, roofs, &lifted, progress)?);
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
    surface: &'a Dem,
    corrections: &'a Corrections,
    /// File for the orthos, one after the other.
    ortho: PathBuf,
}

impl Layer<'_> {
    /// Returns the index of one image on the surface and on the lifted one.
    fn look(
        &self,
        path: &Path,
        roofs: &Grid<bool>,
        lifted: &Path,
        progress: &dyn Progress,
    ) -> Result<(IndexImage, Grid<f32>, Grid<f32>), ClassesError> {
        let Self { config, surface, .. } = self;
        let source = ImageSource::open(path)?;
        let bands = source
            .index_bands(config.red_band.as_ref(), config.nir_band.as_ref())?
            .ok_or_else(|| ClassesError::NoIndexBands { path: path.to_owned(), bands: source.info().bands })?;
        let (report, red, nir) = self.lay(path, &surface.path, bands, progress)?;
        let black = [&red, &nir].map(black_level);
        let mut cells = SpectralCells { red: &red, nir: &nir, black, nir_gain: 1.0 };
        cells.nir_gain = nir_gain(&cells, roofs);
        let index = vegetation_index(&cells);
        let (_, red, nir) = self.lay(path, lifted, bands, progress)?;
        let above = vegetation_index(&SpectralCells { red: &red, nir: &nir, ..cells });
        let part = report.images.first();
        let image = IndexImage {
            path: path.to_owned(),
            red_band: bands.red,
            nir_band: bands.nir,
            black,
            nir_gain: cells.nir_gain,
            corrected: part.is_some_and(|part| part.corrected),
            incidence_deg: part.map_or(0.0, |part| part.incidence_deg),
            cells_seen: part.map_or(0, |part| part.counts.seen),
        };
        Ok((image, index, above))
    }

    /// Lays an image on a surface with the cells of ours, and returns red and near infrared.
    fn lay(
        &self,
        path: &Path,
        surface: &Path,
        bands: IndexBands,
        progress: &dyn Progress,
    ) -> Result<(OrthoReport, Grid<f32>, Grid<f32>), ClassesError> {
        let mut laid = OrthoConfig::new(vec![path.to_owned()], surface.to_owned(), self.ortho.clone());
        (laid.threads, laid.overwrite) = (Some(threads::count(self.config.threads)), true);
        let whole = Window::whole(self.surface.heights.width(), self.surface.heights.height());
        let report = ortho::run_in_window(&laid, whole, self.corrections, progress)?;
        let ortho = ImageSource::open(&self.ortho)?;
        let band = |number| ortho.read_samples(number, ortho.window());
        Ok((report, band(bands.red)?, band(bands.nir)?))
    }
}
