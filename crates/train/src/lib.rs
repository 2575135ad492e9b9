//! Flat Gaussians that learn: a differentiable rasteriser of surfels on the CPU.
//!
//! * [`Surfel`]: the parameters of a 2D Gaussian (Huang et al., "2D Gaussian Splatting for
//!   Geometrically Accurate Radiance Fields", SIGGRAPH 2024).
//! * [`SurfelCamera`]: pinhole cameras and satellite images.
//! * [`Drawing`]: images of colour, coverage, depth, normal and distortion, and the gradient of a
//!   loss by all parameters. [`Drawing::labels`] is the map of the labels that surfels have.
//! * [`Trainer`]: surfels learn from views, with the depths and normals of a prior model where
//!   there is one (GS4Buildings), within a budget of surfels.

mod adam;
mod arrange;
mod backward;
mod bands;
mod config;
mod densify;
mod footprint;
mod forward;
mod harmonics;
mod image;
mod labels;
mod lattice;
mod loss;
mod normals;
mod order;
mod planes;
mod raster;
mod screen;
mod simd;
mod ssim;
mod state;
mod surfel;
mod trainer;
mod view;

pub use config::{DensifyConfig, HarmonicsConfig, LearningRates, LossWeights, Recipe, Regularisation, TrainingConfig};
pub use densify::DensifyCounts;
pub use harmonics::LearnedHarmonics;
pub use image::{DepthSpread, SurfelImages};
pub use lattice::{LatticeBox, LatticeView};
pub use loss::{LossTerms, TrainingView, ViewAppearance, ViewSlopes};
pub use order::spatial_order;
pub use raster::{Drawing, MAX_SIDE, SurfelGradients};
pub use simd::Registers;
pub use state::{CheckpointDefect, TrainingState};
pub use surfel::Surfel;
pub use trainer::{Trainer, TrainingStep};
pub use view::{AffineView, LocalView, PinholeView, SurfelCamera};
