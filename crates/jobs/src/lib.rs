//! Every job of the toolkit as a function from a configuration to a report.

pub mod dsm;
mod error;
pub mod files;
pub mod rpc;
