//! A reference elevation model at the cells of a DSM, above the ellipsoid.

use std::path::Path;

use crs::{HeightConverter, MapProjection, VerticalDatum};
use eval::{CellMap, bilinear, convert_heights};
use io::raster::{Dem, ImageSource, read_dem_window};
use raster::{GeoTransform, Grid, Window, reduce};

use crate::dsm::error::{DsmError, DsmSetting};
use crate::dsm::grid::DsmGrid;

/// Cells of the reference that are read beyond the DSM, for the interpolation and the search.
const MARGIN_CELLS: f64 = 8.0;
/// Steps along each border of the DSM whose places in the reference are looked up.
const BORDER_STEPS: usize = 16;

/// The heights of a reference at the cells of a DSM.
#[derive(Debug)]
pub(crate) struct ReferenceHeights {
    /// Heights above the ellipsoid, metres; NaN where the reference has none.
    pub(crate) heights: Grid<f32>,
    /// Side of a cell of the file, metres.
    pub(crate) cell_m: f64,
}

/// Reads a reference at the cells of a DSM. A reference with smaller cells is averaged first.
///
/// # Errors
/// [`DsmError::Value`] for a file without CRS, without a stated datum, or beside the scene;
/// [`DsmError::Image`], [`DsmError::Crs`].
pub(crate) fn reference_on(
    path: &Path,
    stated: Option<VerticalDatum>,
    grid: &DsmGrid,
) -> Result<ReferenceHeights, DsmError> {
    let info = ImageSource::open(path)?.info().clone();
    let unusable = |found: &str, expected: &str| {
        DsmError::value(DsmSetting::ReferenceDem, format!("{found}: {}", path.display()), expected)
    };
    let georeferenced = info.geotransform.zip(info.crs_wkt);
    let (geotransform, wkt) = georeferenced.ok_or_else(|| {
        unusable("a file without coordinate reference system", "a georeferenced elevation model or surface model")
    })?;
    let projections = Projections { of_grid: grid.projection()?, of_file: MapProjection::from_definition(&wkt)? };
    let beside = || unusable("a file without heights under the scene", "one that covers the scene");
    let window = projections.window(grid, &geotransform, (info.width, info.height)).ok_or_else(beside)?;
    let Dem { mut heights, mut geotransform, vertical, .. } = read_dem_window(path, window)?;
    let datum = stated.or(vertical).ok_or_else(|| {
        let found = "a file that does not say what its heights are above";
        unusable(found, "a file with a vertical datum, or the datum of the elevation models as a setting")
    })?;
    let cell_m = projections.cell_m(grid, &geotransform).ok_or_else(beside)?;
    let mut averaged_m = cell_m;
    while 2.0 * averaged_m <= grid.gsd_m {
        heights = reduce(&heights);
        let c = geotransform.0;
        geotransform = GeoTransform([c[0], 2.0 * c[1], 2.0 * c[2], c[3], 2.0 * c[4], 2.0 * c[5]]);
        averaged_m *= 2.0;
    }
    let project = |x, y| projections.file_from_grid(x, y);
    let cells = CellMap::projected(&grid.geotransform, &geotransform, grid.size, 0, project)
        .map_err(|_| unusable("a file whose map does not hold the scene", "one that covers the scene"))?;
    let mut on_grid = Grid::filled(grid.size.0, grid.size.1, f32::NAN);
    for row in 0..grid.size.1 {
        for (column, height) in on_grid.row_mut(row).iter_mut().enumerate() {
            let (x, y) = cells.position(column as f64, row as f64);
            *height = bilinear(&heights, x, y).map_or(f32::NAN, |height| height as f32);
        }
    }
    if datum != VerticalDatum::Ellipsoid {
        let (from, to) = (HeightConverter::new(datum)?, HeightConverter::new(VerticalDatum::Ellipsoid)?);
        convert_heights(&mut on_grid, &grid.geotransform, grid.gsd_m, &projections.of_grid, &from, &to)?;
    }
    if on_grid.data().iter().all(|height| height.is_nan()) {
        return Err(beside());
    }
    Ok(ReferenceHeights { heights: on_grid, cell_m })
}

/// The maps of the DSM and of the file.
struct Projections {
    of_grid: MapProjection,
    of_file: MapProjection,
}

impl Projections {
    fn file_from_grid(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let (lon, lat) = self.of_grid.lonlat_from_map(x, y).ok()?;
        let point = self.of_file.map_from_lonlat(lon, lat).ok()?;
        Some((point.x, point.y))
    }

    fn cell_at(&self, grid: &DsmGrid, file: &GeoTransform, column: f64, row: f64) -> Option<(f64, f64)> {
        let (x, y) = grid.geotransform.map_from_cell(column, row);
        let (x, y) = self.file_from_grid(x, y)?;
        file.cell_from_map(x, y)
    }

    /// Returns the window of the file that holds the grid; `None` when they are apart.
    fn window(&self, grid: &DsmGrid, file: &GeoTransform, size: (usize, usize)) -> Option<Window> {
        let (width, height) = (grid.size.0 as f64, grid.size.1 as f64);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for step in 0..=BORDER_STEPS {
            let t = step as f64 / BORDER_STEPS as f64;
            for (u, v) in [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)] {
                let (x, y) = self.cell_at(grid, file, u * width, v * height)?;
                low = [low[0].min(x), low[1].min(y)];
                high = [high[0].max(x), high[1].max(y)];
            }
        }
        let from = |v: f64, n: usize| (v - MARGIN_CELLS).clamp(0.0, n as f64) as usize;
        let to = |v: f64, n: usize| (v + MARGIN_CELLS).ceil().clamp(0.0, n as f64) as usize;
        let (x, y) = (from(low[0], size.0), from(low[1], size.1));
        let (right, bottom) = (to(high[0], size.0), to(high[1], size.1));
        (right > x && bottom > y).then(|| Window { x: x as i64, y: y as i64, width: right - x, height: bottom - y })
    }

    /// Returns the longer side of a cell of the file at the middle of the grid, metres.
    fn cell_m(&self, grid: &DsmGrid, file: &GeoTransform) -> Option<f64> {
        let (column, row) = (0.5 * grid.size.0 as f64, 0.5 * grid.size.1 as f64);
        let at = |column, row| self.cell_at(grid, file, column, row);
        let (here, right, down) = (at(column, row)?, at(column + 1.0, row)?, at(column, row + 1.0)?);
        let steps = [right, down].map(|(x, y)| (x - here.0).hypot(y - here.1));
        let longest = grid.gsd_m / steps[0].min(steps[1]);
        (longest.is_finite() && longest > 0.0).then_some(longest)
    }
}
