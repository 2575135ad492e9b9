//! The view whose heights are sought, on the level being swept.

use crate::prior::Prior;
use crate::ranges::Ranges;
use crate::view::ViewLevel;

/// The reference on the level being swept.
#[derive(Debug, Clone, Copy)]
pub struct Reference<'a> {
    /// Its image and camera.
    pub view: ViewLevel<'a>,
    /// The level of its pyramid.
    pub level: u32,
    /// The hypotheses of its pixels.
    pub ranges: &'a Ranges,
    /// What is known of its heights beforehand.
    pub prior: Option<Prior<'a>>,
}
