//! Makes the building priors of a city model for a satellite image: height, distance, normal and
//! mask maps.
//!
//! `cargo run --release --example priors_of_a_tile [OUTPUT [MODEL IMAGE…]]`

#![allow(clippy::print_stdout, reason = "an example shows its results on the terminal")]

use std::error::Error;
use std::path::PathBuf;

use skysweep::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let town = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/data-samples/town"));
    let output = arguments.next().unwrap_or_else(|| std::env::temp_dir().join("skysweep_example_priors"));
    let model = arguments.next().unwrap_or_else(|| town.join("truth/buildings.city.json"));
    let mut images: Vec<PathBuf> = arguments.collect();
    if images.is_empty() {
        images.push(town.join("view_1.tif"));
    }

    let mut config = PriorsConfig::new(model, images, output);
    config.overwrite = true;
    let report = priors::run(&config, &Silent)?;
    println!("{} objects of the model could not be used", report.unusable_objects);
    println!("the maps are in {}", config.output.display());
    Ok(())
}
