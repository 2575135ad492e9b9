//! The report of a building index.

use std::path::PathBuf;

use buildings::BuildingIndexConfig;
use serde::Serialize;

/// A finished building index.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct BuildingMapReport {
    /// The image.
    pub image: PathBuf,
    /// File of the index.
    pub index: PathBuf,
    /// File of this report; its page lies beside it.
    pub report: PathBuf,
    /// File of the surface model on which the index lies, if it does.
    pub surface: Option<PathBuf>,
    /// Columns and rows of the index.
    pub size: (usize, usize),
    /// Side of a pixel of the image on the ground, metres.
    pub gsd_m: f64,
    /// Junctions of two branches that were found in the image.
    pub junctions: usize,
    /// Pairs of junctions that support each other.
    pub pairs: usize,
    /// Cells with an index.
    pub cells_known: usize,
    /// Cells whose index is at least a half.
    pub cells_high: usize,
    /// Parameters of the index.
    pub parameters: BuildingIndexConfig,
}

impl BuildingMapReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let cells = self.size.0 * self.size.1;
        let share = |n: usize| 100.0 * n as f64 / cells.max(1) as f64;
        format!(
            "index   {}\nfound   {} junctions, {} pairs at {:.2} m\ncells   {cells} ({:.1} % known, {:.1} % at 0.5 or more)\n",
            self.index.display(),
            self.junctions,
            self.pairs,
            self.gsd_m,
            share(self.cells_known),
            share(self.cells_high),
        )
    }
}
