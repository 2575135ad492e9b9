//! Cell centres around a wall, above or below its level.

/// Centre of a cell near four cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Columns and rows from the middle of the four cells.
    pub(super) place: [f32; 2],
    /// 1 above the level, −1 below.
    pub(super) side: f32,
    /// Weight, which falls with the distance from the middle.
    pub(super) weight: f32,
}
