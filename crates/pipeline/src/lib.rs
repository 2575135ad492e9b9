//! The jobs of the toolkit, from files to files: configuration, scene set-up, the DSM run, its report.

mod chunks;
pub mod config;
mod dem;
mod dsm;
mod error;
mod first_look;
pub mod geometry;
mod heights;
mod memory;
mod output;
mod pictures;
mod pointing;
mod prior;
mod probe;
pub mod progress;
pub mod report;
mod scene;
mod setup;
mod surface;
mod tie_windows;

pub use config::{DsmConfig, Fill, Preset};
pub use dsm::run_dsm;
pub use error::PipelineError;
pub use progress::{Choice, Progress, Silent};
pub use report::DsmReport;
