//! The surface of swept views: consistency, fusion on a grid, clean-up, and what its shadows tell.

pub(super) mod clean_up;
pub(super) mod fill;
mod grid_sight;
pub(super) mod ground_mask;
mod hidden;
pub(super) mod make;
mod overreach;
pub(super) mod rasters;
pub(super) mod shadow_side;
