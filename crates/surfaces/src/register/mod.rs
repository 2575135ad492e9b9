//! The register job: the pointing of a new image is corrected against an existing model.
//!
//! The model is a surface with images whose pointing is known, or splats. Near the points of a
//! lattice over the model, where its pictures show most clear texture, the new image is laid on the
//! surface and compared with them. Cells that are hidden from one image, that were filled, or that
//! are hardly ever right are masked in the comparison. Denser lattices follow until enough points
//! share a shift. Those are ground points with known places in the new image, from which one
//! correction in image space follows by iteratively reweighted least squares. A drift or an affine
//! map is taken where it predicts held-out points better, beyond what chips that overlap share. The
//! image is laid and matched again under the correction until it settles, because relief moves the
//! pixels of an image that is laid with a wrong pointing.
//!
//! The report is read wherever corrections are read: `images` holds the new image, and those of
//! the model with the corrections that they have, also where these change nothing.

mod config;
mod error;
mod evidence;
mod frames;
mod matching;
mod model;
mod page;
mod report;
mod run;
mod spots;
mod vote;

pub use config::{RegisterConfig, RegisterModel, RegisterOrder};
pub use report::{RegisterReport, RegisteredImage};
pub use run::run;
