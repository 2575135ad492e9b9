//! What heights are taken from: rasters, city models, point clouds, each laid under the pixels of a tile.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use bvh::Bvh;
use city::{LodChoice, MeshConfig, Scope, TriangleMesh};
use crs::{CrsIdentity, CrsRequest, HeightConverter, MapProjection, VerticalDatum};
use heightmap::{
    HighestPoints, MapSystem, PointTiles, Reading, SourceMap, TileFrame, TileMap, TileRequest, confidence_from_grid,
    heights_from_grid, heights_from_triangles,
};
use io::points::{PointCloud, is_point_cloud};
use io::raster::{ImageSource, read_dem, read_dem_window};
use raster::{GeoTransform, Grid, Window};

use super::MakeArgs;
use super::settings::Settings;
use crate::stand::Stand;

/// Rasters up to this many cells are kept in memory (512 MiB); of larger ones the part under a tile is read.
const WHOLE_CELLS: usize = 1 << 27;
/// Cells read around a place.
const AROUND: usize = 3;
/// Cells of all tiles that are open in one pass over a point cloud (512 MiB).
const OPEN_CELLS: usize = 1 << 27;

/// A source of heights.
pub(super) enum Source {
    /// Heights on a grid.
    Raster(RasterSource),
    /// Triangles of a city model.
    Model(Box<ModelSource>),
    /// Points.
    Points(PointSource),
}

/// Heights under the pixels of a tile.
pub(super) struct Laid {
    pub(super) frame: TileFrame,
    /// Above `zero_m`, NaN where there is none.
    pub(super) heights: Grid<f32>,
    /// Above the ellipsoid.
    pub(super) zero_m: f64,
}

impl Source {
    /// Opens a source of any kind.
    pub(super) fn open(path: &Path, args: &MakeArgs) -> anyhow::Result<Self> {
        if is_point_cloud(path) {
            return PointSource::open(path, args).map(Self::Points);
        }
        if is_city_model(path) {
            return ModelSource::open(path, args).map(|model| Self::Model(Box::new(model)));
        }
        RasterSource::open(path, args.source_crs, args.source_vertical).map(Self::Raster)
    }

    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Raster(_) => "raster",
            Self::Model(_) => "city model",
            Self::Points(_) => "point cloud",
        }
    }

    /// How many tiles are best laid at a time.
    pub(super) fn batch(&self, settings: &Settings) -> usize {
        match self {
            Self::Points(_) => (OPEN_CELLS / settings.size.saturating_mul(settings.size).max(1)).max(1),
            _ => 64,
        }
    }

    /// Lays the source under the tiles of some stands.
    pub(super) fn lay(&self, settings: &Settings, stands: &[Stand]) -> Vec<anyhow::Result<Laid>> {
        use rayon::prelude::*;
        let each = |one: &(dyn Fn(&Stand, TileRequest, MapSystem) -> anyhow::Result<Laid> + Sync)| {
            let lay = |stand: &Stand| one(stand, settings.request(stand), settings.system(stand)?);
            stands.par_iter().map(lay).collect()
        };
        match self {
            Self::Raster(raster) => {
                each(&|stand, request, system| raster.lay(stand, request, system, settings.reading))
            }
            Self::Model(model) => each(&|_, request, system| model.lay(request, system)),
            Self::Points(points) => points.lay(settings, stands),
        }
    }
}

/// Whether a file is a city model, by its ending: their readers look at the content.
fn is_city_model(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["json", "jsonl", "gml", "xml", "obj", "ply", "cityjson", "citygml"].contains(&ending.as_str())
}

/// The map and datum of a file, by what it says and what the command line says instead.
fn source_map(
    path: &Path,
    stated: Option<String>,
    datum: Option<VerticalDatum>,
    crs: Option<CrsRequest>,
    vertical: Option<VerticalDatum>,
) -> anyhow::Result<SourceMap> {
    let (asked, asked_datum) = match crs {
        Some(CrsRequest::Epsg { horizontal, vertical }) => (Some(format!("EPSG:{horizontal}")), vertical),
        Some(CrsRequest::Auto) => bail!("--source-crs must name a code: EPSG:n"),
        None => (None, None),
    };
    let definition = asked
        .or(stated)
        .with_context(|| format!("the file names no coordinate system: give --source-crs: {}", path.display()))?;
    let projection = MapProjection::from_definition(&definition)
        .with_context(|| format!("its coordinate system: {}", path.display()))?;
    let datum = vertical.or(asked_datum).or(datum).unwrap_or_else(|| {
        tracing::warn!(
            "the file does not say what its heights are above, taken as the ellipsoid (--source-vertical): {}",
            path.display()
        );
        VerticalDatum::Ellipsoid
    });
    Ok(SourceMap { projection, heights: HeightConverter::new(datum)? })
}

/// Heights on a grid, in memory where they are not too many.
pub(super) struct RasterSource {
    path: PathBuf,
    map: SourceMap,
    geotransform: GeoTransform,
    whole: Option<Grid<f32>>,
}

impl RasterSource {
    pub(super) fn open(path: &Path, crs: Option<CrsRequest>, vertical: Option<VerticalDatum>) -> anyhow::Result<Self> {
        let info = ImageSource::open(path)?.info().clone();
        let small = info.width.saturating_mul(info.height) <= WHOLE_CELLS;
        let first = Window { x: 0, y: 0, width: 1, height: 1 };
        let dem = if small { read_dem(path)? } else { read_dem_window(path, first)? };
        let stated = dem.horizontal_epsg.map(|code| format!("EPSG:{code}")).or(dem.crs_wkt);
        let map = source_map(path, stated, dem.vertical, crs, vertical)?;
        let whole = small.then_some(dem.heights);
        Ok(Self { path: path.to_owned(), map, geotransform: dem.geotransform, whole })
    }

    fn lay(&self, stand: &Stand, request: TileRequest, system: MapSystem, reading: Reading) -> anyhow::Result<Laid> {
        let zero_m = match stand.height_m {
            Some(height) => height,
            None => self.near(stand)?.unwrap_or(0.0),
        };
        let frame = TileFrame::new(request, zero_m, system)?;
        let heights = self.on(&frame, reading, zero_m)?;
        Ok(Laid { frame, heights, zero_m })
    }

    /// The heights under a tile's pixels.
    pub(super) fn on(&self, frame: &TileFrame, reading: Reading, zero_m: f64) -> anyhow::Result<Grid<f32>> {
        let size = frame.request().size;
        self.with_cells(frame, |cells, map| heights_from_grid(cells, map, size, reading, zero_m))
            .map(|heights| heights.unwrap_or_else(|| Grid::filled(size, size, f32::NAN)))
    }

    /// The confidences under those of a tile's pixels that have a height.
    pub(super) fn confidence(&self, frame: &TileFrame, heights: &Grid<f32>) -> anyhow::Result<Grid<f32>> {
        let none = || heights.map(|h| if h.is_finite() { 0.0 } else { f32::NAN });
        self.with_cells(frame, |cells, map| confidence_from_grid(cells, map, heights))
            .map(|confidence| confidence.unwrap_or_else(none))
    }

    /// Does something with the cells under a tile; `None` where the raster does not reach it.
    fn with_cells<T>(
        &self,
        frame: &TileFrame,
        work: impl FnOnce(&Grid<f32>, &TileMap) -> T,
    ) -> anyhow::Result<Option<T>> {
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

    /// A part of the raster with its place; `None` where it does not reach.
    fn window(&self, window: Window) -> anyhow::Result<Option<(Grid<f32>, GeoTransform)>> {
        match read_dem_window(&self.path, window) {
            Ok(part) => Ok(Some((part.heights, part.geotransform))),
            Err(io::raster::RasterError::Unsupported { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// The height above the ellipsoid of a cell at the stand, to some metres.
    fn near(&self, stand: &Stand) -> anyhow::Result<Option<f64>> {
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

/// Triangles of a city model.
pub(super) struct ModelSource {
    map: SourceMap,
    bvh: Bvh,
    origin: [f64; 3],
    /// Lowest and highest z from the origin.
    z_span: (f64, f64),
}

impl ModelSource {
    fn open(path: &Path, args: &MakeArgs) -> anyhow::Result<Self> {
        let file = io::citymodel::read(path)?;
        let config = MeshConfig {
            lod: args.lod.map_or_else(LodChoice::default, LodChoice::Only),
            scope: if args.all_objects { Scope::Everything } else { Scope::Buildings },
        };
        let mesh = TriangleMesh::from_model(&file.model, &config)?.mesh;
        ensure!(
            !mesh.triangles.is_empty(),
            "no surface of the model can be used (skysweep city info tells why): {}",
            path.display()
        );
        let crs = &file.model.crs;
        let stated = crs.epsg.map(|code| format!("EPSG:{code}"));
        let identity = stated.as_deref().map(CrsIdentity::of).transpose()?;
        let datum = crs.vertical_epsg.map(VerticalDatum::from_epsg).or(identity.and_then(|i| i.vertical));
        let map = source_map(path, stated, datum, args.source_crs, args.source_vertical)?;
        ensure!(
            map.projection.metres_per_unit().is_some(),
            "the model is in degrees, expected a projected coordinate system: {}",
            path.display()
        );
        let bvh = Bvh::new(&mesh.positions, &mesh.triangles)?;
        let z = || mesh.positions.iter().map(|p| p[2]);
        let z_span = (z().fold(f64::INFINITY, f64::min), z().fold(f64::NEG_INFINITY, f64::max));
        Ok(Self { map, bvh, origin: [mesh.origin.x, mesh.origin.y, mesh.origin.z], z_span })
    }

    fn lay(&self, request: TileRequest, system: MapSystem) -> anyhow::Result<Laid> {
        let zero_m = self.origin[2] + self.z_span.0;
        let frame = TileFrame::new(request, zero_m, system)?;
        let map = TileMap::to_map(&frame, &self.map)?;
        let heights = heights_from_triangles(&self.bvh, self.origin, self.z_span, &map, request.size, zero_m);
        Ok(Laid { frame, heights, zero_m })
    }
}

/// A point cloud, read anew for every batch of tiles.
pub(super) struct PointSource {
    path: PathBuf,
    map: SourceMap,
    /// The middle of its heights.
    middle_m: f64,
}

impl PointSource {
    fn open(path: &Path, args: &MakeArgs) -> anyhow::Result<Self> {
        let cloud = PointCloud::open(path)?;
        let stated = cloud.crs_definition().map(str::to_owned);
        let map = source_map(path, stated, cloud.vertical(), args.source_crs, args.source_vertical)?;
        Ok(Self { path: path.to_owned(), map, middle_m: cloud.middle_height_m() })
    }

    fn lay(&self, settings: &Settings, stands: &[Stand]) -> Vec<anyhow::Result<Laid>> {
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
        let laid = |frame: anyhow::Result<TileFrame>| {
            let frame = frame?;
            let (heights, _) = filled.next().context("a tile was lost")?;
            match &failed {
                Some(reason) => bail!("{reason}"),
                None => Ok(Laid { frame, heights, zero_m: self.middle_m }),
            }
        };
        frames.into_iter().map(laid).collect()
    }

    fn begin(&self, settings: &Settings, stand: &Stand) -> anyhow::Result<(TileFrame, HighestPoints)> {
        let frame = TileFrame::new(settings.request(stand), self.middle_m, settings.system(stand)?)?;
        let map = TileMap::from_map(&frame, &self.map)?;
        Ok((frame, HighestPoints::new(map, settings.size, self.middle_m)))
    }
}
