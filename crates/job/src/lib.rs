//! What every job shares: output folders that hold nothing half-written, job files, corrections of
//! cameras, worker threads, errors, and pages.

pub mod as_text;
pub mod corrections;
pub mod dataset_folder;
pub mod error;
pub mod error_text;
pub mod event_lines;
pub mod files;
pub mod guarded;
pub mod image_files;
pub mod job_file;
pub mod job_paths;
pub mod map_surface;
pub mod output_folder;
pub mod path_variables;
pub mod placed_model;
pub mod remote;
pub mod report_page;
pub mod run_folder;
pub mod run_links;
mod same_view;
pub mod threads;
