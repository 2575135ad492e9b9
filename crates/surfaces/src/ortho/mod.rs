//! The ortho job: images laid on a surface model so that every cell shows its own ground point.
//!
//! Two files are written. `OUT.tif` holds the bands of the images. `OUT_mask.tif` holds the state
//! of each cell in band 1 (0 seen, 1 hidden in every image that reaches it, 2 outside of the
//! images, 255 without a height) and the number of the image that the cell comes from in band 2
//! (from 1; 0 is none).
//!
//! Of several images, each cell takes the image that sees it most steeply. Before that, the grey
//! values of the images are brought together by a gain and an offset per image and band.

mod config;
mod error;
mod inputs;
mod laying;
mod mosaic;
mod output;
mod run;
mod states;
mod view;

pub use config::OrthoConfig;
pub(crate) use error::OrthoError;
pub use output::{OrthoPart, OrthoReport};
pub use run::run;
pub use states::OrthoCounts;

pub(crate) use inputs::{OrthoImage, OrthoSurface};
pub(crate) use run::{lay, run_in_window};
pub(crate) use view::{Cell, look, window_of};
