//! Makes a bird's-eye height map around a camera, turned to its heading.
//!
//! `cargo run --release --example height_map [OUTPUT.tif]`

#![allow(clippy::print_stdout, reason = "an example shows its results on the terminal")]

use std::error::Error;
use std::path::PathBuf;

use skysweep::jobs::camera_stand::{StandConfig, StandSource};
use skysweep::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let dsm = concat!(env!("CARGO_MANIFEST_DIR"), "/data-samples/town/truth/dsm.tif");
    let output = || std::env::temp_dir().join("skysweep_example_height_map.tif");
    let output = std::env::args_os().nth(1).map_or_else(output, PathBuf::from);

    let mut stand = StandConfig::new(StandSource::Position { lon_deg: 5.4, lat_deg: 43.53 });
    stand.heading_deg = Some(37.0);
    let mut config = HeightMapConfig::new(dsm.into(), output, stand);
    config.size_px = 256;
    config.overwrite = true;
    heightmap::run(&config, &Silent)?;
    println!("the height map is in {}", config.output.display());
    Ok(())
}
