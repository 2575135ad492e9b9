//! Surface heights from RPC images by sweeping height hypotheses (the method of SkySplat, arXiv 2508.09479, without
//! its trained network): tie points and pointing → cost volume → semi-global aggregation → soft-argmin →
//! cross-view consistency → fusion on a grid.
//!
//! Nothing here touches a file. Heights are metres above the ellipsoid on an absolute lattice `k · step`, so that a
//! result does not depend on how the work is divided.
//!
//! # Where the time goes
//! Samples of `perf record` in `skysweep dsm` by `benches/profile/shares.py` (default preset, two cores of AMD EPYC, 2026-11-22), in
//! percent, for the seven views of JAX_068 and for the Pléiades triplet of the quarry:
//!
//! | stage | seven views | triplet |
//! |---|--:|--:|
//! | tie points, adjustment, probe, cameras | 17 | 6 |
//! | costs: shifted pictures, census, differences, planes to pixels | 14 | 9 |
//! | consistency | 12 | 5 |
//! | sources laid over tiles and views, pyramids | 10 | 5 |
//! | fusion, speckle, filling, confidence, pictures | 9 | 18 |
//! | read-out, support, ranges | 7 | 10 |
//! | aggregation | 5 | 5 |
//! | the operating system: pages, copies, libraries | 16 | 22 |
//! | files, projections | 6 | 15 |
//! | the rest | 4 | 4 |
//!
//! The kernels on one thread (`make bench-kernels`: 512² pixels, 64 hypotheses each; AMD EPYC of family 26 with AVX-512): 2.0 to 2.2 ·
//! 10⁹ hypotheses per second and source for the costs, 2.1 to 2.3 · 10⁹ for the aggregation over eight directions, 0.60 to 0.77 · 10⁹
//! for a level of a pair as a whole. The aggregation waits for memory, which is asked for ahead, and gains nothing from registers of
//! AVX-512; the costs gain a fifth. In scenes a pixel has ten to twenty hypotheses, so that what is done once per pixel counts as much
//! as the vectors: ranges that follow the heights save more than faster kernels would.

pub mod aggregation;
pub mod consistency;
pub mod cost;
pub mod fusion;

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

pub use error::SweepError;
pub use geometry::source_from_reference;
pub use height_map::HeightMap;
pub use level::{LevelConfig, sweep_level};
pub use prior::Prior;
pub use reference::Reference;
pub use view::{SweepView, ViewLevel};
pub use volume::CostVolume;
