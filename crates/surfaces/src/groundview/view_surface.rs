//! The surface that the cameras look at: a raster of heights or the triangles of a city model, on a
//! map in metres.

use std::path::Path;

use bvh::Ray;
use city::MeshConfig;
use crs::{CrsIdentity, HeightConverter, MapProjection, VerticalDatum};
use formats::splat_ply::LocalOrigin;
use groundview::{Ground, HeightField, MeshGround, Met};
use numeric::Progress;
use raster::{GeoTransform, Grid};

use super::error::GroundViewError;
use crate::city_files::{CitySurfaceError, is_city_model, read_triangles};
use crate::standing::{LEAST_OBJECT_M, ground_under};
use job::map_surface;

/// Start of rays from above, metres above the origin: higher than any terrain.
const FROM_ABOVE_M: f64 = 20_000.0;
/// Side of the tile in which the ground under a camera is found, metres: twice a block of houses on
/// each side.
const GROUND_TILE: usize = 201;

/// A surface with its map.
pub(super) struct ViewSurface {
    /// Heights or triangles.
    pub(super) kind: SurfaceKind,
    /// Projection of its map.
    pub(super) projection: MapProjection,
    /// Origin of local positions: map coordinates, and metres above the ellipsoid.
    pub(super) origin: [f64; 3],
}

/// Heights or triangles of a surface.
pub(super) enum SurfaceKind {
    /// A raster, with its place.
    Field(Box<HeightField>, GeoTransform),
    /// Triangles.
    Mesh(MeshGround),
}

impl Ground for ViewSurface {
    fn meet(&self, ray: &Ray) -> Option<Met> {
        match &self.kind {
            SurfaceKind::Field(field, _) => field.meet(ray),
            SurfaceKind::Mesh(mesh) => mesh.meet(ray),
        }
    }
}

impl ViewSurface {
    /// Opens a raster or a city model.
    pub(super) fn open(
        path: &Path,
        vertical: Option<VerticalDatum>,
        progress: &dyn Progress,
    ) -> Result<Self, GroundViewError> {
        if is_city_model(path) { Self::model(path, vertical, progress) } else { Self::raster(path, vertical, progress) }
    }

    fn raster(path: &Path, vertical: Option<VerticalDatum>, progress: &dyn Progress) -> Result<Self, GroundViewError> {
        let map_surface::MapSurface { dem, projection } = map_surface::read(path, vertical, progress)?;
        let origin = splats::SplatSurface::middle(&dem.heights, dem.geotransform)
            .ok_or_else(|| GroundViewError::NoHeights { path: path.to_owned() })?;
        let heights = dem.heights.map(|&h| (f64::from(h) - origin[2]) as f32);
        let field = HeightField::new(heights, dem.geotransform, origin)
            .ok_or_else(|| GroundViewError::TooSmall { path: path.to_owned() })?;
        Ok(Self { kind: SurfaceKind::Field(Box::new(field), dem.geotransform), projection, origin })
    }

    fn model(path: &Path, vertical: Option<VerticalDatum>, progress: &dyn Progress) -> Result<Self, GroundViewError> {
        let (mut mesh, crs) = read_triangles(path, &MeshConfig::default())?;
        let Some(epsg) = crs.epsg else { return Err(GroundViewError::NoCrs { path: path.to_owned() }) };
        let definition = format!("EPSG:{epsg}");
        let projection = MapProjection::from_definition(&definition)?;
        if projection.metres_per_unit() != Some(1.0) {
            return Err(GroundViewError::NotInMetres { path: path.to_owned() });
        }
        let stated = crs.vertical_epsg.map(VerticalDatum::from_epsg).or(CrsIdentity::of(&definition)?.vertical);
        if stated.is_none() && vertical.is_none() {
            progress.warn(&format!(
                "the file does not name the vertical datum of its heights, so they are taken as above the ellipsoid: {}",
                path.display()
            ));
        }
        let origin = [mesh.origin.x, mesh.origin.y, mesh.origin.z];
        let datum = vertical.or(stated).unwrap_or(VerticalDatum::Ellipsoid);
        if datum != VerticalDatum::Ellipsoid {
            let converter = HeightConverter::new(datum)?;
            let map = |axis: usize| mesh.positions.iter().map(move |p| p[axis] + origin[axis]);
            let (mut x, mut y, mut z): (Vec<f64>, Vec<f64>, Vec<f64>) =
                (map(0).collect(), map(1).collect(), map(2).collect());
            projection.lonlat_from_map_slices(&mut x, &mut y)?;
            converter.ellipsoid_from_datum_slices(&x, &y, &mut z)?;
            mesh.positions.iter_mut().zip(z).for_each(|(p, z)| p[2] = z - origin[2]);
        }
        let ground = MeshGround::new(&mesh.positions, &mesh.triangles).map_err(CitySurfaceError::from)?;
        Ok(Self { kind: SurfaceKind::Mesh(ground), projection, origin })
    }

    /// Returns the height of the ground above the origin at a local position; `None` if there is no
    /// surface. Of triangles it is the lowest, and under a roof of a raster the bare ground.
    pub(super) fn ground_at(&self, x: f64, y: f64) -> Option<f64> {
        if let SurfaceKind::Mesh(mesh) = &self.kind {
            let up = Ray { origin: [x, y, -FROM_ABOVE_M], direction: [0.0, 0.0, 1.0], end: f64::INFINITY };
            return mesh.meet(&up).map(|met| met.t - FROM_ABOVE_M);
        }
        let surface = self.height_at(x, y)?;
        let middle = (GROUND_TILE - 1) as f64 / 2.0;
        let height = |i: usize| {
            let [column, row] = [i % GROUND_TILE, i / GROUND_TILE].map(|at| at as f64 - middle);
            self.height_at(x + column, y + row).map_or(f32::NAN, |height| height as f32)
        };
        let tile = Grid::from_vec(GROUND_TILE, GROUND_TILE, (0..GROUND_TILE * GROUND_TILE).map(height).collect())?;
        // What stands lower than the surface only by the interpolation of the tile is the surface.
        let ground = ground_under(&tile, 1.0).unwrap_or(surface);
        Some(if surface - ground > LEAST_OBJECT_M { ground } else { surface })
    }

    /// Returns the height of the surface above the origin at a local position; `None` if there is
    /// none.
    fn height_at(&self, x: f64, y: f64) -> Option<f64> {
        let down = Ray { origin: [x, y, FROM_ABOVE_M], direction: [0.0, 0.0, -1.0], end: f64::INFINITY };
        self.meet(&down).map(|met| FROM_ABOVE_M - met.t)
    }

    /// Returns the origin as the files hold it.
    pub(super) fn local_origin(&self) -> LocalOrigin {
        LocalOrigin::new(self.projection.definition(), VerticalDatum::Ellipsoid.to_string(), self.origin)
    }
}
