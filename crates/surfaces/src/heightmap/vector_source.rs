//! Triangles of a city model and points of a cloud, read at the pixels of a tile.

use std::path::PathBuf;

use bvh::Bvh;
use city::{LodChoice, MeshConfig, Scope};
use crs::{CrsIdentity, VerticalDatum};
use formats::points::PointCloud;
use heightmap::{
    GROUND_REACH_M, HighestPoints, MapSystem, PlacedTriangles, PointTiles, SourceMap, TileFrame, TileMap, TileRequest,
    heights_from_triangles, lowest_from_triangles,
};
use numeric::Progress;

use super::config::HeightMapConfig;
use super::error::HeightMapJobError;
use super::settings::Settings;
use super::source_map::{FilePlace, Laid, source_map};
use crate::camera_stand::CameraStand;
use crate::city_files::{CitySurfaceError, read_triangles};

/// Triangles of a city model.
pub(super) struct ModelSource {
    map: SourceMap,
    bvh: Bvh,
    origin: [f64; 3],
    /// Lowest and highest z, metres above the origin.
    z_span: (f64, f64),
}

impl ModelSource {
    /// Reads a city model and makes its triangles.
    pub(super) fn open(config: &HeightMapConfig, progress: &dyn Progress) -> Result<Self, HeightMapJobError> {
        let path = config.source.as_path();
        let selection = MeshConfig {
            lod: config.lod.map_or_else(LodChoice::default, LodChoice::Only),
            scope: if config.all_objects { Scope::Everything } else { Scope::Buildings },
        };
        let (mesh, crs) = read_triangles(path, &selection)?;
        let stated = crs.epsg.map(|code| format!("EPSG:{code}"));
        let identity = stated.as_deref().map(CrsIdentity::of).transpose()?;
        let datum = crs.vertical_epsg.map(VerticalDatum::from_epsg).or(identity.and_then(|i| i.vertical));
        let place = FilePlace { crs: stated, vertical: datum };
        let map = source_map(path, place, config.source_epsg, config.source_vertical, progress)?;
        if map.projection.metres_per_unit().is_none() {
            return Err(HeightMapJobError::InDegrees { path: path.to_owned() });
        }
        let bvh = Bvh::new(&mesh.positions, &mesh.triangles).map_err(CitySurfaceError::from)?;
        let z = || mesh.positions.iter().map(|p| p[2]);
        let z_span = (z().fold(f64::INFINITY, f64::min), z().fold(f64::NEG_INFINITY, f64::max));
        Ok(Self { map, bvh, origin: [mesh.origin.x, mesh.origin.y, mesh.origin.z], z_span })
    }

    /// Casts rays from above at the pixels of a tile.
    pub(super) fn lay(&self, request: TileRequest, system: MapSystem) -> Result<Laid, HeightMapJobError> {
        let zero_m = self.origin[2] + self.z_span.0;
        let frame = TileFrame::new(request, zero_m, system)?;
        let map = TileMap::to_map(&frame, &self.map)?;
        let triangles = PlacedTriangles { bvh: &self.bvh, origin: self.origin, z_span: self.z_span };
        let heights = heights_from_triangles(&triangles, &map, request.size, zero_m);
        let reach = (GROUND_REACH_M * request.resolution_px_per_m).ceil() as usize;
        let lowest = Some(lowest_from_triangles(&triangles, &map, (request.size, reach), zero_m));
        Ok(Laid { frame, heights, zero_m, lowest })
    }
}

/// A point cloud. It is read once for every batch of tiles.
pub(super) struct PointSource {
    path: PathBuf,
    map: SourceMap,
    /// Middle of its heights, metres above the ellipsoid.
    middle_m: f64,
}

impl PointSource {
    /// Opens a point cloud.
    pub(super) fn open(config: &HeightMapConfig, progress: &dyn Progress) -> Result<Self, HeightMapJobError> {
        let path = config.source.as_path();
        let cloud = PointCloud::open(path)?;
        let place = FilePlace { crs: cloud.crs_definition().map(str::to_owned), vertical: cloud.vertical() };
        let map = source_map(path, place, config.source_epsg, config.source_vertical, progress)?;
        Ok(Self { path: path.to_owned(), map, middle_m: cloud.middle_height_m() })
    }

    /// Finds the highest points at the pixels of some tiles, in one pass over the cloud.
    pub(super) fn lay(&self, settings: &Settings, stands: &[CameraStand]) -> Vec<Result<Laid, HeightMapJobError>> {
        let (mut frames, mut open) = (Vec::new(), Vec::new());
        for stand in stands {
            let begun = self.begin(settings, stand);
            frames.push(begun.map(|(frame, tile)| {
                open.push(tile);
                frame
            }));
        }
        let mut tiles = PointTiles::new(open);
        let read = PointCloud::open(&self.path).and_then(|cloud| cloud.visit(|p| tiles.push(p.x, p.y, p.height_m)));
        let failed = read.err().map(|error| error.to_string());
        let mut filled = tiles.finish().into_iter();
        let laid = |frame: Result<TileFrame, HeightMapJobError>| {
            let frame = frame?;
            let (heights, _) = filled.next().ok_or(HeightMapJobError::WorkerLost)?;
            match &failed {
                Some(reason) => Err(HeightMapJobError::PointsStopped { reason: reason.clone() }),
                None => Ok(Laid { frame, heights, zero_m: self.middle_m, lowest: None }),
            }
        };
        frames.into_iter().map(laid).collect()
    }

    /// Lays out an empty tile.
    fn begin(&self, settings: &Settings, stand: &CameraStand) -> Result<(TileFrame, HighestPoints), HeightMapJobError> {
        let frame = TileFrame::new(settings.request(stand), self.middle_m, settings.system(stand)?)?;
        let map = TileMap::from_map(&frame, &self.map)?;
        Ok((frame, HighestPoints::new(map, settings.config.size_px, self.middle_m)))
    }
}
