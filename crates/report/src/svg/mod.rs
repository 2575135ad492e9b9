//! Plots as SVG: two axes, and marks between them.
//!
//! Inside a page the marks take their colours from the page's style (classes `bar`, `line`, `dot`,
//! …). In a file of their own ([`Chart::sheet`]) plots carry their style, for light and dark
//! surroundings. Sizes are in user units of a 560 × 320 picture.

mod axis;
mod chart;
mod residuals;

pub use axis::Axis;
pub use chart::Chart;
pub(crate) use chart::STYLE;
pub use residuals::{PointResidual, residual_map};
