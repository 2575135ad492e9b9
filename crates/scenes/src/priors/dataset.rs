//! Everything that a dataset for perspective cameras is written from.

use ::priors::{PriorModel, SampleConfig, Samples, View, Visible};
use cityfiles::CityFile;

use super::cameras::SceneCameras;
use super::config::PriorsConfig;
use super::frame::DatasetFrame;
use super::images::Pictures;

/// Inputs and results of a run, before they are written.
#[derive(Debug)]
pub(super) struct Dataset<'a> {
    pub(super) config: &'a PriorsConfig,
    pub(super) file: &'a CityFile,
    pub(super) model: &'a PriorModel,
    pub(super) cameras: &'a SceneCameras,
    pub(super) frame: &'a DatasetFrame,
    /// The cameras in the frame of the mesh.
    pub(super) views: &'a [View],
    pub(super) sampling: &'a SampleConfig,
    pub(super) samples: &'a Samples,
    pub(super) visible: &'a Visible,
    /// The pictures, where they are part of the dataset.
    pub(super) pictures: Option<&'a Pictures>,
    /// Number of objects of the model that could not be used.
    pub(super) unusable: usize,
}
