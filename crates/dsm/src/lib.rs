//! The DSM job: from satellite images with RPCs to a georeferenced surface model.
//!
//! [`run`] does everything. It is a chain of stages, each of which is a function from plain values
//! to a plain value that can be written and read back:
//!
//! - [`open`] gives [`Opened`]: images, RPCs, sizes.
//! - [`point()`](point()) gives [`Pointed`]: corrected cameras, tie points, residuals, noise and
//!   contrast of the images.
//! - [`register`] moves the cameras onto a reference elevation model, where one is given.
//! - [`plan()`](plan()) gives [`Plan`]: grid, chunks with their windows, sources, height ranges and
//!   levels, choices with reasons.
//! - [`run_chunk`] gives [`ChunkResult`]: rasters and counts of one chunk.
//! - [`merge()`](merge()) gives [`Product`]: files and report.
//!
//! A scene that fits the memory is a plan of one chunk. A [`Session`] goes along beside the values
//! and keeps what was read, so that a whole run in one process reads each pixel once. The stages
//! use the current rayon thread pool; [`run`] makes one with the configured number of threads.
//!
//! A plan, and the result of a chunk, may go to another process:
//!
//! ```
//! use dsm::{ChunkResult, DsmConfig, HeightRange, Plan, Preset, Session};
//! use dsm::{merge, open, plan, point, run_chunk};
//! use numeric::Silent;
//!
//! let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
//! let folder = tempfile::tempdir()?;
//! let images = ["view_1.tif", "view_3.tif"].map(|name| format!("{town}/{name}").into());
//! let mut config = DsmConfig::new(images.into(), folder.path().join("out"));
//! (config.preset, config.gsd_m) = (Preset::Fast, Some(2.0));
//! config.height_range_m = Some(HeightRange::new(170.0, 280.0));
//!
//! // One process plans.
//! let mut session = Session::new(&Silent);
//! let pointed = point(&config, &open(&config)?, &mut session)?;
//! let json = serde_json::to_string(&plan(&config, &pointed, &mut session)?)?;
//!
//! // Another one computes the chunks.
//! let plan: Plan = serde_json::from_str(&json)?;
//! let chunk = folder.path().join("chunk_0");
//! run_chunk(&plan, 0, &mut Session::new(&Silent))?.write(&chunk)?;
//!
//! // A third one merges them.
//! let product = merge(&plan, [ChunkResult::read(&chunk)], &Silent)?;
//! assert!(product.report.surface.counts.observed > 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod adapters;
mod chunks;
mod config;
mod error;
mod georeferencing;
mod images;
pub mod job_file;
mod masks;
mod memory;
mod notes;
mod planning;
mod pointing;
mod prior;
pub mod production;
pub mod products;
mod report;
mod run;
mod session;
mod stac;
mod writing;

pub use chunks::chunk::{ChunkContent, ChunkResult, ChunkSummary, ChunkSurface, run_chunk};
pub(crate) use chunks::merge::Merger;
pub use chunks::merge::{Product, merge};
pub use config::{DsmConfig, LayerArea};
pub use error::{DsmError, DsmSetting};
pub use georeferencing::register::register;
pub(crate) use images::input_stamps::InputStamps;
pub use images::input_stamps::files_of;
pub use images::open::{Opened, open};
pub use images::radiometry::ImageRadiometry;
pub use images::scene_image::SceneImage;
pub use planning::chunk_plan::{ChunkPlan, ChunkSweep, ChunkWork};
pub use planning::plan::{Plan, PlanReport, plan};
pub use pointing::point::{Pointed, point};
pub use pointing::ties::PairTies;
pub use report::{
    CheckPointReport, ChipReport, ChunksReport, ControlPointReport, ControlReport, CorrectionOrder, DsmReport,
    FailedChunk, ImagePointing, ImageReport, LeftOut, PairReport, PointingReport, PriorReport, ReferenceReport,
    StageTime, SurfaceReport,
};
pub use run::run;
pub use session::Session;
pub use writing::layers::{filled_legend, source_legend};
pub(crate) use writing::output::{DsmFolder, refuse_results, write_config};
pub use writing::output::{FILES, USED_CONFIG};

pub use reconstruct::{
    BuildingFinding, CellCounts, DsmGrid, Fill, HeightRange, ImagePair, KeptPixels, MapBounds, PairGeometry, Preset,
    PriorFindings, ReconstructError, ShadowCounts, SurfaceCounts, SurfaceRasters, SweepLevels, SweepTuning, ViewVotes,
};
