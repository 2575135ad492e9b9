//! How images are laid on a surface.

use ortho::MosaicRule;

/// Height by which a surface must stand above a line of sight to hide what is behind it, metres:
/// the errors of f32 heights and of the line of sight are far below it.
pub(super) const TOLERANCE_M: f64 = 0.05;

/// How images are laid on a surface; the fields are those of the configuration of an ortho.
#[derive(Debug, Clone, Copy)]
pub(super) struct Laying {
    pub(super) tolerance_m: f64,
    pub(super) balance: bool,
    pub(super) mosaic: MosaicRule,
    pub(super) keep_hidden: bool,
}
