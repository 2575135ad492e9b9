//! Directions towards a sensor at the cells of a map grid.
//!
//! The line of sight through an image position is localised at two heights. Its motion between
//! them, in cells per metre of height, changes slowly over an image. It is computed at the
//! nodes of a lattice over the grid and interpolated bilinearly: directions of satellite images
//! change by less than a degree over 10 km.

use camera::{CameraError, RpcCamera};
use crs::{CrsError, MapProjection};
use geodesy::LonLatHeight;
use raster::{GeoTransform, Grid};

/// Meshes of the lattice along each side.
const MESHES: usize = 8;
/// Difference of the two heights, metres.
const RISE_M: f64 = 100.0;

/// Directions towards the sensor of one image over a grid.
#[derive(Debug, Clone)]
pub struct Eyeline {
    step: [f64; 2],
    /// Columns and rows per metre of height.
    nodes: Grid<[f64; 2]>,
    cell_m: [f64; 2],
}

/// A direction that cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub struct EyelineError(#[from] Reason);

/// Why a direction cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum Reason {
    /// The RPC fails at the grid.
    #[error("the camera model fails over the surface model: {0}")]
    Camera(#[from] CameraError),
    /// The map fails.
    #[error(transparent)]
    Geodesy(#[from] CrsError),
    /// A geotransform without area.
    #[error("the cells of the surface model have no area")]
    Singular,
}

impl From<CameraError> for EyelineError {
    fn from(error: CameraError) -> Self {
        Reason::from(error).into()
    }
}

impl From<CrsError> for EyelineError {
    fn from(error: CrsError) -> Self {
        Reason::from(error).into()
    }
}

impl Eyeline {
    /// Computes the directions over a grid of (columns, rows) `size` at `height_m` above the
    /// ellipsoid.
    ///
    /// # Errors
    /// [`EyelineError`] if the camera does not see the grid or the projection does not hold it.
    pub fn new(
        camera: &RpcCamera,
        projection: &MapProjection,
        geotransform: &GeoTransform,
        size: (usize, usize),
        height_m: f64,
    ) -> Result<Self, EyelineError> {
        let step = [size.0, size.1].map(|cells| (cells.max(2) - 1) as f64 / MESHES as f64);
        let mut nodes = Grid::filled(MESHES + 1, MESHES + 1, [0.0; 2]);
        for j in 0..=MESHES {
            for i in 0..=MESHES {
                let (column, row) = (i as f64 * step[0], j as f64 * step[1]);
                let (x, y) = geotransform.map_from_cell(column, row);
                let (lon, lat) = projection.lonlat_from_map(x, y)?;
                let image = camera.project(LonLatHeight::new(lon, lat, height_m))?;
                let above = camera.localize(image, height_m + RISE_M)?;
                let at = projection.map_from_lonlat(above.lon_deg, above.lat_deg)?;
                let (c, r) = geotransform.cell_from_map(at.x, at.y).ok_or(Reason::Singular)?;
                nodes[(i, j)] = [(c - column) / RISE_M, (r - row) / RISE_M];
            }
        }
        let (_, middle) = geotransform.map_from_cell(0.5 * size.0 as f64, 0.5 * size.1 as f64);
        let (along_columns_m, along_rows_m) = geotransform.cell_size_m(projection.metres_per_unit_at(middle));
        Ok(Self { step, nodes, cell_m: [along_columns_m, along_rows_m] })
    }

    /// Returns the motion of the line of sight towards the sensor, columns and rows per metre of
    /// height.
    #[inline]
    pub fn per_metre(&self, column: f64, row: f64) -> [f64; 2] {
        let along = |value: f64, step: f64| {
            let u = (value / step).clamp(0.0, MESHES as f64);
            let first = (u as usize).min(MESHES - 1);
            (first, u - first as f64)
        };
        let ((i, s), (j, t)) = (along(column, self.step[0]), along(row, self.step[1]));
        let node = |i: usize, j: usize| self.nodes[(i, j)];
        [0, 1].map(|k| {
            let upper = node(i, j)[k] + s * (node(i + 1, j)[k] - node(i, j)[k]);
            let lower = node(i, j + 1)[k] + s * (node(i + 1, j + 1)[k] - node(i, j + 1)[k]);
            upper + t * (lower - upper)
        })
    }

    /// Angle of the line of sight to the vertical, degrees.
    #[inline]
    pub fn incidence_deg(&self, column: f64, row: f64) -> f64 {
        let [c, r] = self.per_metre(column, row);
        (c * self.cell_m[0]).hypot(r * self.cell_m[1]).atan().to_degrees()
    }
}
