//! Tie points, the correction of the cameras, and what both tell about the images.

pub(super) mod evidence;
pub(super) mod image_checks;
pub(super) mod match_images;
pub(super) mod other_fits;
pub(super) mod pair_heights;
pub(super) mod partners;
pub(super) mod point;
pub(super) mod same_picture;
pub(super) mod shared_heights;
pub(super) mod tie_quality;
pub(super) mod tie_windows;
pub(super) mod ties;
