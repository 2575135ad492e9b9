//! The splat jobs: Gaussian splats of a surface model and its images, and views of splats through
//! cameras.
//!
//! [`make()`] writes the PLY that 3DGS viewers and trainers read, with its origin beside it.
//! [`render()`] looks at such a file through satellite images and perspective cameras.
//! [`convert()`] brings it to another format, and [`label()`] carries class and object of a city
//! model onto its splats.

mod convert;
mod error;
mod image;
mod label;
mod make;
mod render;
mod text;

pub(crate) use make::pointing_path;

pub use convert::{SplatConvertConfig, SplatConvertReport, convert};
pub use label::{SplatLabelConfig, SplatLabelReport, label};
pub use make::{SplatsConfig, SplatsImageReport, SplatsReport, make};
pub use render::{SplatRenderConfig, SplatRenderReport, SplatRenderView, render};
