//! Jobs on a surface model, from a configuration to files and a report: the bare ground, classes,
//! changes between dates, orthophotos, height maps, views from the ground, registration of images,
//! and the errors against a reference.

pub mod buildings;
pub mod camera_stand;
pub mod city_files;
pub mod classes;
pub mod diff;
pub mod dtm;
pub mod eval;
pub mod groundview;
pub mod heightmap;
mod map_crs;
pub mod ortho;
pub mod register;
mod standing;
pub mod surface_layer;
pub mod tiles;
