//! `skysweep dsm`, `plan`, `run` and `merge` from files to exit code.

mod blocks;
mod bounded;
mod chunks;
mod command;
#[path = "../common/mod.rs"]
mod common;
mod crs;
mod prior;
mod production;
mod reference;
mod stac_input;
