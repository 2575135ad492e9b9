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
//! use jobs::dsm::{ChunkResult, DsmConfig, HeightRange, Plan, Preset, Session};
//! use jobs::dsm::{merge, open, plan, point, run_chunk};
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
//! assert!(product.report.surface.observed > 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod character;
mod chips;
mod chunk;
mod chunk_check;
mod chunk_files;
mod chunk_plan;
mod chunk_side;
mod city_prior;
mod clean_up;
mod config;
mod control;
mod control_doubt;
mod covering;
mod dem;
mod doubts;
mod error;
mod evidence;
mod footprints;
mod grid;
mod grid_sight;
mod ground_mask;
mod ground_polygons;
mod height_choice;
mod image_checks;
mod image_mask;
mod image_pixels;
mod image_windows;
mod images;
mod input_stamps;
mod levels;
mod look;
mod memory;
mod merge;
mod notes;
mod open;
mod order;
mod other_fits;
mod output;
mod page;
mod pair_heights;
mod partners;
mod pictures;
mod plan;
mod plan_check;
mod plane_fit;
mod point;
mod prior_findings;
mod prior_verdict;
mod prior_view;
mod probe;
pub(crate) mod rasters;
mod reference_dem;
mod register;
mod report;
mod report_text;
mod run;
mod same_picture;
mod scene_sweep;
mod session;
mod shadow_side;
mod shared_heights;
mod sources;
mod surface;
mod tie_quality;
mod tie_windows;
mod ties;
mod tuning;
mod values;
mod view_geometry;
mod view_heights;

pub use character::ImageCharacter;
pub use chunk::{ChunkContent, ChunkResult, ChunkSurface, run_chunk};
pub use chunk_plan::{ChunkPlan, ChunkSweep, ChunkWork};
pub use config::{DsmConfig, Fill, LayerArea, Preset};
pub use error::{DsmError, DsmSetting};
pub use grid::DsmGrid;
pub use images::SceneImage;
pub(crate) use input_stamps::{InputStamps, files_of};
pub use levels::SweepLevels;
pub(crate) use merge::Merger;
pub use merge::{Product, merge};
pub use open::{Opened, open};
pub(crate) use output::{DsmFolder, FILES, USED_CONFIG, refuse_results, write_config};
pub(crate) use pictures::{filled_legend, source_legend};
pub use plan::{Plan, PlanReport, plan};
pub use point::{Pointed, point};
pub use prior_findings::{BuildingFinding, PriorFindings, ViewVotes};
pub use rasters::ChunkRasters;
pub use register::register;
pub use report::{
    CheckPointReport, ChipReport, ChunksReport, ControlPointReport, ControlReport, CorrectionOrder, DsmReport,
    FailedChunk, ImagePointing, ImageReport, LeftOut, PairReport, PointingReport, PriorReport, ReferenceReport,
    StageTime, SurfaceReport,
};
pub use run::run;
pub use session::Session;
pub use shadow_side::ShadowCounts;
pub use surface::{KeptPixels, SurfaceCounts};
pub use ties::PairTies;
pub use tuning::SweepTuning;
pub use values::{HeightRange, ImagePair, MapBounds};
pub use view_geometry::PairGeometry;
pub use view_heights::{ViewHeights, ViewImage, sweep_views};

pub use sweep::SweepError;
