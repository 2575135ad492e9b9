//! Leave to use the network, which a person gives once for the process.

use std::path::Path;

/// Where PROJ's grids are published; the variable of PROJ names another place.
const GRIDS: &str = "https://cdn.proj.org";
const GRIDS_VARIABLE: &str = "PROJ_NETWORK_ENDPOINT";

/// Lets jobs read rasters whose names in a configuration are addresses (`https://…`). Without this
/// such a name is an error. An address inside a file is never followed, with or without it.
pub fn allow_remote() {
    formats::raster::allow_remote();
}

/// Lets jobs fetch the geoid grids that PROJ does not find from <https://cdn.proj.org>, or from the
/// address in `PROJ_NETWORK_ENDPOINT`. They are kept in PROJ's folder of the user, so that each is
/// fetched once. Without this a missing grid is an error.
pub fn fetch_grids() {
    crs::get_missing_grids_from(fetch_grid);
}

fn fetch_grid(name: &str, folder: &Path) -> Result<(), String> {
    if Path::new(name).file_name().is_none_or(|file| file != name) {
        return Err(format!("'{name}' is not the name of a file"));
    }
    let place = std::env::var(GRIDS_VARIABLE).unwrap_or_else(|_| GRIDS.to_owned());
    let address = format!("{}/{name}", place.trim_end_matches('/'));
    std::fs::create_dir_all(folder).map_err(|error| format!("cannot make a folder ({error}): {}", folder.display()))?;
    let bytes = formats::download(&address, &folder.join(name))?;
    tracing::warn!("fetched {address} ({} kB) into {}", bytes.div_ceil(1000), folder.display());
    Ok(())
}
