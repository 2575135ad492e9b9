//! The report of a class raster.

use std::path::PathBuf;

use classes::ClassifyConfig;
use serde::Serialize;
use terrain::GroundConfig;

use super::layers::ClassLayers;
use super::multispectral::IndexImage;

/// A finished class raster.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct ClassesReport {
    /// File of the surface model.
    pub surface: PathBuf,
    /// File of the classes.
    pub classes: PathBuf,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Cells of bare ground.
    pub cells_ground: usize,
    /// Cells of buildings.
    pub cells_building: usize,
    /// Cells of plants on the ground; none without a vegetation index.
    pub cells_low_vegetation: usize,
    /// Cells of vegetation that stands.
    pub cells_vegetation: usize,
    /// Cells of water; none without a vegetation index.
    pub cells_water: usize,
    /// Cells without a height or without ground.
    pub cells_unknown: usize,
    /// Whether a vegetation index took part.
    pub has_vegetation_index: bool,
    /// File of the vegetation index, where it was made of images.
    pub vegetation_index: Option<PathBuf>,
    /// The multispectral images, the steepest first.
    pub index_images: Vec<IndexImage>,
    /// Whether a building index took part.
    pub has_building_index: bool,
    /// Cells whose height was not observed or is uncertain, where the building index decides.
    pub cells_weak: usize,
    /// Share of the cells with heights that show the ground, 0 to 1.
    pub ground_share: f64,
    /// What the layers beside the surface say of its cells.
    pub layers: ClassLayers,
    /// Parameters of the search for the ground.
    pub terrain: GroundConfig,
    /// Parameters of the classes.
    pub parameters: ClassifyConfig,
}

impl ClassesReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let cells = self.size.0 * self.size.1;
        let share = |n: usize| 100.0 * n as f64 / cells.max(1) as f64;
        format!(
            "classes {}\ncells   {cells} ({:.1} % ground, {:.1} % low vegetation, {:.1} % building, {:.1} % vegetation, \
             {:.1} % water, {:.1} % unknown)\nseen    {:.1} % of the heights show the ground\nlayers  {}\n",
            self.classes.display(),
            share(self.cells_ground),
            share(self.cells_low_vegetation),
            share(self.cells_building),
            share(self.cells_vegetation),
            share(self.cells_water),
            share(self.cells_unknown),
            100.0 * self.ground_share,
            self.layers.text(),
        )
    }
}
