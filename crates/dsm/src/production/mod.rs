//! Production: a surface model as a plan, chunks and a merge, which may run in several processes.
//!
//! A run is a folder, a plan is a file, a chunk is an atomic result:
//!
//! - [`plan_run`] looks at the whole scene and writes `used_config.toml`, `pointing.json` and
//!   `plan.json`.
//! - [`run_chunks`] computes chunks into `chunks/NNNN`. Any number of processes may do so at once.
//! - [`merge_run`] makes the products.
//!
//! The stages are those of [`crate`]; a run without a plan gives the same bytes. A run that is
//! killed goes on where it was. Inputs, the configuration and the plan are known by their hashes:
//! what has changed is refused, or planned and computed again, and never mixed.

mod chunk_folder;
mod chunk_run;
mod chunk_selection;
mod claim;
mod content_hash;
mod error;
mod estimate;
mod input_files;
mod make_or_resume;
mod merge_run;
mod plan_cache;
mod plan_file;
mod plan_run;
mod plan_text;
mod product_file;

pub use chunk_folder::ChunkWorker;
pub use chunk_folder::{CHUNKS, is_chunk, is_left_over};
pub use chunk_run::{ChunkFault, ChunkRunConfig, ChunkRunReport, run_chunks};
pub use chunk_selection::{ChunkSelection, ChunkSelectionError};
pub use content_hash::of_value as hash_of;
pub use estimate::{ChunkEstimate, PlanEstimate};
pub use input_files::InputFile;
pub use input_files::{added as added_input, check_inputs, inputs_of};
pub use make_or_resume::make_or_resume;
pub use merge_run::{MergeConfig, merge_run};
pub use plan_file::PlanFile;
pub use plan_file::{PLAN, POINTING};
pub use plan_run::{make_plan, plan_run};
pub use product_file::ProductFile;
