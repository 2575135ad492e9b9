//! The files of a run: rasters, pictures and report.

mod image_tables;
pub(super) mod layers;
pub(super) mod output;
pub(super) mod page;
pub(super) mod pictures;
pub(super) mod report_text;
