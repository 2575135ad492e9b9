//! Reads the tile with the points and cameras of the reference.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use camera::{Lens, Pose};
use city::{ModelPoint, SurfaceClass};
use formats::colmap::{self, ColmapModel};
use formats::npy::{self, NpyData};
use priors::{PriorModel, Sample, View};
use serde_json::Value;

use super::arranged;

/// Offset of the reference from the tile's coordinates, metres.
const OFFSET: ModelPoint = ModelPoint::new(85_320.0, 446_656.0, 0.0);

/// A model, and points and cameras in its frame.
pub(crate) struct Scene {
    pub(crate) folder: PathBuf,
    pub(crate) model: PriorModel,
    pub(crate) points: Vec<Sample>,
    pub(crate) cameras: ColmapModel,
    shift: [f64; 3],
}

impl Scene {
    /// Reads the triangles that the reference was computed with.
    pub(crate) fn of_reference(city: &Path) -> anyhow::Result<Self> {
        Self::of(city, "peer_reference/mesh_local.ply", ModelPoint::default())
    }

    /// Triangulates the tile ourselves.
    pub(crate) fn of_tile(city: &Path) -> anyhow::Result<Self> {
        Self::of(city, "3dbag_5910.city.json", OFFSET)
    }

    fn of(city: &Path, model: &str, offset: ModelPoint) -> anyhow::Result<Self> {
        let model = arranged(&city.join(model))?;
        let folder = city.join("peer_reference");
        let shift = offset.from_origin(model.mesh().origin);
        let path = folder.join("points_f64.npy");
        let NpyData::F64(numbers) = npy::read(&path)?.data else { bail!("expected float64: {}", path.display()) };
        let sample = |p: &[f64; 3]| Sample {
            position: [0, 1, 2].map(|i| p[i] + shift[i]),
            normal: [0.0; 3],
            spacing_m: 0.0,
            triangle: 0,
            object: 0,
            class: SurfaceClass::Unclassified,
        };
        let points = numbers.as_chunks::<3>().0.iter().map(sample).collect();
        let cameras = colmap::read(&folder.join("sparse/0"))?;
        Ok(Self { folder, model, points, cameras, shift })
    }

    /// Reads the lens that all cameras share.
    pub(crate) fn lens(&self) -> &Lens {
        &self.cameras.lenses[0]
    }

    /// Reads the cameras, in the frame of the model.
    pub(crate) fn views(&self) -> impl Iterator<Item = View> + '_ {
        self.cameras.views.iter().map(|view| {
            let centre = [0, 1, 2].map(|i| view.pose.centre[i] + self.shift[i]);
            View { lens: self.cameras.lenses[view.lens].clone(), pose: Pose { centre, ..view.pose } }
        })
    }

    /// Returns the path of a file of the reference.
    pub(crate) fn json(&self, name: &str) -> anyhow::Result<Value> {
        let path = self.folder.join(name);
        let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        Ok(serde_json::from_slice(&bytes)?)
    }
}
