//! Building priors from LoD2 city models, after GS4Buildings (Zhang et al. 2025, arXiv 2508.07355):
//! area-weighted samples, the points that at least k cameras see, and depth, normal, mask, class
//! and object maps per camera.
//!
//! Positions are f64 metres from the recorded origin of the mesh. Results do not depend on the
//! number of threads, and a model at other coordinates (a shift by whole metres) gives the same.
//!
//! - [`PriorModel`] holds the triangles, arranged for rays, [`ModelPlace`] says where on the Earth
//!   they are; [`View`] is a camera in their frame.
//! - [`sample`] spreads points over the surfaces, by count, by density or under a geometric error.
//! - [`Visibility`] counts views per point, and keeps the best of them.
//! - [`PriorMaps`] are what a camera would measure of the model, [`SatelliteMaps`] what a satellite
//!   image would.
//! - [`initial_splats`] are flat Gaussians to begin a training with, [`Schedule`] how much the
//!   priors weigh in it.

mod error;
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
pub use maps::{DepthKind, MISSING_CLASS, MapConfig, NO_OBJECT, NormalFrame, PriorMaps};
pub use model::{PriorModel, buildings_of};
pub use place::ModelPlace;
pub use sample::{Amount, ClassWeights, ErrorCurve, Sample, SampleConfig, Samples, Spacing, error_curve, sample};
pub use satellite::{LinesOfSight, SatelliteMaps};
pub use schedule::{Ramp, Schedule};
pub use splats::initial_splats;
pub use view::{MAX_PIXELS, Rays, View};
pub use visibility::{Observation, ViewCounts, Visibility, VisibilityConfig, Visible};
