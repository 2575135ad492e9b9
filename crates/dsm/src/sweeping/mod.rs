//! The surface of a scene or chunk: swept, fused and cleaned.

pub(super) mod clean_up;
pub(super) mod grid_sight;
pub(super) mod ground_mask;
pub(super) mod ground_polygons;
pub(super) mod scene_sweep;
pub(super) mod shadow_side;
pub(super) mod surface;
pub(super) mod view_heights;
