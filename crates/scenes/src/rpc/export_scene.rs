//! What the images of an export share: their pointing corrections, the range of heights and the
//! ground that they are cut to.

use std::path::{Path, PathBuf};

use crs::{HeightConverter, MapProjection, VerticalDatum};
use formats::raster::{RasterError, read_dem};
use numeric::Progress;

use super::error::RpcJobError;
use job::corrections::{CorrectionSource, Corrections};
use job::image_files::image_files;
use job::run_folder::surface_file;

/// Metres by which the range of heights reaches beyond the surface, as in Sat-NeRF's own datasets.
const BEYOND_M: f64 = 1.0;

/// Images with what they share.
pub(super) struct Scene {
    /// The images, by name.
    pub(super) images: Vec<PathBuf>,
    /// Their pointing corrections.
    pub(super) corrections: Corrections,
    /// Lowest and highest height above the ellipsoid, metres.
    pub(super) height_range_m: [f64; 2],
    /// Corners of the ground, longitude and latitude; none when the images stay whole.
    pub(super) outline_deg: Vec<[f64; 2]>,
}

/// Finds the images and what they share.
pub(super) fn scene_of(
    inputs: &[PathBuf],
    height_range_m: Option<[f64; 2]>,
    progress: &dyn Progress,
) -> Result<Scene, RpcJobError> {
    let run = match inputs {
        [one] if surface_file(one) != *one => Some(one.as_path()),
        _ => None,
    };
    let (mut images, corrections, ground) = match run {
        Some(run) => {
            let images = Corrections::images_of_run(run)?;
            (images, Corrections::for_surface(run, &CorrectionSource::SurfaceRun)?, Some(ground_of(run, progress)?))
        }
        None => (image_files(inputs)?, Corrections::default(), None),
    };
    if images.is_empty() {
        return Err(RpcJobError::NoImages);
    }
    images.sort_by(|a, b| a.file_name().cmp(&b.file_name()).then_with(|| a.cmp(b)));
    let (found, outline_deg) = ground.map_or((None, Vec::new()), |(range, outline)| (Some(range), outline));
    let height_range_m = height_range_m.or(found).ok_or(RpcJobError::NoHeights)?;
    Ok(Scene { images, corrections, height_range_m, outline_deg })
}

/// Returns the range of heights of a run's surface model and its corners.
fn ground_of(run: &Path, progress: &dyn Progress) -> Result<([f64; 2], Vec<[f64; 2]>), RpcJobError> {
    let dem = read_dem(surface_file(run))?;
    let path = dem.path.clone();
    let fails = |source| RpcJobError::Image(RasterError::Crs { path: path.clone(), source });
    let definition = dem.horizontal_epsg.map(|code| format!("EPSG:{code}")).or_else(|| dem.crs_wkt.clone());
    let projection = MapProjection::from_definition(&definition.unwrap_or_default()).map_err(fails)?;
    let (width, height) = (dem.heights.width() as f64, dem.heights.height() as f64);
    let mut outline = Vec::new();
    for (column, row) in [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)] {
        let (x, y) = dem.geotransform.map_from_cell(column - 0.5, row - 0.5);
        let (lon, lat) = projection.lonlat_from_map(x, y).map_err(fails)?;
        outline.push([lon, lat]);
    }
    let known = dem.heights.data().iter().copied().filter(|height| height.is_finite()).map(f64::from);
    let mut range = known.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| [low.min(h), high.max(h)]);
    if range[0] > range[1] {
        return Err(RpcJobError::NoHeights);
    }
    if let Some(datum) = dem.vertical.filter(|datum| *datum != VerticalDatum::Ellipsoid) {
        // The geoid is flat over a scene compared with the metre that is added.
        let (lon, lat) = ([outline[0][0]; 2], [outline[0][1]; 2]);
        let converter = HeightConverter::new(datum).map_err(fails)?;
        converter.ellipsoid_from_datum_slices(&lon, &lat, &mut range).map_err(fails)?;
        progress.warn("the heights of the surface model were brought to the ellipsoid, which RPCs use");
    }
    Ok(([(range[0] - BEYOND_M).round(), (range[1] + BEYOND_M).round()], outline))
}
