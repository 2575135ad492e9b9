//! The configuration of an ortho.

use std::path::PathBuf;

use crs::VerticalDatum;
use ortho::MosaicRule;
use serde::{Deserialize, Serialize};

use super::laying::{Laying, TOLERANCE_M};
use job::corrections::CorrectionSource;
use job::error::{JobError, SettingError};
use job::run_folder::surface_file;

/// Most images of an ortho: the mask holds their numbers as bytes.
const IMAGES_MAX: usize = 255;

/// An ortho of one or more images on a surface model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct OrthoConfig {
    /// Images with RPCs, at most 255.
    pub images: Vec<PathBuf>,
    /// Surface model on a map, or the folder of a DSM run.
    pub surface: PathBuf,
    /// GeoTIFF to write; the mask is written beside it.
    pub output: PathBuf,
    /// Cell size, metres. `None` takes the grid of the surface model.
    pub cell_m: Option<f64>,
    /// Area on the map of the surface model: x_min, y_min, x_max, y_max. `None` takes all of it.
    pub bounds: Option<[f64; 4]>,
    /// Where the pointing corrections of the images come from.
    pub corrections: CorrectionSource,
    /// Vertical datum of the surface model, where the file names none or a wrong one.
    pub surface_vertical: Option<VerticalDatum>,
    /// Height by which the surface must stand above a line of sight to hide what is behind it,
    /// metres.
    pub tolerance_m: f64,
    /// Whether the grey values of several images are brought together.
    pub balance: bool,
    /// How the values of several images become one.
    pub mosaic: MosaicRule,
    /// Whether cells that are hidden in every image take the value of what hides them. Otherwise
    /// they are no-data.
    pub keep_hidden: bool,
    /// Worker threads. `None` uses all cores.
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

impl OrthoConfig {
    /// An ortho on the grid of the surface model.
    pub fn new(images: Vec<PathBuf>, surface: PathBuf, output: PathBuf) -> Self {
        Self {
            images,
            surface,
            output,
            cell_m: None,
            bounds: None,
            corrections: CorrectionSource::default(),
            surface_vertical: None,
            tolerance_m: TOLERANCE_M,
            balance: true,
            mosaic: MosaicRule::Best,
            keep_hidden: false,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`JobError`] for a number outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        if self.images.is_empty() || self.images.len() > IMAGES_MAX {
            return Err(SettingError::new("the number of images", self.images.len(), "1 to 255").into());
        }
        if self.tolerance_m.is_nan() || self.tolerance_m < 0.0 {
            return Err(SettingError::new("the tolerance", self.tolerance_m, "metres").into());
        }
        if let Some(cell) = self.cell_m.filter(|cell| !(*cell > 0.0 && cell.is_finite())) {
            return Err(SettingError::new("the cell size", cell, "a positive number of metres").into());
        }
        Ok(())
    }

    /// Returns how the images are laid on the surface.
    pub(super) const fn laying(&self) -> Laying {
        Laying {
            tolerance_m: self.tolerance_m,
            balance: self.balance,
            mosaic: self.mosaic,
            keep_hidden: self.keep_hidden,
        }
    }

    /// Returns the file of the mask.
    pub fn mask(&self) -> PathBuf {
        let stem = self.output.file_stem().unwrap_or_default().to_string_lossy();
        self.output.with_file_name(format!("{stem}_mask.tif"))
    }

    /// Returns the style of QGIS for the mask.
    pub(crate) fn mask_style(&self) -> PathBuf {
        self.mask().with_extension("qml")
    }

    /// Returns the file of the report.
    pub(crate) fn report(&self) -> PathBuf {
        let stem = self.output.file_stem().unwrap_or_default().to_string_lossy();
        self.output.with_file_name(format!("{stem}_report.json"))
    }

    /// Returns the file of the surface model.
    pub(super) fn surface_file(&self) -> PathBuf {
        surface_file(&self.surface)
    }
}
