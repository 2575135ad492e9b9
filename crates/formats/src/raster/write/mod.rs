//! Rasters, pictures and lines written.

pub(super) mod band;
pub(super) mod contours;
pub(super) mod depth_png;
pub(super) mod geotiff;
pub(super) mod image_copy;
pub(super) mod labels;
pub(super) mod png;
pub(super) mod spool;
pub(super) mod tile;
pub(super) mod verify;
pub(super) mod world_file;
