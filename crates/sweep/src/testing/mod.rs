//! Cameras, views and numbers for tests.

pub(crate) mod camera;
pub(crate) mod plane;
pub(crate) mod random;
