//! Commands on cameras and city models.

mod align;
mod city;
mod garden;
mod mesh;
mod priors;
mod priors_satellite;
mod priors_yardsticks;
mod simulate;
mod splat_labels;
mod splats;
mod split;
mod train;
