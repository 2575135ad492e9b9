//! States of the cells of an ortho, as the mask holds them, and counts of cells.

/// The cell shows its own ground point.
pub(super) const SEEN: u8 = 0;
/// Something hides the cell in every image that reaches it.
pub(super) const HIDDEN: u8 = 1;
/// No image reaches the cell.
pub(super) const OUTSIDE: u8 = 2;
/// The surface model has no height there.
pub(super) const VOID: u8 = 255;

/// Counts of the cells of an ortho, for one image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct OrthoCounts {
    /// Cells that the image sees.
    pub seen: usize,
    /// Cells that are hidden in the image.
    pub hidden: usize,
    /// Cells whose values come from the image.
    pub used: usize,
}
