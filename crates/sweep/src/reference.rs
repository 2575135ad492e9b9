//! The view whose heights are computed, on the level being swept.

use crate::prior::Prior;
use crate::ranges::Ranges;
use crate::view::ViewLevel;

/// View whose heights are computed, on the level being swept.
#[derive(Debug, Clone, Copy)]
pub struct Reference<'a> {
    /// Image and camera.
    pub view: ViewLevel<'a>,
    /// Level of the pyramid; 0 is the full resolution.
    pub level: u32,
    /// Hypotheses of its pixels.
    pub ranges: &'a Ranges,
    /// Heights known beforehand, if any.
    pub prior: Option<Prior<'a>>,
}
