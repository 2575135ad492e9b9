//! Leave to read rasters from a network, which a person gives once for the process.

/// Lets jobs read rasters whose names in a configuration are addresses (`https://…`). Without this
/// such a name is an error. An address inside a file is never followed, with or without it.
pub fn allow_remote() {
    io::raster::allow_remote();
}
