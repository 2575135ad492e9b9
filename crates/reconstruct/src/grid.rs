//! The grid of a surface model.

use crs::{CrsError, MapProjection};
use raster::{GeoTransform, Window};
use serde::{Deserialize, Serialize};

use crate::error::ReconstructError;
use crate::values::{CELLS_MAX, MapBounds};

/// The grid of a DSM.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DsmGrid {
    /// EPSG code of the horizontal CRS.
    pub epsg: u32,
    /// Placement of the cells on the map.
    pub geotransform: GeoTransform,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Side of a cell on the ground, metres, whatever the unit of the CRS.
    pub gsd_m: f64,
}

impl DsmGrid {
    /// Makes the grid of cells of `gsd_m` metres that holds the bounds, which are on the map with
    /// this EPSG code.
    ///
    /// # Errors
    /// [`ReconstructError::Crs`] for a CRS that PROJ does not know, [`ReconstructError::Cells`] as
    /// [`snapped`].
    pub fn over(bounds: MapBounds, epsg: u32, gsd_m: f64) -> Result<Self, ReconstructError> {
        let projection = MapProjection::from_epsg(epsg)?;
        let (x, y) = bounds.middle();
        let (_, lat_deg) = projection.lonlat_from_map(x, y)?;
        let (geotransform, size) = snapped(bounds, cell_size(&projection, gsd_m, lat_deg))?;
        Ok(Self { epsg, geotransform, size, gsd_m })
    }

    /// Returns the window of all cells.
    pub const fn whole(&self) -> Window {
        Window::whole(self.size.0, self.size.1)
    }

    /// Returns the grid of a window of cells.
    #[must_use]
    pub fn part(&self, cells: Window) -> Self {
        Self {
            epsg: self.epsg,
            geotransform: self.geotransform.shifted(cells.x as f64, cells.y as f64),
            size: (cells.width, cells.height),
            gsd_m: self.gsd_m,
        }
    }

    /// Returns the rectangle that the cells cover.
    pub fn bounds(&self) -> MapBounds {
        let (x_min, y_max) = self.geotransform.map_from_cell(-0.5, -0.5);
        let (x_max, y_min) = self.geotransform.map_from_cell(self.size.0 as f64 - 0.5, self.size.1 as f64 - 0.5);
        MapBounds { x_min, y_min, x_max, y_max }
    }

    /// Makes the projection of the CRS.
    ///
    /// # Errors
    /// [`CrsError::NoTransformation`] for a CRS that PROJ does not know.
    pub fn projection(&self) -> Result<MapProjection, CrsError> {
        MapProjection::from_epsg(self.epsg)
    }
}

/// Returns the width and height of a cell of `gsd_m` in units of the CRS. A cell in degrees is
/// square on the ground at this latitude and has whole 1e-8 degrees, about a millimetre.
pub fn cell_size(projection: &MapProjection, gsd_m: f64, lat_deg: f64) -> (f64, f64) {
    let (across_m, along_m) = projection.metres_per_unit_at(lat_deg);
    let cell = (gsd_m / across_m, gsd_m / along_m);
    if projection.metres_per_unit().is_some() {
        return cell;
    }
    let whole = |degrees: f64| (degrees * 1e8).round().max(1.0) / 1e8;
    (whole(cell.0), whole(cell.1))
}

/// Returns a north-up grid on whole multiples of the cell's width and height that holds the bounds:
/// its geotransform, columns and rows.
///
/// # Errors
/// [`ReconstructError::Cells`] for no cells, and for more than a surface can have.
pub fn snapped(b: MapBounds, (width, height): (f64, f64)) -> Result<(GeoTransform, (usize, usize)), ReconstructError> {
    // Slightly inside, so that bounds on the lattice do not gain a cell by rounding.
    let down = |v: f64, side: f64| ((v + 1e-6 * side) / side).floor() * side;
    let up = |v: f64, side: f64| ((v / side) - 1e-6).ceil() * side;
    let (x0, y1) = (down(b.x_min, width), up(b.y_max, height));
    let columns = ((up(b.x_max, width) - x0) / width).round();
    let rows = ((y1 - down(b.y_min, height)) / height).round();
    if !(width > 0.0 && height > 0.0 && columns >= 1.0 && rows >= 1.0 && columns * rows <= CELLS_MAX) {
        return Err(ReconstructError::Cells { columns, rows, cell: (width, height) });
    }
    Ok((GeoTransform([x0, width, 0.0, y1, 0.0, -height]), (columns as usize, rows as usize)))
}
