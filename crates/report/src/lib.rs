//! Results for people and programs: pictures, plots, pages and JSON.
//!
//! An [`EvaluationReport`] tells one evaluation three times, always with its protocol: as text for the terminal, as JSON, and as
//! one HTML file that needs no network, no script and no other file. [`Chart`] draws plots as SVG, inside a page or on their own.
//! A [`PriorsReport`] does the same for the priors of a city model, a [`SatellitePriorsReport`] for those of satellite images; [`depth_preview`] and [`normal_preview`] are its pictures.
//! Nothing here touches a file: everything comes back as text or bytes, the same for the same input.

mod base64;
mod class;
mod evaluation;
mod page;
mod palette;
mod parts;
mod picture;
mod preview;
mod priors;
mod protocol;
mod satellite;
mod svg;

pub use class::class_title;
pub use evaluation::EvaluationReport;
pub use page::escape;
pub use palette::{MISSING, OUTSIDE, diverging};
pub use parts::ViewPictures;
pub use picture::{PictureError, error_picture, png};
pub use preview::{depth_preview, mask_preview, normal_preview, side_by_side};
pub use priors::{ErrorRow, PriorsReport, ViewRow};
pub use protocol::Protocol;
pub use satellite::{SatellitePriorsReport, SatelliteRow};
pub use svg::{Axis, Chart};
