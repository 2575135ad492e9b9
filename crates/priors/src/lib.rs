//! Building priors from LoD2 city models, after GS4Buildings (Zhang et al. 2025, arXiv 2508.07355).
//!
//! Priors are area-weighted samples, the points that at least k cameras see, and depth, normal,
//! mask, class and object maps per camera.
//!
//! Positions are f64 metres from the recorded origin of the mesh. Results do not depend on the
//! number of threads. A model shifted by whole metres gives the same results.
//!
//! - [`PriorModel`] holds the triangles and an index for ray casting. [`ModelPlace`] is their place
//!   on the Earth. [`View`] is a camera in their frame.
//! - [`sample`] distributes points over the surfaces, by count, by density or by geometric error.
//! - [`Visibility`] counts the views that see each point, and keeps the best of them.
//! - [`PriorMaps`] are the maps that a camera would measure of the model, [`SatelliteMaps`] the
//!   maps of a satellite image.
//! - [`initial_splats`] makes flat Gaussians to start a training with. [`splat_labels`] carries
//!   class and object onto splats of any origin. [`Schedule`] holds the weights of the priors
//!   during the training.

mod error;
mod labels;
mod maps;
mod model;
mod place;
mod sample;
mod satellite;
mod schedule;
mod splats;
mod view;
mod visibility;

pub use error::PriorsError;
pub use labels::{splat_labels, surface_label};
pub use maps::{DepthKind, MISSING_CLASS, MapConfig, NO_OBJECT, NormalFrame, PriorMaps};
pub use model::{PriorModel, buildings_of};
pub use place::ModelPlace;
pub use sample::{Amount, ClassWeights, ErrorCurve, Sample, SampleConfig, Samples, Spacing, error_curve, sample};
pub use satellite::{LinesOfSight, SatelliteMaps};
pub use schedule::{Ramp, Schedule};
pub use splats::initial_splats;
pub use view::{MAX_PIXELS, Rays, View};
pub use visibility::{Observation, ViewCounts, Visibility, VisibilityConfig, Visible};
