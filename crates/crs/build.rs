//! Links the system's PROJ, 9.1 or newer, except in the static build, where `proj-sys` brings its
//! own.
//!
//! The build script of `proj-sys` requires PROJ 9.6 and otherwise compiles its own copy. That takes
//! minutes and puts a second PROJ beside GDAL's into the same process. The feature `nobuild` leaves
//! only the declarations, so this script finds the library.

fn main() {
    if std::env::var_os("CARGO_CFG_SKYSWEEP_STATIC").is_some() {
        return;
    }
    if let Err(error) = pkg_config::Config::new().atleast_version("9.1").probe("proj") {
        panic!(
            "PROJ 9.1 or newer was not found: install its development package (Debian, Ubuntu: \
             apt-get install libproj-dev pkg-config)\n{error}"
        );
    }
}
