//! Alignment of camera models to the world: a similarity between positions known in both, robust
//! against outliers.
//!
//! - [`fit_similarity`] is the least-squares similarity of pairs (Umeyama 1991).
//! - [`align`] finds it among outliers: triples of pairs propose similarities, and the fit to the
//!   pairs that agree is repeated until nothing changes.
//! - [`align_upright`] adds the up direction of the cameras, for positions on a line.
//! - [`fit_level`] leaves what is up in the model as it is, for fewer than three pairs.
//! - [`sensitivity`] measures what noise in the positions or in the heading does to the alignment.
//!
//! Positions are f64. Source positions are in the unit of the model, target positions in metres
//! from a local origin.

mod error;
mod gravity;
mod noise;
mod robust;
mod umeyama;

pub use error::AlignError;
pub use gravity::{CameraUp, camera_up, fit_level, plane_normal};
pub use noise::{Disturbance, MeanStd, NoiseConfig, NoiseLevel, disturbed, sensitivity};
pub use robust::{AlignConfig, ModelAlignment, align, align_upright, tilt_sigma_deg};
pub use umeyama::{PointPair, fit_similarity, spread_ratio};
