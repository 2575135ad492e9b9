//! The tiles of a mesh: a quadtree of GLB files under a tileset of 3D Tiles 1.1.

use std::path::Path;

use crs::{HeightConverter, VerticalDatum};
use formats::textured_mesh::{MeshTile, TexturedMesh, write_textured_glb, write_tileset};
use geodesy::{EnuFrame, EnuPoint, LonLatHeight, ecef_from_ground};
use numeric::Progress;
use raster::{AdaptiveMesh, GeoTransform, Grid, TileTriangles};
use rayon::prelude::*;
use serde_json::json;

use super::error::ProductsError;
use super::mesh_level::{MeshLevel, TILE};
use super::scene::SurfaceOfRun;
use job::files::{FileError, create_folder};

/// Names of the folder of the tiles and of their list.
pub(super) const TILES: &str = "tiles";
pub(super) const TILESET: &str = "tileset.json";
/// Error of a level in its cells. Viewers replace a tile by its children when its error covers more
/// than 16 pixels; a cell of its picture then covers two.
const CELLS_OF_ERROR: f64 = 8.0;

/// Whether an entry of the folder of the tiles is ours: the folder of a level or a tile in it.
pub(super) fn is_tile(name: &str) -> bool {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let Some((_, file)) = name.split_once('/').filter(|(level, _)| is_number(level)) else { return false };
    let place = file.strip_suffix(".glb").and_then(|place| place.split_once('_'));
    file.is_empty() || place.is_some_and(|(column, row)| is_number(column) && is_number(row))
}

/// Counts of a tileset.
pub(super) struct TilesMade {
    pub(super) levels: usize,
    pub(super) tiles: usize,
    pub(super) triangles: usize,
}

/// The frame of the tiles and the way to it from the map.
struct TileFrame<'a> {
    surface: &'a SurfaceOfRun,
    frame: EnuFrame,
    to_ellipsoid: Option<HeightConverter>,
}

/// A tile with its place in its level.
struct PlacedTile {
    column: usize,
    row: usize,
    triangles: usize,
    tile: MeshTile,
}

/// Writes the tiles of a surface into a folder, with the tileset beside them.
pub(super) fn make(
    surface: &SurfaceOfRun,
    finest: MeshLevel,
    tolerance_m: f64,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<TilesMade, ProductsError> {
    let frame = TileFrame::new(surface, &finest.heights)?;
    let cells = finest.heights.width().max(finest.heights.height());
    let levels = 1 + cells.saturating_sub(1).div_ceil(TILE).max(1).next_power_of_two().ilog2() as usize;
    let mut made = TilesMade { levels, tiles: 0, triangles: 0 };
    let (mut level, mut below) = (finest, Vec::new());
    // From the finest, which is the deepest of the tree.
    for depth in (0..levels).rev() {
        progress.check_cancelled()?;
        let own = folder.join(TILES).join(depth.to_string());
        create_folder(&own)?;
        let tiles = frame.tiles_of(&level, depth, tolerance_m, &own)?;
        made.tiles += tiles.len();
        made.triangles += tiles.iter().map(|placed| placed.triangles).sum::<usize>();
        below = with_children(tiles, below);
        if depth > 0 {
            level = level.halved();
        }
    }
    let root = below.into_iter().next().map(|placed| placed.tile);
    let root = root.ok_or_else(|| ProductsError::NoTriangles { path: surface.dem.path.clone() })?;
    let extras = json!({ "source_crs": surface.crs.to_string(), "tolerance_m": tolerance_m });
    write_tileset(&folder.join(TILESET), &root, frame.ecef_from_frame(), &extras, false).map_err(FileError::from)?;
    Ok(made)
}

/// Hangs the tiles of the finer level under those of a level.
fn with_children(mut tiles: Vec<PlacedTile>, below: Vec<PlacedTile>) -> Vec<PlacedTile> {
    for child in below {
        let place = (child.column / 2, child.row / 2);
        if let Some(parent) = tiles.iter_mut().find(|tile| (tile.column, tile.row) == place) {
            for axis in 0..3 {
                parent.tile.low[axis] = parent.tile.low[axis].min(child.tile.low[axis]);
                parent.tile.high[axis] = parent.tile.high[axis].max(child.tile.high[axis]);
            }
            parent.tile.children.push(child.tile);
        } else {
            // Thinned to nothing: a thin strip of heights goes up one level.
            tiles.push(PlacedTile { column: place.0, row: place.1, ..child });
        }
    }
    tiles
}

impl<'a> TileFrame<'a> {
    /// The frame at the middle of the surface, at its least height.
    fn new(surface: &'a SurfaceOfRun, heights: &Grid<f32>) -> Result<Self, ProductsError> {
        let is_above_a_geoid = surface.crs.vertical != VerticalDatum::Ellipsoid;
        let to_ellipsoid = is_above_a_geoid.then(|| HeightConverter::new(surface.crs.vertical)).transpose()?;
        let (x, y) =
            surface.dem.geotransform.map_from_cell(0.5 * heights.width() as f64, 0.5 * heights.height() as f64);
        let (lon_deg, lat_deg) = surface.projection.lonlat_from_map(x, y)?;
        let low = heights.data().iter().filter(|h| h.is_finite()).fold(f32::INFINITY, |low, h| low.min(*h));
        let mut height_m = f64::from(low);
        if let Some(converter) = &to_ellipsoid {
            height_m = converter.ellipsoid_from_datum(lon_deg, lat_deg, height_m)?;
        }
        let frame = EnuFrame::new(LonLatHeight { lon_deg, lat_deg, height_m: height_m.floor() });
        Ok(Self { surface, frame, to_ellipsoid })
    }

    /// Returns the matrix from the frame to EPSG:4978 by columns.
    fn ecef_from_frame(&self) -> [f64; 16] {
        let origin = ecef_from_ground(self.frame.origin());
        let (sin_lon, cos_lon) = self.frame.origin().lon_deg.to_radians().sin_cos();
        let (sin_lat, cos_lat) = self.frame.origin().lat_deg.to_radians().sin_cos();
        [
            [-sin_lon, cos_lon, 0.0, 0.0],
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat, 0.0],
            [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat, 0.0],
            [origin.x, origin.y, origin.z, 1.0],
        ]
        .concat()
        .try_into()
        .unwrap_or([0.0; 16])
    }

    /// Returns the places of cells in the frame.
    fn places(
        &self,
        level: &MeshLevel,
        geotransform: &GeoTransform,
        cells: &[(u32, u32)],
    ) -> Result<Vec<EnuPoint>, ProductsError> {
        let (mut x, mut y): (Vec<f64>, Vec<f64>) =
            cells.iter().map(|&(c, r)| geotransform.map_from_cell(f64::from(c), f64::from(r))).unzip();
        let mut h: Vec<f64> = cells.iter().map(|&(c, r)| f64::from(level.heights[(c as usize, r as usize)])).collect();
        self.surface.projection.lonlat_from_map_slices(&mut x, &mut y)?;
        if let Some(converter) = &self.to_ellipsoid {
            converter.ellipsoid_from_datum_slices(&x, &y, &mut h)?;
        }
        let place =
            |i: usize| self.frame.enu_from_ground(LonLatHeight { lon_deg: x[i], lat_deg: y[i], height_m: h[i] });
        Ok((0..cells.len()).map(place).collect())
    }

    /// Writes the tiles of a level that have triangles.
    fn tiles_of(
        &self,
        level: &MeshLevel,
        depth: usize,
        tolerance_m: f64,
        folder: &Path,
    ) -> Result<Vec<PlacedTile>, ProductsError> {
        let tolerance_m = tolerance_m * level.stride as f64;
        let mesh = AdaptiveMesh::new(&level.heights, TILE, tolerance_m as f32);
        let geotransform = level.geotransform(&self.surface.dem.geotransform);
        let cell_m = self.surface.cell_m() * level.stride as f64;
        let (columns, rows) = mesh.tiles();
        let tiles: Vec<Result<Option<PlacedTile>, ProductsError>> = (0..columns * rows)
            .into_par_iter()
            .map(|number| {
                let (column, row) = (number % columns, number / columns);
                let made = mesh.triangles(column, row);
                if made.triangles.is_empty() {
                    return Ok(None);
                }
                let name = format!("{column}_{row}.glb");
                let place = self.places(level, &geotransform, &made.vertices)?;
                let tile = TileShape::new(level, (column, row), made, &place, 2.0 * (tolerance_m + cell_m));
                tile.write(&folder.join(&name))?;
                let error_m = if level.stride == 1 { 0.0 } else { CELLS_OF_ERROR * cell_m };
                let file = format!("{TILES}/{depth}/{name}");
                let (low, high) = (tile.low, tile.high);
                let tile_of = MeshTile { file, low, high, error_m, children: Vec::new() };
                Ok(Some(PlacedTile { column, row, triangles: tile.triangles.len(), tile: tile_of }))
            })
            .collect();
        tiles.into_iter().filter_map(Result::transpose).collect()
    }
}

/// The mesh of a tile with its picture.
struct TileShape {
    positions: Vec<[f32; 3]>,
    texture_positions: Vec<[f32; 2]>,
    triangles: Vec<[u32; 3]>,
    picture: Grid<[u8; 3]>,
    translation: [f64; 3],
    /// Least and greatest corner: east, north, up.
    low: [f64; 3],
    high: [f64; 3],
}

impl TileShape {
    /// Makes the mesh of a tile with skirts of a depth in metres.
    fn new(
        level: &MeshLevel,
        (column, row): (usize, usize),
        made: TileTriangles,
        places: &[EnuPoint],
        skirt_m: f64,
    ) -> Self {
        let (left, top) = (column * TILE, row * TILE);
        let width = (TILE + 1).min(level.heights.width() - left);
        let height = (TILE + 1).min(level.heights.height() - top);
        let TileTriangles { mut vertices, mut triangles } = made;
        let mut corners: Vec<[f64; 3]> = places.iter().map(|p| [p.east, p.north, p.up]).collect();
        let on_rim = |(c, r): (u32, u32)| {
            let (c, r) = (c as usize - left, r as usize - top);
            [c == 0, c == TILE, r == 0, r == TILE]
        };
        for triangle in triangles.clone() {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                let (rim_a, rim_b) = (on_rim(vertices[a as usize]), on_rim(vertices[b as usize]));
                if !(0..4).any(|side| rim_a[side] && rim_b[side]) {
                    continue;
                }
                let first = corners.len() as u32;
                for corner in [a, b] {
                    let [x, y, z] = corners[corner as usize];
                    corners.push([x, y, z - skirt_m]);
                    vertices.push(vertices[corner as usize]);
                }
                triangles.extend([[b, a, first], [b, first, first + 1]]);
            }
        }
        let bound = |pick: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
            [0, 1, 2].map(|axis| corners.iter().fold(start, |bound, corner| pick(bound, corner[axis])))
        };
        let (low, high) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
        let middle = [0, 1, 2].map(|axis| (0.5 * (low[axis] + high[axis])).round());
        let position = |corner: &[f64; 3]| {
            let [x, y, z] = [0, 1, 2].map(|axis| (corner[axis] - middle[axis]) as f32);
            [x, z, -y]
        };
        let place = |&(c, r): &(u32, u32)| {
            let share = |at: u32, start: usize, size: usize| ((at as usize - start) as f32 + 0.5) / size as f32;
            [share(c, left, width), share(r, top, height)]
        };
        let mut picture = Grid::filled(width, height, [0u8; 3]);
        for line in 0..height {
            picture.row_mut(line).copy_from_slice(&level.picture.row(top + line)[left..left + width]);
        }
        Self {
            positions: corners.iter().map(position).collect(),
            texture_positions: vertices.iter().map(place).collect(),
            triangles,
            picture,
            translation: [middle[0], middle[2], -middle[1]],
            low,
            high,
        }
    }

    fn write(&self, path: &Path) -> Result<(), ProductsError> {
        let mesh = TexturedMesh {
            positions: &self.positions,
            texture_positions: &self.texture_positions,
            triangles: &self.triangles,
            picture: &self.picture,
            translation: self.translation,
            extras: json!({ "axes": "x east, y up, z south of the tileset's frame" }),
        };
        Ok(write_textured_glb(path, &mesh, false).map_err(FileError::from)?)
    }
}
