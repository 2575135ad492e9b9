//! The report of a DTM.

use std::path::PathBuf;

use serde::Serialize;
use terrain::GroundConfig;

use super::layers::SurfaceLayers;

/// A finished terrain model.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct DtmReport {
    /// File of the surface model.
    pub surface: PathBuf,
    /// File of the ground heights.
    pub dtm: PathBuf,
    /// File of the heights above ground.
    pub height_above_ground: PathBuf,
    /// File of the states of the cells.
    pub ground: PathBuf,
    /// CRS of all rasters, with the vertical datum.
    pub crs: String,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Cells that show the ground.
    pub cells_ground: usize,
    /// Cells whose ground was interpolated under objects.
    pub cells_under_objects: usize,
    /// Cells whose ground was interpolated in voids of the surface.
    pub cells_void_filled: usize,
    /// Cells without a height of the ground.
    pub cells_unknown: usize,
    /// Cells where the surface lay below the interpolated ground, and the height above ground is 0.
    pub cells_below_ground: usize,
    /// What the layers beside the surface say of its cells.
    pub layers: SurfaceLayers,
    /// Parameters of the search.
    pub parameters: GroundConfig,
}

impl DtmReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let cells = self.size.0 * self.size.1;
        let share = |n: usize| 100.0 * n as f64 / cells.max(1) as f64;
        format!(
            "ground  {}\nheights {}\nmask    {}\ncells   {cells} ({:.1} % ground, {:.1} % under objects, \
             {:.1} % in voids, {:.1} % unknown)\nlayers  {}\n",
            self.dtm.display(),
            self.height_above_ground.display(),
            self.ground.display(),
            share(self.cells_ground),
            share(self.cells_under_objects),
            share(self.cells_void_filled),
            share(self.cells_unknown),
            self.layers.text(),
        )
    }
}
