//! What every kind of source shares: its place on the Earth, and the heights that it gives for a
//! tile.

use std::path::Path;

use crs::{HeightConverter, VerticalDatum};
use heightmap::{SourceMap, TileFrame};
use numeric::Progress;
use raster::Grid;

use super::error::HeightMapJobError;
use job::error::FileCrsError;

/// Heights at the pixels of a tile.
pub(super) struct Laid {
    pub(super) frame: TileFrame,
    /// Heights above `zero_m`, metres; NaN where there is none.
    pub(super) heights: Grid<f32>,
    /// Zero of the heights, metres above the ellipsoid.
    pub(super) zero_m: f64,
    /// Heights of the lowest surfaces around the camera above `zero_m`, metres, where the source
    /// has several above one another.
    pub(super) lowest: Option<Grid<f32>>,
}

/// The place that a file names.
pub(super) struct FilePlace {
    /// Its coordinate reference system.
    pub(super) crs: Option<String>,
    /// The vertical datum of its heights.
    pub(super) vertical: Option<VerticalDatum>,
}

/// Returns the map projection and the vertical datum of a source. What the configuration states
/// overrides the file.
pub(super) fn source_map(
    path: &Path,
    file: FilePlace,
    epsg: Option<u32>,
    vertical: Option<VerticalDatum>,
    progress: &dyn Progress,
) -> Result<SourceMap, HeightMapJobError> {
    let definition = epsg
        .map(|code| format!("EPSG:{code}"))
        .or(file.crs)
        .ok_or_else(|| HeightMapJobError::NoCrs { path: path.to_owned() })?;
    let projection = FileCrsError::projection(path, &definition)?;
    let datum = vertical.or(file.vertical).unwrap_or_else(|| {
        progress.warn(&format!(
            "the file does not name the vertical datum of its heights, so they are taken as above the ellipsoid: {}",
            path.display()
        ));
        VerticalDatum::Ellipsoid
    });
    Ok(SourceMap { projection, heights: HeightConverter::new(datum)? })
}
