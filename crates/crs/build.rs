//! Links the system's PROJ, 9.1 or newer.
//!
//! The build script of `proj-sys` asks for PROJ 9.6 and otherwise compiles a copy of its own. That would take
//! minutes and put a second PROJ beside the one that GDAL uses into the same process. Its feature `nobuild`
//! leaves only the declarations, and this script finds the library.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if let Err(error) = pkg_config::Config::new().atleast_version("9.1").probe("proj") {
        println!(
            "cargo:warning=PROJ 9.1 or newer was not found: install its development package (Debian, Ubuntu: \
             apt-get install libproj-dev pkg-config)"
        );
        eprintln!("{error}");
        std::process::exit(1);
    }
}
