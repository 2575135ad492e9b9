//! Rasters in memory: grids, geotransforms, windows, masks, polygons, pyramids, openings and
//! resampling.
//!
//! All functions use one pixel convention: the centre of the upper-left pixel is at (0, 0). GDAL's
//! corner convention (centre at 0.5, 0.5) appears in [`GeoTransform`] and in the readers only.

mod adaptive_mesh;
mod fill;
mod gaussian;
mod geotransform;
mod grid;
mod mask;
mod opening;
mod outline;
mod polygon;
mod pyramid;
mod relief;
mod resample;
mod window;

pub use adaptive_mesh::{AdaptiveMesh, TileTriangles};
pub use fill::fill_voids;
pub use gaussian::gaussian;
pub use geotransform::GeoTransform;
pub use grid::Grid;
pub use mask::{FLAG_NO_DATA, FLAG_OUTSIDE, FLAG_SATURATED, Flags, is_missing};
pub use opening::{highest, lowest, opened};
pub use outline::outlines;
pub use polygon::mark_inside;
pub use pyramid::{Pyramid, level_from_level0, level0_from_level, reduce};
pub use relief::{Light, VOID_COLOUR, coloured_relief, height_percentiles, hillshade, relief_colour, shade_picture};
pub use resample::{Interpolation, bicubic, bicubic_along, bilinear, cubic_weights, resample, sample};
pub use window::Window;

/// No-data value of every float raster that the toolkit writes, unless the user sets another.
pub const NO_DATA: f32 = -32768.0;
