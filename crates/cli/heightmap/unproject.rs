//! `skysweep heightmap unproject`: a height map back as points or as Gaussian splats.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::ValueEnum;
use crs::{Crs, MapProjection};
use geodesy::{LonLatHeight, TransverseMercator, utm_epsg};
use heightmap::{camera_points, map_points};
use io::ply::{PlyPoint, write_points};
use io::points::write_las;
use io::raster::{ImageSource, SampleType};
use io::splat_ply::{LocalOrigin, SplatForm, SplatLayout};
use raster::{GeoTransform, Grid};
use serde_json::json;
use splats::{DivisionConfig, SplatSurface, picture_splats, stretched};

use super::tags::Tags;
use crate::{Global, Outcome, print};

/// Most pixels of a map.
const CELLS_MAX: usize = 1 << 28;

/// A height map has no colours.
const GREY: [u8; 3] = [128; 3];

/// Arguments of `skysweep heightmap unproject`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Height map that skysweep made.
    map: PathBuf,
    /// File to write: .ply (metres from the camera) or .las (UTM, heights above the ellipsoid).
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Axes of points in a PLY.
    #[arg(long, value_enum, default_value_t = Frame::World)]
    frame: Frame,
    /// Write Gaussian splats as 3DGS viewers and trainers read them (.ply, its origin beside it), one for each pixel.
    #[arg(long)]
    splats: bool,
    /// Picture of the map's own pixels that gives the splats their colours [default: grey].
    #[arg(long, value_name = "IMAGE", requires = "splats")]
    picture: Option<PathBuf>,
    /// Merge splats whose heights are within so many metres of one plane, and whose colours are alike.
    #[arg(long, value_name = "METRES", requires = "splats")]
    merge: Option<f64>,
    /// Replace a file that exists.
    #[arg(long)]
    overwrite: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Axes of the points of a PLY.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Frame {
    /// East, north, up of the camera.
    World,
    /// (u / r, v / r, h): right of the camera, behind it, up.
    Camera,
}

/// Runs `skysweep heightmap unproject`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let map = Map::read(&args.map)?;
    let ending = args.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let points = match ending.as_str() {
        "ply" if args.splats => map.write_splats(args)?,
        _ if args.splats => bail!("splats are written as .ply, not as {}", args.output.display()),
        "ply" => map.write_ply(args)?,
        "las" | "laz" => map.write_las(args)?,
        _ => bail!("no format belongs to the ending of {}: expected .ply, .las or .laz", args.output.display()),
    };
    if args.json {
        let what = if args.splats { "splats" } else { "points" };
        print::json(&json!({ "path": args.output, what: points, "camera": map.tags }))?;
    } else if !global.is_quiet() {
        let what = if args.splats { "splats" } else { "points" };
        print::text(&format!("{what}  {points}\nfile    {}\n", args.output.display()))?;
    }
    Ok(Outcome::Complete)
}

/// A height map as its file has it.
struct Map {
    tags: Tags,
    /// As they stand in the file, NaN where there is none.
    values: Grid<f32>,
    /// Where the map has them.
    confidence: Option<Grid<f32>>,
    geotransform: GeoTransform,
    projection: MapProjection,
}

impl Map {
    fn read(path: &Path) -> anyhow::Result<Self> {
        let tags = Tags::read(path)?;
        let source = ImageSource::open(path)?;
        let (cells, info) = (source.window(), source.info());
        ensure!(
            cells.width.saturating_mul(cells.height) <= CELLS_MAX,
            "{} x {} pixels, at most 2^28 are read: {}",
            cells.width,
            cells.height,
            path.display()
        );
        let geotransform = info.geotransform.with_context(|| format!("no georeference: {}", path.display()))?;
        let crs = info.crs_wkt.as_deref().with_context(|| format!("no coordinate system: {}", path.display()))?;
        let values = source.read_samples(1, cells)?;
        let confidence = if info.bands > 1 { Some(source.read_samples(2, cells)?) } else { None };
        Ok(Self { tags, values, confidence, geotransform, projection: MapProjection::from_definition(crs)? })
    }

    /// Metres per unit of the values.
    fn scale(&self) -> f64 {
        if self.tags.normalized { self.tags.scene_scale_m } else { 1.0 }
    }

    /// Longitude, latitude, and height relative to the camera.
    fn on_ground(&self) -> anyhow::Result<Vec<[f64; 3]>> {
        let mut points = map_points(&self.values, &self.geotransform, self.scale());
        let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p[0], p[1])).unzip();
        let lost = self.projection.lonlat_from_map_slices(&mut lon, &mut lat)?;
        ensure!(lost == 0, "{lost} pixels lie outside the map of their coordinate system");
        for (point, (lon, lat)) in points.iter_mut().zip(lon.into_iter().zip(lat)) {
            (point[0], point[1]) = (lon, lat);
        }
        Ok(points)
    }

    fn write_ply(&self, args: &Args) -> anyhow::Result<usize> {
        let Tags { camera_lon_deg, camera_lat_deg, camera_height_m, resolution_px_per_m, .. } = self.tags;
        let local = TransverseMercator::local(LonLatHeight::new(camera_lon_deg, camera_lat_deg, camera_height_m))?;
        let (points, axes) = match args.frame {
            Frame::Camera => {
                (camera_points(&self.values, resolution_px_per_m, self.scale()), "right, back, up of the camera")
            }
            Frame::World => {
                let place = |p: [f64; 3]| local.map_from_lonlat(p[0], p[1]).map(|at| [at.x, at.y, p[2]]);
                let points = self.on_ground()?.into_iter().map(place).collect::<Result<Vec<_>, _>>()?;
                (points, "east, north, up of the camera")
            }
        };
        let comments = [
            format!("metres {axes}"),
            format!(
                "camera {camera_lon_deg} {camera_lat_deg} {camera_height_m} (lon, lat, metres above the ellipsoid)"
            ),
            format!("heading {}", self.tags.heading_deg),
        ];
        let count = points.len();
        let plain = |p: [f64; 3]| PlyPoint { position: p.map(|c| c as f32), normal: [0.0; 3], color: GREY };
        write_points(&args.output, points.into_iter().map(plain), &comments, args.overwrite)?;
        if args.frame == Frame::World {
            let origin = LocalOrigin::new(local.wkt(), "ellipsoid", [0.0, 0.0, camera_height_m]);
            origin.write_beside(&args.output, args.overwrite)?;
        }
        Ok(count)
    }

    /// Splats on the axes of the map's own coordinate system, from the camera.
    fn write_splats(&self, args: &Args) -> anyhow::Result<usize> {
        ensure!(args.frame == Frame::World, "splats are turned by rotations, and the camera's frame is a mirrored one");
        ensure!(self.projection.metres_per_unit() == Some(1.0), "the map is not in metres: {}", args.map.display());
        let Tags { camera_lon_deg, camera_lat_deg, camera_height_m, .. } = self.tags;
        let camera = self.projection.map_from_lonlat(camera_lon_deg, camera_lat_deg)?;
        let heights = self.values.map(|&h| (f64::from(h) * self.scale()) as f32);
        // The heights stay relative to the camera: its own height is the origin's.
        let surface = SplatSurface::new(&heights, self.geotransform, [camera.x, camera.y, 0.0]);
        let picture = args.picture.as_deref().map(picture).transpose()?;
        let merged = args.merge.map(|error_m| DivisionConfig { error_m, ..DivisionConfig::default() });
        let splats = picture_splats(&surface, picture.as_ref(), self.confidence.as_ref(), merged)?;
        let origin = LocalOrigin::new(self.projection.definition(), "ellipsoid", [camera.x, camera.y, camera_height_m]);
        let layout = SplatLayout { form: SplatForm::Ellipsoids, sh_degree: 0 };
        io::splat_ply::write(&args.output, &splats, &origin, layout, args.overwrite)?;
        Ok(splats.len())
    }

    fn write_las(&self, args: &Args) -> anyhow::Result<usize> {
        let epsg = utm_epsg(self.tags.camera_lon_deg, self.tags.camera_lat_deg)?;
        let utm = MapProjection::from_epsg(epsg)?;
        let mut points = self.on_ground()?;
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p[0], p[1])).unzip();
        utm.map_from_lonlat_slices(&mut x, &mut y)?;
        for (point, (x, y)) in points.iter_mut().zip(x.into_iter().zip(y)) {
            *point = [x, y, point[2] + self.tags.camera_height_m];
        }
        write_las(&args.output, &points, Crs::ellipsoidal(epsg), args.overwrite)?;
        Ok(points.len())
    }
}

/// A picture in 0 to 1: bytes as they are, other samples stretched.
fn picture(path: &Path) -> anyhow::Result<Grid<[f32; 3]>> {
    let source = ImageSource::open(path)?;
    let colours = source.read_colour(source.window())?;
    Ok(match source.info().sample {
        SampleType::U8 => colours.map(|p| p.map(|c| c / 255.0)),
        _ => stretched(&colours),
    })
}
