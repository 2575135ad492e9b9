//! Surface heights from RPC images by sweeping height hypotheses: the method of SkySplat (arXiv
//! 2508.09479) without its trained network.
//!
//! The stages are
//!
//! 1. [`pointing`]: tie points between the views, and one image-space correction per view;
//! 2. [`ranges`], [`Prior`] and [`CoarseGuide`]: the height hypotheses of each pixel;
//! 3. [`cost`]: how little the views agree, per pixel and hypothesis;
//! 4. [`aggregation`]: semi-global sums of the costs along eight directions;
//! 5. [`sweep_level`]: all of that for one view on one pyramid level, read out as a [`HeightMap`]
//!    by a soft-argmin;
//! 6. [`consistency`]: which heights other views confirm;
//! 7. [`fusion`]: the views' heights as one surface on a map grid.
//!
//! Nothing here touches a file. Heights are metres above the ellipsoid on an absolute lattice
//! `k · step`, so that a result does not depend on how the work is divided. Image positions have
//! the centre of the upper-left pixel at (0, 0); level L of a pyramid halves level L − 1.
//!
//! `benches/results/kernels.md` holds the throughput of the kernels and the share of each stage in
//! a run.

pub mod aggregation;
pub mod consistency;
pub mod cost;
pub mod fusion;

mod coarse_guide;
mod error;
mod geometry;
mod height_map;
pub mod level;
pub mod pointing;
mod prior;
pub mod ranges;
mod readout;
mod reference;
mod simd;
mod support;
#[cfg(test)]
mod testing;
mod tiles;
mod view;
mod volume;
mod window_sums;

pub use coarse_guide::CoarseGuide;
pub use error::SweepError;
pub use geometry::source_from_reference;
pub use height_map::HeightMap;
pub use level::{LevelConfig, sweep_level};
pub use prior::Prior;
pub use reference::Reference;
pub use view::{SweepView, ViewLevel};
pub use volume::CostVolume;
