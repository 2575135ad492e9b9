//! The height map jobs: the surface seen from above around a camera, turned to its heading, as a
//! GeoTIFF; and the way back to points or splats.
//!
//! [`run`] makes one map, or one per row of a list. A map of a list that cannot be made does not
//! stop the others: the report names it. [`unproject`] turns a map into points or Gaussian splats.

mod config;
mod error;
mod list;
mod maker;
mod raster_source;
mod report;
mod run;
mod settings;
mod source;
mod source_map;
mod tags;
mod tile_maker;
mod unproject;
mod unproject_config;
mod vector_source;

pub use config::{ConfidenceSource, HeightMapConfig, MapChoice, Normalization};
pub(crate) use error::HeightMapJobError;
pub use report::{HeightMapFate, HeightMapList, HeightMapMade, HeightMapRecord, HeightMapReport};
pub use run::run;
pub use tags::HeightMapTags;
pub use unproject::unproject;
pub use unproject_config::{PointAxes, UnprojectConfig, UnprojectReport};

pub(crate) use tile_maker::TileMaker;
