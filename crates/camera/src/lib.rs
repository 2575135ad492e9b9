//! Cameras: the RPC00B model of satellite images, and central perspective cameras ([`Lens`],
//! [`Pose`]).
//!
//! Image coordinates are [`ImagePoint`]s: (sample, line) = (column, row), f64, with the centre of
//! the upper-left pixel at (0, 0). Ground coordinates are [`geodesy::LonLatHeight`]: degrees, and
//! metres above the WGS 84 ellipsoid.
//!
//! - [`Rpc`] projects and localises, [`RpcPlane`] does so at one height, [`RpcCamera`] adds an
//!   [`ImageCorrection`]. [`RpcCamera::project_many`] is for arrays.
//! - [`RpcFit`] fits an RPC to correspondences or to any camera.
//! - [`Rpc::validate`] checks that coefficients form a camera. [`Rpc::domain`] is the box in which
//!   they hold.

mod batch;
mod camera;
mod correction;
mod domain;
mod error;
mod fit;
mod jacobian;
mod limits;
mod localize;
mod perspective;
mod plane;
mod point;
mod polynomial;
mod rpc;
mod similarity;
mod view;

pub use camera::RpcCamera;
pub use correction::ImageCorrection;
pub use domain::ValidityDomain;
pub use error::{CameraError, Key, RpcError};
pub use fit::{Correspondence, FitError, RpcFit};
pub use jacobian::ImageFromGroundJacobian;
pub use limits::EXTRAPOLATION_MAX;
pub use perspective::{Lens, LensError, LensModel, Pose};
pub use plane::RpcPlane;
pub use point::ImagePoint;
pub use rpc::Rpc;
pub use similarity::{Similarity, SimilarityError};
pub use view::{GroundSamplingDistance, ViewDirection};
