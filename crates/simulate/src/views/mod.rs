//! What cameras see of a scene: geometry, light, sensors and dates.

pub(super) mod acquisition;
pub(super) mod camera_model;
pub(super) mod clouds;
pub(super) mod date;
pub(super) mod exact_view;
pub(super) mod flight;
#[cfg(test)]
pub(super) mod linear;
pub(super) mod render;
pub(super) mod seasons;
pub(super) mod sensor;
pub(super) mod sight;
pub(super) mod spectral_image;
pub(super) mod spectrum;
pub(super) mod sun;
