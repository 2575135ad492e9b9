//! Heights on a grid, read at the pixels of a tile.

use std::path::{Path, PathBuf};

use crs::VerticalDatum;
use formats::raster::{ImageSource, read_dem, read_dem_window};
use heightmap::{
    MapSystem, Reading, SourceMap, TileFrame, TileMap, TileRequest, confidence_from_grid, heights_from_grid,
};
use numeric::Progress;
use raster::{GeoTransform, Grid, Window};

use super::error::HeightMapJobError;
use super::source_map::{FilePlace, Laid, source_map};
use crate::camera_stand::CameraStand;

/// Most cells of a raster that is kept in memory (512 MiB). Of a larger raster, the part under each
/// tile is read.
const WHOLE_CELLS: usize = 1 << 27;
/// Side of the window that is read around a position, cells.
const AROUND: usize = 3;

/// Heights on a grid.
pub(super) struct RasterSource {
    path: PathBuf,
    map: SourceMap,
    geotransform: GeoTransform,
    /// Columns and rows.
    size: (usize, usize),
    whole: Option<Grid<f32>>,
}

impl RasterSource {
    /// Opens a raster, and reads it if it is small enough.
    pub(super) fn open(
        path: &Path,
        epsg: Option<u32>,
        vertical: Option<VerticalDatum>,
        progress: &dyn Progress,
    ) -> Result<Self, HeightMapJobError> {
        let info = ImageSource::open(path)?.info().clone();
        let small = info.width.saturating_mul(info.height) <= WHOLE_CELLS;
        let first = Window { x: 0, y: 0, width: 1, height: 1 };
        let dem = if small { read_dem(path)? } else { read_dem_window(path, first)? };
        let crs = dem.horizontal_epsg.map(|code| format!("EPSG:{code}")).or(dem.crs_wkt);
        let map = source_map(path, FilePlace { crs, vertical: dem.vertical }, epsg, vertical, progress)?;
        let whole = small.then_some(dem.heights);
        let size = (info.width, info.height);
        Ok(Self { path: path.to_owned(), map, geotransform: dem.geotransform, size, whole })
    }

    /// Reads the heights at the tile of a camera.
    pub(super) fn lay(
        &self,
        stand: &CameraStand,
        request: TileRequest,
        system: MapSystem,
        reading: Reading,
    ) -> Result<Laid, HeightMapJobError> {
        let zero_m = match stand.height_m {
            Some(height) => height,
            None => self.near(stand)?.unwrap_or(0.0),
        };
        let frame = TileFrame::new(request, zero_m, system)?;
        let heights = self.on(&frame, reading, zero_m)?;
        Ok(Laid { frame, heights, zero_m, lowest: None })
    }

    /// Checks that a tile and the raster share ground.
    ///
    /// # Errors
    /// [`HeightMapJobError::OutsideSource`].
    pub(super) fn check_meets(&self, stand: &CameraStand, frame: &TileFrame) -> Result<(), HeightMapJobError> {
        let (low, high) = TileMap::to_grid(frame, &self.map, &self.geotransform)?.extent();
        let size = [self.size.0 as f64, self.size.1 as f64];
        if (0..2).all(|i| high[i] >= -0.5 && low[i] <= size[i] - 0.5) {
            return Ok(());
        }
        let extent = |low: [f64; 2], high: [f64; 2]| {
            let corners = [(low[0], low[1]), (high[0], low[1]), (low[0], high[1]), (high[0], high[1])];
            let start = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
            corners.into_iter().fold(start, |[x0, y0, x1, y1], (column, row)| {
                let (x, y) = self.geotransform.map_from_cell(column, row);
                [x0.min(x), y0.min(y), x1.max(x), y1.max(y)]
            })
        };
        let CameraStand { lon_deg, lat_deg, .. } = *stand;
        let swapped = self.map.projection.map_from_lonlat(lat_deg, lon_deg).ok();
        let swapped = swapped.and_then(|at| self.geotransform.cell_from_map(at.x, at.y));
        Err(HeightMapJobError::OutsideSource {
            path: self.path.clone(),
            lon_deg,
            lat_deg,
            tile: extent(low, high),
            source_extent: extent([-0.5, -0.5], [size[0] - 0.5, size[1] - 0.5]),
            is_swapped: swapped.is_some_and(|(x, y)| (0.0..size[0]).contains(&x) && (0.0..size[1]).contains(&y)),
        })
    }

    /// Reads the heights above `zero_m` at the pixels of a tile.
    pub(super) fn on(&self, frame: &TileFrame, reading: Reading, zero_m: f64) -> Result<Grid<f32>, HeightMapJobError> {
        let size = frame.request().size;
        self.with_cells(frame, |cells, map| heights_from_grid(cells, map, size, reading, zero_m))
            .map(|heights| heights.unwrap_or_else(|| Grid::filled(size, size, f32::NAN)))
    }

    /// Reads the confidences at the pixels of a tile that have a height.
    pub(super) fn confidence(&self, frame: &TileFrame, heights: &Grid<f32>) -> Result<Grid<f32>, HeightMapJobError> {
        let none = || heights.map(|h| if h.is_finite() { 0.0 } else { f32::NAN });
        self.with_cells(frame, |cells, map| confidence_from_grid(cells, map, heights))
            .map(|confidence| confidence.unwrap_or_else(none))
    }

    /// Calls `work` with the cells under a tile; `None` if the raster does not reach it.
    fn with_cells<T>(
        &self,
        frame: &TileFrame,
        work: impl FnOnce(&Grid<f32>, &TileMap) -> T,
    ) -> Result<Option<T>, HeightMapJobError> {
        let map = TileMap::to_grid(frame, &self.map, &self.geotransform)?;
        if let Some(whole) = &self.whole {
            return Ok(Some(work(whole, &map)));
        }
        let (low, high) = map.extent();
        let (x, y) = ((low[0] - 3.0).floor(), (low[1] - 3.0).floor());
        let side = |i: usize| (high[i] - low[i] + 8.0).ceil() as usize;
        let window = Window { x: x as i64, y: y as i64, width: side(0), height: side(1) };
        let Some(part) = self.window(window)? else { return Ok(None) };
        let map = TileMap::to_grid(frame, &self.map, &part.1)?;
        Ok(Some(work(&part.0, &map)))
    }

    /// Reads a part of the raster with its geotransform; `None` if the raster does not reach there.
    fn window(&self, window: Window) -> Result<Option<(Grid<f32>, GeoTransform)>, HeightMapJobError> {
        match read_dem_window(&self.path, window) {
            Ok(part) => Ok(Some((part.heights, part.geotransform))),
            Err(formats::raster::RasterError::Unsupported { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Returns the height above the ellipsoid of a cell near the camera: a first estimate, to some
    /// metres.
    fn near(&self, stand: &CameraStand) -> Result<Option<f64>, HeightMapJobError> {
        let at = self.map.projection.map_from_lonlat(stand.lon_deg, stand.lat_deg)?;
        let Some((column, row)) = self.geotransform.cell_from_map(at.x, at.y) else { return Ok(None) };
        let whole = |v: f64| v.round().clamp(-1e9, 1e9) as i64;
        let window = Window { x: whole(column) - 1, y: whole(row) - 1, width: AROUND, height: AROUND };
        let cells = match &self.whole {
            Some(grid) => Some(grid.window(window, f32::NAN)),
            None => self.window(window)?.map(|(cells, _)| cells),
        };
        let Some(height) = cells.and_then(|cells| cells.data().iter().copied().find(|h| h.is_finite())) else {
            return Ok(None);
        };
        Ok(self.map.heights.ellipsoid_from_datum(stand.lon_deg, stand.lat_deg, f64::from(height)).ok())
    }
}
