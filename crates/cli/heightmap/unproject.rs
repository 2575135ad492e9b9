//! `skysweep heightmap unproject`: a height map back as points.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use bev::heightmap::{camera_points, map_points};
use clap::ValueEnum;
use geodesy::{Crs, LonLatHeight, MapProjection, TransverseMercator, utm_epsg};
use io::ply::{PlyPoint, write_points};
use io::points::write_las;
use io::raster::ImageSource;
use io::splat_ply::LocalOrigin;
use raster::{GeoTransform, Grid};
use serde_json::json;

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
    /// Axes of a PLY.
    #[arg(long, value_enum, default_value_t = Frame::World)]
    frame: Frame,
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
        "ply" => map.write_ply(args)?,
        "las" | "laz" => map.write_las(args)?,
        _ => bail!("no format belongs to the ending of {}: expected .ply, .las or .laz", args.output.display()),
    };
    if args.json {
        print::json(&json!({ "path": args.output, "points": points, "camera": map.tags }))?;
    } else if !global.is_quiet() {
        print::text(&format!("points  {points}\nfile    {}\n", args.output.display()))?;
    }
    Ok(Outcome::Complete)
}

/// A height map as its file has it.
struct Map {
    tags: Tags,
    /// As they stand in the file, NaN where there is none.
    values: Grid<f32>,
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
        Ok(Self { tags, values, geotransform, projection: MapProjection::from_definition(crs)? })
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
