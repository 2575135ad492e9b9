//! The DSM job: from satellite images to a georeferenced surface model.

mod chunks;
pub mod config;
mod dem;
mod first_look;
pub mod geometry;
mod heights;
mod memory;
mod output;
mod pictures;
mod pointing;
mod prior;
mod probe;
pub mod report;
mod run;
mod scene;
mod setup;
mod surface;
mod tie_windows;

pub use crate::error::PipelineError;
pub use config::{DsmConfig, Fill, Preset};
pub use report::DsmReport;
pub use run::run_dsm;
