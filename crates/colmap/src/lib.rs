//! Sets of posed cameras, as COLMAP models hold them: their alignment to the world and their
//! splits.
//!
//! - [`align`] finds the similarity that brings a model to surveyed positions (GPS), robustly.
//! - [`split`] chooses context and target views by the points that they share.

pub mod align;
pub mod split;
