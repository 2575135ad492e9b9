//! What a run is made from: images, their RPCs, masks and pixels.

pub(super) mod doubts;
pub(super) mod image_mask;
pub(super) mod image_pixels;
pub(super) mod image_windows;
pub(super) mod input_stamps;
pub(super) mod open;
pub(super) mod order;
pub(super) mod radiometry;
pub(super) mod scene_image;
