//! The surface that is looked at: a raster of heights or the triangles of a city model, on a map in metres.

use std::path::Path;

use anyhow::{Context, bail, ensure};
use bvh::Ray;
use city::{MeshConfig, TriangleMesh};
use crs::{CrsIdentity, HeightConverter, MapProjection, VerticalDatum};
use groundview::{Ground, HeightField, MeshGround, Met};
use io::splat_ply::LocalOrigin;
use raster::GeoTransform;

use crate::progress::Log;
use jobs::map_surface;

/// Where rays from above start, metres above the origin: higher than all there is.
const FROM_ABOVE_M: f64 = 20_000.0;

/// A surface with its map.
pub(super) struct Surface {
    pub(super) kind: Kind,
    pub(super) projection: MapProjection,
    /// What local positions are counted from: map coordinates, and metres above the ellipsoid.
    pub(super) origin: [f64; 3],
}

pub(super) enum Kind {
    /// A raster, with its place.
    Field(Box<HeightField>, GeoTransform),
    /// Triangles.
    Mesh(MeshGround),
}

impl Ground for Surface {
    fn meet(&self, ray: &Ray) -> Option<Met> {
        match &self.kind {
            Kind::Field(field, _) => field.meet(ray),
            Kind::Mesh(mesh) => mesh.meet(ray),
        }
    }
}

impl Surface {
    /// Opens a raster or a city model.
    pub(super) fn open(path: &Path, vertical: Option<VerticalDatum>) -> anyhow::Result<Self> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        match ending.as_str() {
            "json" | "jsonl" | "gml" | "xml" | "obj" | "ply" | "cityjson" | "citygml" => Self::model(path, vertical),
            _ => Self::raster(path, vertical),
        }
    }

    fn raster(path: &Path, vertical: Option<VerticalDatum>) -> anyhow::Result<Self> {
        let map_surface::MapSurface { dem, projection } = map_surface::read(path, vertical, &Log)?;
        let origin = splats::SplatSurface::middle(&dem.heights, dem.geotransform)
            .with_context(|| format!("the surface has no height: {}", path.display()))?;
        let heights = dem.heights.map(|&h| (f64::from(h) - origin[2]) as f32);
        let field = HeightField::new(heights, dem.geotransform, origin)
            .with_context(|| format!("the surface has less than 2 x 2 cells: {}", path.display()))?;
        Ok(Self { kind: Kind::Field(Box::new(field), dem.geotransform), projection, origin })
    }

    fn model(path: &Path, vertical: Option<VerticalDatum>) -> anyhow::Result<Self> {
        let file = io::citymodel::read(path)?;
        let mut mesh = TriangleMesh::from_model(&file.model, &MeshConfig::default())?.mesh;
        ensure!(
            !mesh.triangles.is_empty(),
            "no surface of the model can be used (skysweep city info tells why): {}",
            path.display()
        );
        let crs = &file.model.crs;
        let Some(epsg) = crs.epsg else { bail!("the model names no coordinate system: {}", path.display()) };
        let definition = format!("EPSG:{epsg}");
        let projection = MapProjection::from_definition(&definition)?;
        ensure!(
            projection.metres_per_unit() == Some(1.0),
            "the model is not on a map in metres: convert it first: {}",
            path.display()
        );
        let stated = crs.vertical_epsg.map(VerticalDatum::from_epsg).or(CrsIdentity::of(&definition)?.vertical);
        if stated.is_none() && vertical.is_none() {
            tracing::warn!("the file does not say what its heights are above: taken as the ellipsoid, see --vertical");
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
        Ok(Self { kind: Kind::Mesh(MeshGround::new(&mesh.positions, &mesh.triangles)?), projection, origin })
    }

    /// The height of the surface above the origin at a local position; `None` where there is none.
    pub(super) fn height_at(&self, x: f64, y: f64) -> Option<f64> {
        let down = Ray { origin: [x, y, FROM_ABOVE_M], direction: [0.0, 0.0, -1.0], end: f64::INFINITY };
        self.meet(&down).map(|met| FROM_ABOVE_M - met.t)
    }

    /// The origin as files say it.
    pub(super) fn local_origin(&self) -> LocalOrigin {
        LocalOrigin::new(self.projection.definition(), VerticalDatum::Ellipsoid.to_string(), self.origin)
    }
}
