//! A reference elevation model at the cells of a DSM, above the ellipsoid.

use std::path::Path;

use crs::{HeightConverter, MapProjection, VerticalDatum};
use eval::{CellMap, bilinear, convert_heights};
use formats::raster::{Dem, ImageSource, read_dem_window};
use raster::{GeoTransform, Grid, Window, reduce};
use reconstruct::DsmGrid;

use crate::error::{DsmError, DsmSetting};

/// Cells of the averaged reference that are read beyond a tile, for the average and the
/// interpolation.
const MARGIN_CELLS: usize = 4;
/// Steps along each border of a tile whose places in the reference are looked up.
const BORDER_STEPS: usize = 16;
/// Side of a tile, cells of the file.
const TILE_SIDE: f64 = 4096.0;
/// Most cells of the DSM along the side of a tile.
const TILE_SIDE_MAX: usize = 1024;
/// Most times that a reference is averaged by two. With still smaller cells a scene is terabytes.
const HALVINGS_MAX: u32 = 5;

/// The heights of a reference at the cells of a DSM.
#[derive(Debug)]
pub(crate) struct ReferenceHeights {
    /// Heights above the ellipsoid, metres; NaN where the reference has none.
    pub(crate) heights: Grid<f32>,
    /// Side of a cell of the file, metres.
    pub(crate) cell_m: f64,
    /// The datum that the file names.
    pub(crate) named: Option<VerticalDatum>,
}

/// Reads a reference at the cells of a DSM, tile by tile: the memory does not depend on the size of
/// the file or of its cells. A reference with smaller cells is averaged first.
///
/// # Errors
/// [`DsmError::Value`] for a file without CRS, without a stated datum, with cells that are far
/// smaller than those of the DSM, or beside the scene; [`DsmError::Image`], [`DsmError::Crs`].
pub(crate) fn reference_on(
    path: &Path,
    stated: Option<VerticalDatum>,
    grid: &DsmGrid,
) -> Result<ReferenceHeights, DsmError> {
    let file = ReferenceFile::open(path, grid)?;
    let side = ((TILE_SIDE * file.cell_m / grid.gsd_m) as usize).clamp(1, TILE_SIDE_MAX);
    let (mut heights, named) = file.on_grid(grid, side)?;
    let datum = stated.or(named).ok_or_else(|| {
        let found = "a file that does not say what its heights are above";
        file.unusable(found, "a file with a vertical datum, or the datum of the elevation models as a setting")
    })?;
    if datum != VerticalDatum::Ellipsoid {
        let (from, to) = (HeightConverter::new(datum)?, HeightConverter::new(VerticalDatum::Ellipsoid)?);
        convert_heights(&mut heights, &grid.geotransform, grid.gsd_m, &file.of_grid, &from, &to)?;
    }
    if heights.data().iter().all(|height| height.is_nan()) {
        return Err(file.beside());
    }
    Ok(ReferenceHeights { heights, cell_m: file.cell_m, named })
}

/// The file of a reference.
struct ReferenceFile<'a> {
    path: &'a Path,
    size: (usize, usize),
    geotransform: GeoTransform,
    /// Map of the file.
    of_file: MapProjection,
    /// Map of the DSM.
    of_grid: MapProjection,
    /// Side of a cell, metres.
    cell_m: f64,
    /// How often its cells are averaged by two.
    halvings: u32,
}

impl<'a> ReferenceFile<'a> {
    fn open(path: &'a Path, grid: &DsmGrid) -> Result<Self, DsmError> {
        let info = ImageSource::open(path)?.info().clone();
        let georeferenced = info.geotransform.zip(info.crs_wkt);
        let (geotransform, wkt) = georeferenced.ok_or_else(|| {
            unusable(
                path,
                "a file without coordinate reference system",
                "a georeferenced elevation model or surface model",
            )
        })?;
        let (of_file, of_grid) = (MapProjection::from_definition(&wkt)?, grid.projection()?);
        let size = (info.width, info.height);
        let mut file = Self { path, size, geotransform, of_file, of_grid, cell_m: 0.0, halvings: 0 };
        file.cell_m = file.cell_under(grid).ok_or_else(|| file.beside())?;
        let finer = (grid.gsd_m / file.cell_m).log2().floor().max(0.0) as u32;
        if finer > HALVINGS_MAX {
            let found = format!("a file with cells of {:.3} m", file.cell_m);
            let least_m = grid.gsd_m / f64::from(HALVINGS_MAX).exp2();
            let expected = format!(
                "a copy with cells of {least_m:.2} m or more, because the surface is compared at {:.2} m",
                grid.gsd_m
            );
            return Err(DsmError::value(DsmSetting::ReferenceDem, format!("{found}: {}", path.display()), expected));
        }
        file.halvings = finer;
        Ok(file)
    }

    fn unusable(&self, found: &str, expected: &str) -> DsmError {
        unusable(self.path, found, expected)
    }

    fn beside(&self) -> DsmError {
        self.unusable("a file without heights under the scene", "one that covers the scene")
    }

    /// Samples the file at the cells of a grid by tiles of `side` cells. Returns the datum that the
    /// file names, too.
    fn on_grid(&self, grid: &DsmGrid, side: usize) -> Result<(Grid<f32>, Option<VerticalDatum>), DsmError> {
        let mut heights = Grid::filled(grid.size.0, grid.size.1, f32::NAN);
        let mut named = None;
        for y in (0..grid.size.1).step_by(side) {
            for x in (0..grid.size.0).step_by(side) {
                let (width, height) = (side.min(grid.size.0 - x), side.min(grid.size.1 - y));
                let tile = grid.part(Window { x: x as i64, y: y as i64, width, height });
                let Some(window) = self.window(&tile) else { continue };
                let found = read_dem_window(self.path, window)?;
                named = named.or(found.vertical);
                let (file_heights, cells) = self.averaged(found, &tile)?;
                for row in 0..height {
                    for (column, at) in heights.row_mut(y + row)[x..x + width].iter_mut().enumerate() {
                        let (x, y) = cells.position(column as f64, row as f64);
                        *at = bilinear(&file_heights, x, y).map_or(f32::NAN, |height| height as f32);
                    }
                }
            }
        }
        Ok((heights, named))
    }

    /// Averages a part of the file, and returns it with the places of a tile's cells in it.
    fn averaged(&self, part: Dem, tile: &DsmGrid) -> Result<(Grid<f32>, CellMap), DsmError> {
        let Dem { mut heights, mut geotransform, .. } = part;
        for _ in 0..self.halvings {
            heights = reduce(&heights);
            let c = geotransform.0;
            geotransform = GeoTransform([c[0], 2.0 * c[1], 2.0 * c[2], c[3], 2.0 * c[4], 2.0 * c[5]]);
        }
        let project = |x, y| self.file_from_grid(x, y);
        let cells = CellMap::projected(&tile.geotransform, &geotransform, tile.size, 0, project);
        let cells = cells
            .map_err(|_| self.unusable("a file whose map does not hold the scene", "one that covers the scene"))?;
        Ok((heights, cells))
    }

    fn file_from_grid(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let (lon, lat) = self.of_grid.lonlat_from_map(x, y).ok()?;
        let point = self.of_file.map_from_lonlat(lon, lat).ok()?;
        Some((point.x, point.y))
    }

    fn cell_at(&self, grid: &DsmGrid, column: f64, row: f64) -> Option<(f64, f64)> {
        let (x, y) = grid.geotransform.map_from_cell(column, row);
        let (x, y) = self.file_from_grid(x, y)?;
        self.geotransform.cell_from_map(x, y)
    }

    /// Returns the window of the file that holds a tile, on the lattice of the averaged cells;
    /// `None` when they are apart.
    fn window(&self, tile: &DsmGrid) -> Option<Window> {
        let (width, height) = (tile.size.0 as f64, tile.size.1 as f64);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for step in 0..=BORDER_STEPS {
            let t = step as f64 / BORDER_STEPS as f64;
            for (u, v) in [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)] {
                let (x, y) = self.cell_at(tile, u * width, v * height)?;
                low = [low[0].min(x), low[1].min(y)];
                high = [high[0].max(x), high[1].max(y)];
            }
        }
        let block = 1usize << self.halvings;
        let margin = (MARGIN_CELLS * block) as f64;
        let inside = |v: f64, n: usize| v.clamp(0.0, n as f64) as usize;
        let from = |v: f64, n: usize| inside(v - margin, n) / block * block;
        let to = |v: f64, n: usize| inside((v + margin).ceil(), n).next_multiple_of(block).min(n);
        let (x, y) = (from(low[0], self.size.0), from(low[1], self.size.1));
        let (right, bottom) = (to(high[0], self.size.0), to(high[1], self.size.1));
        (right > x && bottom > y).then(|| Window { x: x as i64, y: y as i64, width: right - x, height: bottom - y })
    }

    /// Returns the longer side of a cell of the file at the middle of the grid, metres.
    fn cell_under(&self, grid: &DsmGrid) -> Option<f64> {
        let (column, row) = (0.5 * grid.size.0 as f64, 0.5 * grid.size.1 as f64);
        let at = |column, row| self.cell_at(grid, column, row);
        let (here, right, down) = (at(column, row)?, at(column + 1.0, row)?, at(column, row + 1.0)?);
        let steps = [right, down].map(|(x, y)| (x - here.0).hypot(y - here.1));
        let longest = grid.gsd_m / steps[0].min(steps[1]);
        (longest.is_finite() && longest > 0.0).then_some(longest)
    }
}

fn unusable(path: &Path, found: &str, expected: &str) -> DsmError {
    DsmError::value(DsmSetting::ReferenceDem, format!("{found}: {}", path.display()), expected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::Crs;
    use formats::raster::{Band, BandData, CogRaster, write_cog};

    /// Writes a hill in cells of `cell_m` around (500000, 4800000) of UTM 31 N.
    fn hill(path: &Path, cell_m: f64, side_m: f64) {
        let n = (side_m / cell_m) as usize;
        let value = |i: usize| {
            let at = |i: usize| (i as f64 + 0.5) * cell_m / side_m;
            (100.0 + 30.0 * at(i % n) + 20.0 * at(i / n)) as f32
        };
        let heights = Grid::from_vec(n, n, (0..n * n).map(value).collect()).unwrap();
        let bands = [Band { data: BandData::F32(&heights), description: "height_m" }];
        let place = GeoTransform([5e5, cell_m, 0.0, 4.8e6, 0.0, -cell_m]);
        write_cog(path, &CogRaster::new(&bands, place, Crs::ellipsoidal(32631)), false).unwrap();
    }

    fn grid(gsd_m: f64, side_m: f64) -> DsmGrid {
        let n = (side_m / gsd_m) as usize;
        let geotransform = GeoTransform([5e5, gsd_m, 0.0, 4.8e6, 0.0, -gsd_m]);
        DsmGrid { epsg: 32631, geotransform, size: (n, n), gsd_m }
    }

    /// Fine cells are averaged, and the tiles leave no trace.
    #[test]
    fn tiles_do_not_change_a_height() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fine.tif");
        hill(&path, 0.25, 200.0);
        let grid = grid(2.0, 200.0);
        let file = ReferenceFile::open(&path, &grid).unwrap();
        assert_eq!((file.halvings, file.cell_m), (3, 0.25));
        let (whole, named) = file.on_grid(&grid, 1000).unwrap();
        assert_eq!(named, Some(VerticalDatum::Ellipsoid));
        for side in [7, 32, 99] {
            let tiled = file.on_grid(&grid, side).unwrap().0;
            let worst = whole.data().iter().zip(tiled.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 1e-4, "{side}: {worst}");
        }
        for (column, row) in [(10, 10), (50, 90), (88, 3)] {
            let [x, y] = [column, row].map(|i| (i as f64 + 0.5) / 100.0);
            assert!((f64::from(whole[(column, row)]) - (100.0 + 30.0 * x + 20.0 * y)).abs() < 0.01);
        }
        // A window is bounded by the tile, whatever the size of the file.
        let window = file.window(&grid.part(Window { x: 40, y: 40, width: 8, height: 8 })).unwrap();
        assert!(window.width <= 8 * (8 + 2 * MARGIN_CELLS + 2), "{window:?}");
    }

    #[test]
    fn far_smaller_cells_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drone.tif");
        hill(&path, 0.02, 4.0);
        let refused = reference_on(&path, None, &grid(2.0, 4.0)).unwrap_err().to_string();
        assert!(refused.contains("cells of 0.020 m") && refused.contains("0.06 m or more"), "{refused}");
    }
}
