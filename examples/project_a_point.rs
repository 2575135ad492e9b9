//! Projects a ground point into a satellite image through the image's RPC, and finds the point
//! again.
//!
//! `cargo run --example project_a_point [IMAGE]`

#![allow(clippy::print_stdout, reason = "an example shows its results on the terminal")]

use std::error::Error;
use std::path::PathBuf;

use skysweep::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let sample = || concat!(env!("CARGO_MANIFEST_DIR"), "/data-samples/town/view_1.tif").into();
    let image: PathBuf = std::env::args_os().nth(1).map_or_else(sample, PathBuf::from);

    let camera = RpcCamera::new(read_rpc(&image)?.rpc);
    let centre = camera.rpc.domain().centre;
    let ground = LonLatHeight { height_m: centre.height_m + 10.0, ..centre };
    let pixel = camera.project(ground)?;
    println!(
        "{:.6} {:.6} {:.2} m is seen at sample {:.3}, line {:.3}",
        ground.lon_deg, ground.lat_deg, ground.height_m, pixel.sample, pixel.line
    );

    let found = camera.localize(pixel, ground.height_m)?;
    println!("the pixel sees {:.6} {:.6} at that height", found.lon_deg, found.lat_deg);
    println!("one pixel is {:.2} m on the ground", camera.gsd(ground)?.mean_m());
    Ok(())
}
