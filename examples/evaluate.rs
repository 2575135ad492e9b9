//! Measures the errors of a surface model against a reference.
//!
//! `cargo run --release --example evaluate [DSM REFERENCE]`

#![allow(clippy::print_stdout, reason = "an example shows its results on the terminal")]

use std::error::Error;
use std::path::PathBuf;

use skysweep::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let truth = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/data-samples/town/truth"));
    // Without arguments the terrain stands in for a bad surface model: it lacks buildings and
    // trees.
    let dsm = arguments.next().unwrap_or_else(|| truth.join("dtm.tif"));
    let reference = arguments.next().unwrap_or_else(|| truth.join("dsm.tif"));

    let report = compare_grids(&GridEvalConfig::new(dsm, reference), &Silent)?;
    let errors = report.evaluation.overall.errors.as_ref().ok_or("no cell could be compared")?;
    println!("MAE {:.2} m, RMSE {:.2} m, NMAD {:.2} m", errors.mae, errors.rmse, errors.nmad);
    Ok(())
}
