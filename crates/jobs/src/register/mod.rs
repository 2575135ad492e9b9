//! The register job: the pointing of a new image is corrected against an existing model.
//!
//! The model is a surface with images whose pointing is known, or splats. Around points on a
//! lattice over the model, the new image is laid on the surface and compared with the model's own
//! picture there. Matched points are ground points with known places in the new image, from which
//! one correction in image space follows by iteratively reweighted least squares. The image is
//! laid and matched again under the correction until it settles, because relief moves the pixels
//! of an image that is laid with a wrong pointing.
//!
//! The report is read wherever corrections are read: `images` holds the new image, and those of
//! the model with the corrections that they have.

mod config;
mod error;
mod matching;
mod model;
mod page;
mod report;
mod run;

pub use config::{RegisterConfig, RegisterModel};
pub use error::RegisterError;
pub use report::{RegisterReport, RegisteredImage};
pub use run::run;
