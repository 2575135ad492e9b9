//! The frames of a dataset: model, mesh, cameras and dataset.
//!
//! Mesh = model minus a recorded origin, metres. Cameras = similarity of the model (an offset or a
//! transform). Dataset = cameras, shifted to their middle where they are too far from zero for the
//! f32 of trainers.

use ::priors::View;
use camera::Similarity;
use city::ModelPoint;
use formats::colmap::ColmapView;
use serde_json::{Value, json};

use super::cameras::SceneCameras;
use super::config::PriorsConfig;
use super::error::PriorsJobError;

/// Distance from zero above which f32 has steps of a millimetre, metres.
const FAR: f64 = 10_000.0;

/// How the frames of a run lie to one another.
#[derive(Debug)]
pub(super) struct DatasetFrame {
    camera_from_model: Similarity,
    camera_from_mesh: Similarity,
    mesh_from_camera: Similarity,
    /// Shift subtracted from positions in the cameras' frame.
    moved_by: [f64; 3],
}

impl DatasetFrame {
    pub(super) fn new(
        config: &PriorsConfig,
        origin: ModelPoint,
        cameras: &SceneCameras,
    ) -> Result<Self, PriorsJobError> {
        let camera_from_model = match (&config.transform, config.offset) {
            (Some(path), _) => formats::similarity::read(path)?,
            (None, Some([x, y, z])) => shift([-x, -y, -z]).map_err(PriorsJobError::Offset)?,
            (None, None) => Similarity::IDENTITY,
        };
        let camera_from_mesh = camera_from_model.after(&shift([origin.x, origin.y, origin.z])?);
        let centres = || cameras.model.views.iter().map(|view| view.pose.centre);
        let far = centres().flatten().any(|c| c.abs() > FAR);
        let count = cameras.model.views.len() as f64;
        let mean = [0, 1, 2].map(|i| (centres().map(|c| c[i] / count).sum::<f64>()).round());
        let moved_by = if far { mean } else { [0.0; 3] };
        Ok(Self { camera_from_model, mesh_from_camera: camera_from_mesh.inverse(), camera_from_mesh, moved_by })
    }

    /// Returns the cameras in the frame of the mesh.
    pub(super) fn views(&self, cameras: &SceneCameras) -> Vec<View> {
        let view = |v: &ColmapView| View {
            lens: cameras.model.lenses[v.lens].clone(),
            pose: self.mesh_from_camera.move_pose(&v.pose),
        };
        cameras.model.views.iter().map(view).collect()
    }

    /// Length in the dataset per metre.
    pub(super) fn scale(&self) -> f64 {
        self.camera_from_mesh.scale()
    }

    /// Returns the position in the dataset of a position in the mesh.
    pub(super) fn dataset_from_mesh(&self, position: [f64; 3]) -> [f64; 3] {
        self.dataset_from_camera(self.camera_from_mesh.apply(position))
    }

    /// Returns the position in the dataset of a position in the cameras' frame.
    pub(super) fn dataset_from_camera(&self, position: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| position[i] - self.moved_by[i])
    }

    /// Returns the direction in the dataset of a direction in the mesh.
    pub(super) fn turn(&self, direction: [f64; 3]) -> [f64; 3] {
        self.camera_from_mesh.turn(direction)
    }

    /// Whether directions differ between the mesh and the dataset.
    pub(super) fn turns(&self) -> bool {
        self.camera_from_mesh.rotation() != Similarity::IDENTITY.rotation()
    }

    /// Shift subtracted from the cameras' positions, where there is one.
    pub(super) fn moved_by(&self) -> Option<[f64; 3]> {
        Some(self.moved_by).filter(|by| *by != [0.0; 3])
    }

    /// Returns the content of `origin.json`.
    pub(super) fn describe(&self, crs: &city::CrsReference) -> Value {
        let back = self.camera_from_model.inverse();
        let part = |s: &Similarity, translation: [f64; 3]| json!({ "scale": s.scale(), "rotation": s.rotation(), "translation": translation });
        let translation = self.dataset_from_camera(self.camera_from_model.translation());
        json!({
            "model_crs": crs.to_string(),
            "model_unit": "metre",
            "dataset_from_model": part(&self.camera_from_model, translation),
            "model_from_dataset": part(&back, back.apply(self.moved_by)),
            "cameras_moved_by": self.moved_by,
            "meaning": "target = scale * rotation * source + translation; the dataset is the cameras' frame minus cameras_moved_by",
        })
    }
}

fn shift(by: [f64; 3]) -> Result<Similarity, camera::SimilarityError> {
    Similarity::new(1.0, Similarity::IDENTITY.rotation(), by)
}
