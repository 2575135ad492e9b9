//! City models in files: CityJSON, CityJSONSeq, CityGML, OBJ and PLY.
//!
//! [`read`] recognises the format by the content and returns a [`CityModel`](city::CityModel). A
//! surface that cannot be used is left out and listed among the [`Defect`](city::Defect)s. A file
//! that breaks its format is refused with a number of the catalogue and a place ([`CityFault`]).
//! Coordinates stay in the reference system of the file. A file that is named inside another file
//! is never opened.

mod builder;
mod citygml;
mod cityjson;
mod crs_name;
mod error;
mod export;
mod format;
mod images;
mod obj;
mod palette;
mod placement;
mod ply;
mod read;
pub mod surfaces;

pub use cityjson::{CityJsonOptions, write_cityjson};
pub use error::{CityError, CityFault};
pub use export::{Footprints, MeshFormat, write_footprints, write_mesh};
pub use format::CityFormat;
pub use images::move_images;
pub use read::{CityFile, SIZE_LIMIT, read};

pub(crate) use ply::points as ply_points;
pub(crate) use read::content;
