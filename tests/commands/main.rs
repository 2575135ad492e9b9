//! Commands from files to exit code: those on surface models, those on cameras and city models, RPC
//! files, and what every command does.

#[path = "../common/mod.rs"]
mod common;
mod every;
mod rpc;
mod scenes;
mod surfaces;
