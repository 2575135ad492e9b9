//! Results for people and programs: pictures, plots, pages and JSON.
//!
//! An [`EvaluationReport`] presents one evaluation in three forms, each with its protocol: text for
//! the terminal, JSON, and one HTML file that needs no network, no script and no other file.
//! [`Chart`] draws plots as SVG, inside a page or as files of their own. A [`PriorsReport`]
//! presents the priors of a city model, a [`SatellitePriorsReport`] those of satellite images.
//! [`depth_preview`], [`height_preview`] and [`normal_preview`] are their pictures. A [`BatchPage`]
//! lists what became of a batch. A [`JobPage`] shows the maps of a job as layers, and a [`Legend`]
//! the meaning of their colours, also as a style of QGIS.
//!
//! A [`MapStyle`] draws a raster for the viewer, with its legend.
//!
//! This crate touches no file. Everything is returned as text or bytes, the same for the same
//! input.

mod base64;
mod batch;
mod class;
mod comparison;
mod escape;
mod evaluation;
mod job;
mod legend;
mod links;
mod map_style;
mod page;
mod palette;
mod parts;
mod picture;
mod preview;
mod priors;
mod protocol;
mod satellite;
mod svg;
mod words;

pub use batch::{BatchAccuracy, BatchPage, BatchRow, BatchSceneRow};
pub use class::class_title;
pub use comparison::Comparison;
pub use escape::escape;
pub use evaluation::EvaluationReport;
pub use job::{JobPage, JobTable, MapLayer};
pub use legend::{Legend, LightEnd};
pub use links::{PageLink, with_links};
pub use map_style::{MapClass, MapLegend, MapStyle, RampColours};
pub use palette::{MISSING, OUTSIDE, diverging};
pub use parts::ViewPictures;
pub use picture::{PictureError, error_picture, png, png_with_alpha};
pub use preview::{depth_preview, height_preview, mask_preview, normal_preview, number_label, side_by_side};
pub use priors::{ErrorRow, PriorsReport, ViewRow};
pub use protocol::Protocol;
pub use satellite::{SatellitePriorsReport, SatelliteRow};
pub use svg::{Axis, Chart, PointResidual, residual_map};
pub use words::{counted, grouped, plain_number, sensible};
