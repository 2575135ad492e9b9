//! The place of the scene in the world: ground control, check points and reference elevation
//! models.

pub(super) mod chips;
pub(super) mod control;
pub(super) mod control_doubt;
pub(super) mod plane_fit;
pub(super) mod reference_dem;
pub(super) mod register;
