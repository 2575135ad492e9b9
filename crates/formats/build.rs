//! Links OpenJPEG in the static build, whose GDAL reads JPEG 2000 with it (`static.cmake`).

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_CFG_SKYSWEEP_STATIC").is_none() {
        return;
    }
    // GDAL is configured with the headers of the system, and linked with the archive that
    // `openjpeg-sys` compiles.
    if let Err(error) = pkg_config::Config::new().cargo_metadata(false).probe("libopenjp2") {
        panic!(
            "OpenJPEG was not found, which the static build needs: install its development package (Debian, \
             Ubuntu: apt-get install libopenjp2-7-dev pkg-config)\n{error}"
        );
    }
    // GDAL's archive comes later on the command line of some linkers and needs all of it.
    println!("cargo:rustc-link-lib=static:+whole-archive=openjp2");
}
