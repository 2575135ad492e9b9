//! Ground without heights: masks, and the polygons of an area.

pub(super) mod ground_mask;
pub(super) mod ground_polygons;
