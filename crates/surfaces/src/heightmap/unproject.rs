//! Turns a height map back into points or Gaussian splats.

use std::path::Path;

use crs::{Crs, MapProjection};
use formats::ply::{PlyPoint, write_points};
use formats::points::write_las;
use formats::raster::{ImageSource, SampleType};
use formats::splat_ply::{LocalOrigin, SplatForm, SplatLayout};
use geodesy::{LonLatHeight, TransverseMercator, utm_epsg};
use heightmap::{camera_points, map_points};
use numeric::Progress;
use raster::{GeoTransform, Grid};
use splats::{DivisionConfig, SplatSurface, picture_splats, stretched};

use super::error::HeightMapJobError;
use super::tags::HeightMapTags;
use super::unproject_config::{PointAxes, UnprojectConfig, UnprojectReport};
use job::error::JobError;
use job::files::FileError;

/// Most pixels of a map that are read.
const CELLS_MAX: usize = 1 << 28;

/// Colour of points: a height map has no colours.
const GREY: [u8; 3] = [128; 3];

/// Turns a height map back into points or Gaussian splats.
///
/// # Errors
/// [`JobError`]: a file that is not a height map, an unknown ending of the output, an
/// output that exists.
///
/// ```
/// use surfaces::camera_stand::{StandConfig, StandSource};
/// use surfaces::heightmap::{HeightMapConfig, UnprojectConfig, run, unproject};
/// use numeric::Silent;
///
/// let dsm = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/truth/dsm.tif");
/// let folder = tempfile::tempdir()?;
/// let map = folder.path().join("map.tif");
/// let stand = StandConfig::new(StandSource::Position { lon_deg: 5.4, lat_deg: 43.53 });
/// let mut config = HeightMapConfig::new(dsm.into(), map.clone(), stand);
/// config.size_px = 32;
/// run(&config, &Silent)?;
/// let report = unproject(&UnprojectConfig::new(map, folder.path().join("points.ply")), &Silent)?;
/// assert_eq!(report.points, Some(32 * 32));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn unproject(config: &UnprojectConfig, progress: &dyn Progress) -> Result<UnprojectReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &UnprojectConfig, progress: &dyn Progress) -> Result<UnprojectReport, HeightMapJobError> {
    config.validate()?;
    progress.begin("unproject", 1);
    let map = HeightMapFile::read(&config.map)?;
    progress.check_cancelled()?;
    let ending = config.ending();
    let count = match ending.as_str() {
        "ply" if config.splats => map.write_splats(config)?,
        "ply" => map.write_ply(config)?,
        _ => map.write_las(config)?,
    };
    progress.step();
    let (points, splats) = if config.splats { (None, Some(count)) } else { (Some(count), None) };
    Ok(UnprojectReport { path: config.output.clone(), points, splats, camera: map.tags })
}

/// A height map as its file holds it.
struct HeightMapFile {
    tags: HeightMapTags,
    /// Values in the unit of the file; NaN where there is none.
    values: Grid<f32>,
    /// Confidences, if the map has them.
    confidence: Option<Grid<f32>>,
    geotransform: GeoTransform,
    projection: MapProjection,
}

impl HeightMapFile {
    fn read(path: &Path) -> Result<Self, HeightMapJobError> {
        let tags = HeightMapTags::read(path)?;
        let source = ImageSource::open(path)?;
        let (cells, info) = (source.window(), source.info());
        if cells.width.saturating_mul(cells.height) > CELLS_MAX {
            let (width, height) = (cells.width, cells.height);
            return Err(HeightMapJobError::TooLarge { path: path.to_owned(), width, height });
        }
        let no_place = |missing| HeightMapJobError::NoPlace { path: path.to_owned(), missing };
        let geotransform = info.geotransform.ok_or_else(|| no_place("georeference"))?;
        let crs = info.crs_wkt.as_deref().ok_or_else(|| no_place("coordinate system"))?;
        let values = source.read_samples(1, cells)?;
        let confidence = if info.bands > 1 { Some(source.read_samples(2, cells)?) } else { None };
        Ok(Self { tags, values, confidence, geotransform, projection: MapProjection::from_definition(crs)? })
    }

    /// Returns the metres per unit of the values.
    fn scale(&self) -> f64 {
        if self.tags.normalized { self.tags.scene_scale_m } else { 1.0 }
    }

    /// Returns longitude, latitude (degrees) and height relative to the camera (metres) of every
    /// point.
    fn on_ground(&self) -> Result<Vec<[f64; 3]>, HeightMapJobError> {
        let mut points = map_points(&self.values, &self.geotransform, self.scale());
        let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p[0], p[1])).unzip();
        let lost = self.projection.lonlat_from_map_slices(&mut lon, &mut lat)?;
        if lost > 0 {
            return Err(HeightMapJobError::PixelsOutside { lost });
        }
        for (point, (lon, lat)) in points.iter_mut().zip(lon.into_iter().zip(lat)) {
            (point[0], point[1]) = (lon, lat);
        }
        Ok(points)
    }

    fn write_ply(&self, config: &UnprojectConfig) -> Result<usize, HeightMapJobError> {
        let HeightMapTags { camera_lon_deg, camera_lat_deg, camera_height_m, resolution_px_per_m, .. } = self.tags;
        let local = TransverseMercator::local(LonLatHeight::new(camera_lon_deg, camera_lat_deg, camera_height_m))?;
        let (points, axes) = match config.axes {
            PointAxes::Camera => {
                (camera_points(&self.values, resolution_px_per_m, self.scale()), "right, back, up of the camera")
            }
            PointAxes::World => {
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
        let points = points.into_iter().map(plain);
        write_points(&config.output, points, &comments, config.overwrite).map_err(FileError::from)?;
        if config.axes == PointAxes::World {
            let origin = LocalOrigin::new(local.wkt(), "ellipsoid", [0.0, 0.0, camera_height_m]);
            origin.write_beside(&config.output, config.overwrite).map_err(FileError::from)?;
        }
        Ok(count)
    }

    /// Writes splats along the axes of the map, relative to the camera.
    fn write_splats(&self, config: &UnprojectConfig) -> Result<usize, HeightMapJobError> {
        if self.projection.metres_per_unit() != Some(1.0) {
            return Err(HeightMapJobError::NotInMetres { path: config.map.clone() });
        }
        let HeightMapTags { camera_lon_deg, camera_lat_deg, camera_height_m, .. } = self.tags;
        let camera = self.projection.map_from_lonlat(camera_lon_deg, camera_lat_deg)?;
        let heights = self.values.map(|&h| (f64::from(h) * self.scale()) as f32);
        // The heights stay relative to the camera, whose height becomes the height of the origin.
        let surface = SplatSurface::new(&heights, self.geotransform, [camera.x, camera.y, 0.0]);
        let picture = config.picture.as_deref().map(picture).transpose()?;
        let merged = config.merge_m.map(|error_m| DivisionConfig { error_m, ..DivisionConfig::default() });
        let splats = picture_splats(&surface, picture.as_ref(), self.confidence.as_ref(), merged)?;
        let origin = LocalOrigin::new(self.projection.definition(), "ellipsoid", [camera.x, camera.y, camera_height_m]);
        let layout = SplatLayout { form: SplatForm::Ellipsoids, sh_degree: 0 };
        formats::splat_ply::write(&config.output, &splats, &origin, layout, config.overwrite)
            .map_err(FileError::from)?;
        Ok(splats.len())
    }

    fn write_las(&self, config: &UnprojectConfig) -> Result<usize, HeightMapJobError> {
        let epsg = utm_epsg(self.tags.camera_lon_deg, self.tags.camera_lat_deg)?;
        let utm = MapProjection::from_epsg(epsg)?;
        let mut points = self.on_ground()?;
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p[0], p[1])).unzip();
        utm.map_from_lonlat_slices(&mut x, &mut y)?;
        for (point, (x, y)) in points.iter_mut().zip(x.into_iter().zip(y)) {
            *point = [x, y, point[2] + self.tags.camera_height_m];
        }
        write_las(&config.output, &points, Crs::ellipsoidal(epsg), config.overwrite).map_err(FileError::from)?;
        Ok(points.len())
    }
}

/// Reads a picture with values from 0 to 1: bytes are divided by 255, other samples are stretched.
fn picture(path: &Path) -> Result<Grid<[f32; 3]>, HeightMapJobError> {
    let source = ImageSource::open(path)?;
    let colours = source.read_colour(source.window())?;
    Ok(match source.info().sample {
        SampleType::U8 => colours.map(|p| p.map(|c| c / 255.0)),
        _ => stretched(&colours),
    })
}
