//! How views see a scene: footprints, angles, sources, height step and pyramid levels.

pub(super) mod footprints;
pub(super) mod levels;
pub(super) mod places;
pub(super) mod sources;
pub(super) mod view_geometry;
