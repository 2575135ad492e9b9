//! Coordinate reference systems: their identity, map projections and vertical datums.
//!
//! Angles are degrees, and heights are metres above the WGS 84 ellipsoid unless a name says
//! otherwise. No other crate uses PROJ, and two private modules call its C interface. PROJ's
//! network access is switched off: a grid is read from the local disk, fetched where a program lets
//! it be ([`get_missing_grids_from`]), or reported as missing.

mod area;
mod error;
mod grids;
mod identity;
mod proj_handle;
mod projection;
mod vertical;

pub use area::AreaOfUse;
pub use error::CrsError;
pub use grids::{GridSource, get_missing_grids_from};
pub use identity::{Crs, CrsIdentity, CrsRequest, VerticalDatum, compound_epsg, compound_wkt, horizontal_wkt};
pub use projection::MapProjection;
pub use vertical::HeightConverter;
