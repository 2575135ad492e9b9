//! Writing moved models.

use std::path::Path;

use camera::Similarity;
use formats::colmap::{ColmapEncoding, ColmapModel, ColmapPoint, ColmapView};
use formats::splat_ply::LocalOrigin;
use serde::Serialize;

use job::files::{self, FileError};
use job::guarded;

/// A COLMAP model with its points.
pub(super) struct ModelWithPoints {
    pub(super) cameras: ColmapModel,
    pub(super) points: Vec<ColmapPoint>,
}

/// Where moved models are written to, and how.
pub(super) struct ModelWriter<'a> {
    pub(super) model: &'a ModelWithPoints,
    pub(super) origin: &'a LocalOrigin,
    pub(super) encoding: ColmapEncoding,
    pub(super) overwrite: bool,
}

/// A similarity as it is written to JSON: target = scale · rotation · source + translation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SimilarityParts {
    /// Length in the target per length in the source.
    pub scale: f64,
    /// Rotation matrix, by rows.
    pub rotation: [[f64; 3]; 3],
    /// Translation in the target.
    pub translation: [f64; 3],
}

impl From<&Similarity> for SimilarityParts {
    fn from(similarity: &Similarity) -> Self {
        Self { scale: similarity.scale(), rotation: similarity.rotation(), translation: similarity.translation() }
    }
}

impl ModelWriter<'_> {
    /// Writes the model moved by a similarity, with its origin and the similarity, into the folder
    /// of a name below an output folder; the output folder itself for no name.
    pub(super) fn write(&self, root: &Path, name: &str, world_from_model: &Similarity) -> Result<(), FileError> {
        let folder = &guarded::make_folder(root, name)?;
        let move_view = |view: &ColmapView| ColmapView { pose: world_from_model.move_pose(&view.pose), ..view.clone() };
        let move_point =
            |point: &ColmapPoint| ColmapPoint { position: world_from_model.apply(point.position), ..point.clone() };
        let moved = ColmapModel {
            lenses: self.model.cameras.lenses.clone(),
            views: self.model.cameras.views.iter().map(move_view).collect(),
        };
        let points: Vec<ColmapPoint> = self.model.points.iter().map(move_point).collect();
        self.origin.write(&folder.join("origin.json"), self.overwrite).map_err(FileError::write)?;
        let parts = SimilarityParts::from(world_from_model);
        files::write_json(&folder.join("similarity.json"), &parts, self.overwrite)?;
        formats::colmap::write(folder, &moved, &points, self.encoding, self.overwrite).map_err(FileError::write)
    }
}
