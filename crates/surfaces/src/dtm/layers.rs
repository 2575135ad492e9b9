//! What a surface says of its cells: the layers that a DSM run writes beside `dsm.tif`.
//!
//! Filled cells are no evidence of the ground. Cells whose height is hardly ever right count only
//! where many of them support a lower ground. Other weak cells still show much ground. The standard
//! errors tell how far the ground is smoothed.

use formats::raster::Dem;
use numeric::Progress;
use raster::Grid;
use serde::Serialize;
use terrain::{BareGround, GroundConfig, bare_ground_of_observed, with_supported_ground};

use super::error::DtmError;
use crate::surface_layer::{self, NO_LAYERS, SIGMA};
use job::files::FileError;

/// Probability below which a cell alone is no evidence: the DSM itself drops such heights where
/// those around are weak, too. On ten simulated places 0.1 gives a worse ground, and 0.35 no better
/// one.
const LEAST_CONFIDENCE: f32 = 0.25;

/// Layers that were found beside a surface, and what they say.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct SurfaceLayers {
    /// Names of the files that were read.
    pub files: Vec<String>,
    /// Cells with a filled height.
    pub cells_filled: usize,
    /// Observed cells whose probability is too low to be evidence by itself.
    pub cells_weak: usize,
}

impl SurfaceLayers {
    /// Says in one line which layers were read and what they changed.
    pub(crate) fn text(&self) -> String {
        if self.files.is_empty() {
            return NO_LAYERS.to_owned();
        }
        let (filled, weak) = (self.cells_filled, self.cells_weak);
        let is_smoothed = self.files.iter().any(|name| name == SIGMA);
        let smoothed = if is_smoothed { "; the ground is smoothed as far as its heights are uncertain" } else { "" };
        format!(
            "{}: {filled} filled cells are no evidence of the ground, and {weak} weak ones count only where many \
             agree{smoothed}",
            self.files.join(", ")
        )
    }
}

/// Finds the ground under a surface by the layers beside it. The streets of dense quarters show
/// hardly any but weak heights: together these can support a lower ground.
///
/// # Errors
/// [`DtmError::Job`] for a layer that cannot be read, [`DtmError::Terrain`]. A layer of another
/// size is not one of this surface.
pub(crate) fn bare_ground(
    surface: &Dem,
    cell_m: f64,
    config: &GroundConfig,
    progress: &dyn Progress,
) -> Result<(BareGround, SurfaceLayers), DtmError> {
    let weak = surface_layer::weak_cells(surface, LEAST_CONFIDENCE).map_err(FileError::write)?;
    let mut ground = bare_ground_of_observed(&surface.heights, weak.mask.as_ref(), cell_m, config, progress)?;
    if weak.mask.is_some() {
        let observed = surface.heights.without(|cell| weak.filled.data()[cell]);
        ground = with_supported_ground(ground, &observed, cell_m);
    }
    let cells_filled = weak.filled_count();
    Ok((ground, SurfaceLayers { files: weak.files, cells_filled, cells_weak: weak.doubtful }))
}

/// Reads the standard errors of the heights, metres, if they lie beside the surface, and adds their
/// file to the layers.
///
/// # Errors
/// As [`bare_ground`].
pub(crate) fn standard_errors(surface: &Dem, layers: &mut SurfaceLayers) -> Result<Option<Grid<f32>>, DtmError> {
    let sigma_m = surface_layer::layer_beside(surface, SIGMA).map_err(FileError::write)?;
    layers.files.extend(sigma_m.is_some().then(|| SIGMA.to_owned()));
    Ok(sigma_m)
}
