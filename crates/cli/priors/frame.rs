//! How the model, its mesh, the cameras and the dataset lie to one another.
//!
//! Mesh = model minus a recorded origin, metres; cameras = similarity of the model (--offset, --transform); dataset = cameras,
//! moved to their middle where they are too far from zero for the f32 of trainers.

use anyhow::Context;
use camera::Similarity;
use city::ModelPoint;
use serde_json::{Value, json};

use super::cameras::Cameras;
use super::options::Args;

/// Farther from zero than this, f32 has steps of a millimetre.
const FAR: f64 = 10_000.0;

/// The frames of a run.
#[derive(Debug)]
pub(super) struct Frame {
    camera_from_model: Similarity,
    camera_from_mesh: Similarity,
    mesh_from_camera: Similarity,
    /// What is subtracted from positions in the cameras' frame.
    moved_by: [f64; 3],
}

impl Frame {
    pub(super) fn new(args: &Args, origin: ModelPoint, cameras: &Cameras) -> anyhow::Result<Self> {
        let camera_from_model = match (&args.transform, args.offset.as_deref()) {
            (Some(path), _) => io::similarity::read(path)?,
            (None, Some(&[x, y, z])) => shift([-x, -y, -z]).context("--offset")?,
            (None, _) => Similarity::IDENTITY,
        };
        let camera_from_mesh = camera_from_model.after(&shift([origin.x, origin.y, origin.z])?);
        let centres = || cameras.model.views.iter().map(|view| view.pose.centre);
        let far = centres().flatten().any(|c| c.abs() > FAR);
        let count = cameras.model.views.len() as f64;
        let mean = [0, 1, 2].map(|i| (centres().map(|c| c[i] / count).sum::<f64>()).round());
        let moved_by = if far { mean } else { [0.0; 3] };
        Ok(Self { camera_from_model, mesh_from_camera: camera_from_mesh.inverse(), camera_from_mesh, moved_by })
    }

    pub(super) fn mesh_from_camera(&self) -> &Similarity {
        &self.mesh_from_camera
    }

    /// Lengths in the dataset per metre.
    pub(super) fn scale(&self) -> f64 {
        self.camera_from_mesh.scale()
    }

    /// A position of the mesh in the dataset.
    pub(super) fn dataset_from_mesh(&self, position: [f64; 3]) -> [f64; 3] {
        self.dataset_from_camera(self.camera_from_mesh.apply(position))
    }

    /// A position of the cameras' frame in the dataset.
    pub(super) fn dataset_from_camera(&self, position: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| position[i] - self.moved_by[i])
    }

    /// A direction of the mesh in the dataset.
    pub(super) fn turn(&self, direction: [f64; 3]) -> [f64; 3] {
        self.camera_from_mesh.turn(direction)
    }

    /// Whether directions are the same in both.
    pub(super) fn turns(&self) -> bool {
        self.camera_from_mesh.rotation() != Similarity::IDENTITY.rotation()
    }

    /// Where the cameras were moved, if they were.
    pub(super) fn moved_by(&self) -> Option<[f64; 3]> {
        Some(self.moved_by).filter(|by| *by != [0.0; 3])
    }

    /// The sidecar of the dataset.
    pub(super) fn describe(&self, crs: &city::CrsReference) -> Value {
        let back = self.camera_from_model.inverse();
        let part = |s: &Similarity, translation: [f64; 3]| json!({ "scale": s.scale(), "rotation": s.rotation(), "translation": translation });
        json!({
            "model_crs": crs.to_string(),
            "model_unit": "metre",
            "dataset_from_model": part(&self.camera_from_model, self.dataset_from_camera(self.camera_from_model.translation())),
            "model_from_dataset": part(&back, back.apply(self.moved_by)),
            "cameras_moved_by": self.moved_by,
            "meaning": "target = scale * rotation * source + translation; the dataset is the cameras' frame minus cameras_moved_by",
        })
    }
}

fn shift(by: [f64; 3]) -> anyhow::Result<Similarity> {
    Ok(Similarity::new(1.0, Similarity::IDENTITY.rotation(), by)?)
}
