//! Every job of the toolkit as a function from a configuration to a report, and [`batch`], which
//! does many of them.
//!
//! [`align_page`] puts the alignment by hand behind a page of the viewer.
//!
//! The jobs live in crates of their own, by what they work on: `dsm`, `surfaces`, `scenes` and
//! `viewer`. What they share is in `job`. All of them are re-exported here.

pub mod align_page;
pub mod batch;
pub mod selftest;

pub use dsm::{self, production, products};
pub use job::{
    corrections, dataset_folder, error, error_text, event_lines, files, image_files, job_file, map_surface,
    placed_model,
};
pub use job::{remote, threads};
pub use scenes::{align, city, mesh, priors, rpc, simulate, splats, split, train};
pub use surfaces::{
    buildings, camera_stand, city_files, classes, diff, dtm, eval, groundview, heightmap, ortho, register, tiles,
};
pub use viewer as view;
