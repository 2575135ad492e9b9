//! Every job of the toolkit as a function from a configuration to a report.

pub mod align;
mod as_text;
pub mod camera_stand;
pub mod city;
pub mod city_files;
pub mod corrections;
pub mod dsm;
pub mod error;
mod error_text;
pub mod eval;
pub mod files;
pub mod groundview;
pub mod heightmap;
pub mod map_surface;
pub mod ortho;
mod output_folder;
pub mod placed_model;
pub mod priors;
pub mod remote;
pub mod rpc;
mod run_folder;
pub mod simulate;
pub mod splats;
pub mod split;
pub mod threads;
