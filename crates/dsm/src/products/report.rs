//! The report of the products.

use std::path::PathBuf;

use serde::Serialize;

use super::cloud::CloudReport;
use super::colour::ColourReport;
use super::contours::ContoursReport;
use super::mesh::MeshReport;
use surfaces::classes::ClassesReport;
use surfaces::dtm::DtmReport;

/// Products that were made.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct ProductsReport {
    /// Surface model that the products were made of.
    pub surface: PathBuf,
    /// Folder of the products.
    pub folder: PathBuf,
    /// Ortho that gave the colours.
    pub ortho: Option<PathBuf>,
    /// Where the colours come from.
    pub colour: Option<ColourReport>,
    /// The terrain model.
    pub dtm: Option<DtmReport>,
    /// The classes.
    pub classes: Option<ClassesReport>,
    /// The contour lines.
    pub contours: Option<ContoursReport>,
    /// The mesh.
    pub mesh: Option<MeshReport>,
    /// The point cloud.
    pub cloud: Option<CloudReport>,
}

impl ProductsReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let mut line = |name: &str, value: String| text.push_str(&format!("{name:<8} {value}\n"));
        if let (Some(ortho), Some(colour)) = (&self.ortho, &self.colour) {
            let filled = colour.cells_filled;
            line("colours", format!("{} ({filled} cells took the colours around them)", ortho.display()));
        }
        if let Some(dtm) = &self.dtm {
            line("ground", dtm.dtm.display().to_string());
            line("above", dtm.height_above_ground.display().to_string());
        }
        if let Some(classes) = &self.classes {
            line("classes", classes.classes.display().to_string());
        }
        if let Some(cloud) = &self.cloud {
            let CloudReport { laz, copc, extent, .. } = cloud;
            line(
                "points",
                format!("{} ({} points, {} of them filled)", laz.display(), extent.points, extent.synthetic),
            );
            line("", copc.display().to_string());
        }
        if let Some(ContoursReport { file, interval, unit, lines, .. }) = &self.contours {
            line("contours", format!("{} ({lines} lines, every {interval} {unit})", file.display()));
        }
        if let Some(mesh) = &self.mesh {
            let MeshReport { glb, glb_triangles, tileset, tiles, levels, tolerance_m, .. } = mesh;
            line("mesh", format!("{} ({glb_triangles} triangles within {tolerance_m:.2} m)", glb.display()));
            line("", format!("{} ({tiles} tiles in {levels} levels)", tileset.display()));
        }
        text
    }
}
