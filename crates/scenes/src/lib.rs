//! Jobs on cameras and city models, from a configuration to files and a report: building priors,
//! splats and their training, meshes, alignment and splits of COLMAP models, conversions of city
//! models and RPC files, and simulated scenes.

pub mod align;
pub mod city;
pub mod mesh;
pub mod priors;
pub mod rpc;
pub mod simulate;
mod simulate_page;
mod small_view;
pub mod splats;
pub mod split;
pub mod train;
