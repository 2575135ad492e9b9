//! What GDAL may open, and how it is set up.

pub(super) mod gdal_access;
pub(super) mod gdal_setup;
pub(super) mod named_files;
pub(super) mod web_file;
pub(super) mod web_files;
