//! Makes a surface model from two satellite images with RPCs.
//!
//! `cargo run --release --example dsm_from_two_images [OUTPUT [IMAGE IMAGE…]]`

#![allow(clippy::print_stdout, reason = "an example shows its results on the terminal")]

use std::error::Error;
use std::path::PathBuf;

use skysweep::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let output = arguments.next().unwrap_or_else(|| std::env::temp_dir().join("skysweep_example_dsm"));
    let mut images: Vec<PathBuf> = arguments.collect();
    if images.is_empty() {
        let town = concat!(env!("CARGO_MANIFEST_DIR"), "/data-samples/town");
        images = ["view_1.tif", "view_3.tif"].map(|name| PathBuf::from(town).join(name)).into();
    }

    let mut config = DsmConfig::new(images, output);
    config.preset = Preset::Fast;
    config.overwrite = true;
    let report = dsm::run(&config, &Silent)?;

    for choice in &report.choices {
        println!("{}: {} ({})", choice.name, choice.value, choice.reason);
    }
    println!("{} cells observed, in {}", report.surface.counts.observed, config.output.join("dsm/dsm.tif").display());
    Ok(())
}
