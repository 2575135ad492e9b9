//! The textured mesh of a surface: one GLB file, and 3D Tiles with levels of detail.
//!
//! Both are triangulated within a stated vertical tolerance ([`raster::AdaptiveMesh`]). A level of
//! detail takes every second cell of the finer one and twice its tolerance. Tiles have skirts,
//! which hide the gaps between neighbours of different levels. Positions are f32 metres from the
//! middle of a tile.
//!
//! The GLB file lies in the map, in metres from a local origin. The tiles lie in an east, north, up
//! frame on the ellipsoid, which the tileset places in EPSG:4978; each vertex is converted, so the
//! curvature of the Earth is in it.

use std::path::{Path, PathBuf};

use formats::textured_mesh::{TexturedMesh, write_textured_glb};
use numeric::Progress;
use raster::{AdaptiveMesh, Grid, TileTriangles};
use serde::Serialize;
use serde_json::json;

use super::error::ProductsError;
use super::mesh_level::{MeshLevel, TILE};
use super::mesh_tiles::{self, TILES, TILESET, is_tile};
use super::scene::SurfaceOfRun;
use job::files::FileError;
use job::output_folder::OutputFolder;

/// Name of the single file.
pub(super) const GLB: &str = "mesh.glb";
/// Largest width and height of the single file, cells. Larger surfaces are thinned in it.
const SINGLE_SIDE: usize = 4096;

/// A mesh that was made.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct MeshReport {
    /// Single file.
    pub glb: PathBuf,
    /// Tileset of the tiles.
    pub tileset: PathBuf,
    /// Largest vertical distance of a cell from the finest mesh, metres.
    pub tolerance_m: f64,
    /// Distance of the cells that the single file is made of, metres.
    pub glb_cell_m: f64,
    /// Triangles of the single file.
    pub glb_triangles: usize,
    /// Origin of the single file: x, y on the map and height.
    pub glb_origin: [f64; 3],
    /// Reference system of the single file.
    pub glb_crs: String,
    /// Levels of detail of the tiles.
    pub levels: usize,
    /// Number of tiles.
    pub tiles: usize,
    /// Triangles of all tiles, with their skirts.
    pub tile_triangles: usize,
}

/// Makes the mesh in both forms.
pub(super) fn make(
    surface: &SurfaceOfRun,
    colours: &Grid<[u16; 3]>,
    tolerance_m: f64,
    folder: &OutputFolder,
    progress: &dyn Progress,
) -> Result<MeshReport, ProductsError> {
    let finest = MeshLevel::finest(&surface.dem.heights, colours);
    let work = folder.work_folder()?;
    progress.begin("mesh", 2);
    let mut single = finest.clone();
    while single.heights.width().max(single.heights.height()) > SINGLE_SIDE {
        single = single.halved();
    }
    let (glb_triangles, glb_origin) = write_single(surface, &single, tolerance_m, &work.path().join(GLB))?;
    let glb_cell_m = surface.cell_m() * single.stride as f64;
    progress.check_cancelled()?;
    progress.step();
    let made = mesh_tiles::make(surface, finest, tolerance_m, work.path(), progress)?;
    // The list of the tiles goes before them and comes after them.
    [GLB, TILESET].into_iter().try_for_each(|name| folder.remove(name))?;
    folder.remove_folder(TILES, &is_tile)?;
    [GLB, TILES, TILESET].into_iter().try_for_each(|name| folder.publish(work.path(), name))?;
    progress.step();
    Ok(MeshReport {
        glb: folder.path().join(GLB),
        tileset: folder.path().join(TILESET),
        tolerance_m,
        glb_cell_m,
        glb_triangles,
        glb_origin,
        glb_crs: surface.crs.to_string(),
        levels: made.levels,
        tiles: made.tiles,
        tile_triangles: made.triangles,
    })
}

/// Writes the whole surface as one mesh on the map. Returns the triangles and the origin.
fn write_single(
    surface: &SurfaceOfRun,
    level: &MeshLevel,
    tolerance_m: f64,
    path: &Path,
) -> Result<(usize, [f64; 3]), ProductsError> {
    let (width, height) = (level.heights.width(), level.heights.height());
    let mesh = AdaptiveMesh::new(&level.heights, TILE, (tolerance_m * level.stride as f64) as f32);
    let (columns, rows) = mesh.tiles();
    let mut numbers = Grid::filled(width, height, u32::MAX);
    let mut all = TileTriangles::default();
    for tile in 0..columns * rows {
        let TileTriangles { vertices, triangles } = mesh.triangles(tile % columns, tile / columns);
        let number = |&(column, row): &(u32, u32)| {
            let place = &mut numbers[(column as usize, row as usize)];
            if *place == u32::MAX {
                *place = all.vertices.len() as u32;
                all.vertices.push((column, row));
            }
            *place
        };
        let numbered: Vec<u32> = vertices.iter().map(number).collect();
        all.triangles.extend(triangles.iter().map(|corners| corners.map(|corner| numbered[corner as usize])));
    }
    let geotransform = level.geotransform(&surface.dem.geotransform);
    let (x, y) = geotransform.map_from_cell(0.5 * width as f64, 0.5 * height as f64);
    let metres = surface.projection.metres_per_unit_at(y);
    let known = level.heights.data().iter().filter(|h| h.is_finite());
    let low = known.fold(f32::INFINITY, |low, h| low.min(*h));
    // Whole metres or feet are easy to read; a degree is longer than most scenes.
    let (x, y) = if surface.projection.metres_per_unit().is_some() { (x.round(), y.round()) } else { (x, y) };
    let origin = [x, y, f64::from(low).floor()];
    let position = |&(column, row): &(u32, u32)| {
        let (x, y) = geotransform.map_from_cell(f64::from(column), f64::from(row));
        let up = f64::from(level.heights[(column as usize, row as usize)]) - origin[2];
        [((x - origin[0]) * metres.0) as f32, up as f32, (-(y - origin[1]) * metres.1) as f32]
    };
    let positions: Vec<[f32; 3]> = all.vertices.iter().map(position).collect();
    let place =
        |&(column, row): &(u32, u32)| [(column as f32 + 0.5) / width as f32, (row as f32 + 0.5) / height as f32];
    let texture_positions: Vec<[f32; 2]> = all.vertices.iter().map(place).collect();
    let picture = &level.picture;
    let mesh = TexturedMesh {
        positions: &positions,
        texture_positions: &texture_positions,
        triangles: &all.triangles,
        picture,
        translation: [0.0; 3],
        extras: extras(surface, origin, metres),
    };
    write_textured_glb(path, &mesh, false).map_err(FileError::from)?;
    Ok((all.triangles.len(), origin))
}

/// What the file says about its place: map = origin + (x, −z) / metres_per_map_unit, height =
/// origin + y. On a map in degrees the metres are two, those per degree east and north.
fn extras(surface: &SurfaceOfRun, origin: [f64; 3], metres: (f64, f64)) -> serde_json::Value {
    let per_unit = if surface.projection.metres_per_unit().is_some() { json!(metres.0) } else { json!(metres) };
    json!({
        "crs": surface.crs.to_string(),
        "vertical_datum": surface.crs.vertical.to_string(),
        "origin": origin,
        "metres_per_map_unit": per_unit,
        "axes": "x east, y up, z south",
    })
}

/// Returns the tolerance of a surface: its median standard deviation, between a quarter and the
/// whole of a cell.
pub(super) fn fitting_tolerance(sigma_m: &Grid<f32>, cell_m: f64) -> f64 {
    let median = raster::height_percentiles(sigma_m, 50.0, 50.0).map_or(cell_m, |(median, _)| f64::from(median));
    median.clamp(0.25 * cell_m, cell_m)
}
