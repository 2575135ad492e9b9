//! The depth maps of a dataset's cameras, and their colours.

use std::path::Path;

use ::train::{Drawing, PinholeView, Registers, Surfel};
use camera::{Lens, LensModel};
use formats::colmap::{ColmapModel, ColmapView};
use formats::npy::{self, NpyData};
use formats::raster::ImageSource;
use numeric::Progress;
use raster::Grid;

use super::config::{DepthSource, MeshJobConfig};
use super::error::MeshJobError;
use crate::small_view::pinhole;
use crate::train::DatasetPlace;

/// Coverage by splats above which a pixel has a depth.
const COVERED: f32 = 0.5;

/// A camera with its depth map.
pub(super) struct CameraDepths {
    pub(super) lens: Lens,
    pub(super) view: ColmapView,
    pub(super) depth_m: Grid<f32>,
    pub(super) colour: Option<Grid<[f32; 3]>>,
}

/// Reads or draws the depth maps of all cameras that have one. Cameras are in the frame of `place`.
pub(super) fn read(
    config: &MeshJobConfig,
    model: &ColmapModel,
    place: &DatasetPlace,
    progress: &dyn Progress,
) -> Result<Vec<CameraDepths>, MeshJobError> {
    let mut source = match &config.depths {
        DepthSource::Splats(path) => Source::Splats(splats(path, place)?),
        DepthSource::Maps(folder) => Source::Maps(folder),
    };
    let mut out = Vec::new();
    progress.begin("depth maps", model.views.len());
    for view in &model.views {
        progress.check_cancelled()?;
        let lens = &model.lenses[view.lens];
        let made = match &mut source {
            Source::Splats(surfels) => Some(drawn(config, view, lens, surfels)?),
            Source::Maps(folder) => map(config, view, lens, folder)?,
        };
        if let Some(mut made) = made {
            if config.masked {
                mask(config, &mut made)?;
            }
            out.push(made);
        }
        progress.step();
    }
    match (&config.depths, out.is_empty()) {
        (DepthSource::Maps(folder), true) => {
            Err(MeshJobError::NoMaps { cameras: model.views.len(), folder: folder.clone() })
        }
        _ => Ok(out),
    }
}

enum Source<'a> {
    Splats(Vec<Surfel>),
    Maps(&'a Path),
}

/// Reads splats into the frame of a dataset. Without an origin they are in it already.
fn splats(path: &Path, place: &DatasetPlace) -> Result<Vec<Surfel>, MeshJobError> {
    let file = formats::splat_files::read(path)?;
    let from = file.origin.map_or(place.origin.origin, |origin| origin.origin);
    let shift = [0, 1, 2].map(|i| (from[i] - place.origin.origin[i]) as f32);
    let moved = |splat: &gaussian::Splat| {
        let surfel = Surfel::of_splat(splat);
        Surfel { position: [0, 1, 2].map(|i| surfel.position[i] + shift[i]), ..surfel }
    };
    Ok(file.splats.iter().map(moved).collect())
}

/// Draws splats through a camera.
fn drawn(
    config: &MeshJobConfig,
    view: &ColmapView,
    lens: &Lens,
    surfels: &[Surfel],
) -> Result<CameraDepths, MeshJobError> {
    let refused = || MeshJobError::Lens { name: view.name.clone(), model: lens.model().name() };
    let camera: PinholeView = pinhole(view, lens, config.shrink).ok_or_else(refused)?;
    let drawing = Drawing::new(surfels, &camera, Registers::Longest);
    let images = drawing.images();
    let [width, height] = camera.size;
    let most_spread = config.truncation_m.unwrap_or(4.0 * config.voxel_m) as f32;
    let depth = |pixel: usize| {
        let coverage = images.coverage[pixel];
        // Where splats of a ray lie apart, their mean depth is on none of them.
        let spread = images.distortion[pixel].max(0.0).sqrt() / coverage;
        if coverage > COVERED && spread < most_spread { images.depth_m[pixel] / coverage } else { f32::NAN }
    };
    let colour = |pixel: usize| images.colour.each_ref().map(|plane| plane[pixel] / images.coverage[pixel]);
    let ([fx, fy], [cx, cy]) = (camera.focal_px, camera.principal_px);
    let small = Lens::new(width, height, LensModel::Pinhole, &[fx, fy, cx, cy]).map_err(|_| refused())?;
    Ok(CameraDepths {
        lens: small,
        view: view.clone(),
        depth_m: grid(width, height, depth),
        colour: Some(grid(width, height, colour)),
    })
}

/// Reads the map of a camera, where there is one.
fn map(
    config: &MeshJobConfig,
    view: &ColmapView,
    lens: &Lens,
    folder: &Path,
) -> Result<Option<CameraDepths>, MeshJobError> {
    let path = folder.join(Path::new(&view.name).with_extension("npy"));
    if !path.is_file() {
        return Ok(None);
    }
    let expected = [lens.width(), lens.height()];
    let values = numbers(&path, expected)?;
    let depth_m = grid(expected[0], expected[1], |pixel| values[pixel]);
    let colour = match &config.images {
        Some(images) => {
            let path = images.join(&view.name);
            let source = ImageSource::open(&path)?;
            let pixels = source.read_colour(source.window())?;
            let found = [pixels.width(), pixels.height()];
            if found != expected {
                return Err(MeshJobError::Size { path, found: found.to_vec(), expected });
            }
            let brightest = pixels.data().iter().flatten().copied().fold(0.0f32, f32::max);
            let white = if brightest > 255.0 { 65_535.0 } else { 255.0 };
            Some(pixels.map(|p| p.map(|c| c / white)))
        }
        None => None,
    };
    Ok(Some(CameraDepths { lens: lens.clone(), view: view.clone(), depth_m, colour }))
}

/// Leaves out the depths where the mask of the dataset shows nothing.
fn mask(config: &MeshJobConfig, made: &mut CameraDepths) -> Result<(), MeshJobError> {
    let name = &made.view.name;
    let path = config.dataset.join("raw_mask").join(Path::new(name).with_extension("npy"));
    if !path.is_file() {
        return Err(MeshJobError::NoMask { name: name.clone(), path });
    }
    let (width, height) = (made.depth_m.width(), made.depth_m.height());
    let shrink = if matches!(config.depths, DepthSource::Splats(_)) { config.shrink } else { 1 };
    let size = npy::read(&path)?.shape;
    let full = [size.get(1).copied().unwrap_or(0), size.first().copied().unwrap_or(0)];
    if full.map(|s| s / shrink) != [width, height] {
        return Err(MeshJobError::Size { path, found: size, expected: [width * shrink, height * shrink] });
    }
    let values = numbers(&path, full)?;
    for (pixel, depth) in made.depth_m.data_mut().iter_mut().enumerate() {
        let [x, y] = [pixel % width, pixel / width].map(|c| c * shrink + shrink / 2);
        if values[y * full[0] + x] <= 0.0 {
            *depth = f32::NAN;
        }
    }
    Ok(())
}

fn grid<T: Clone>(width: usize, height: usize, value: impl Fn(usize) -> T) -> Grid<T> {
    Grid::from_vec(width, height, (0..width * height).map(value).collect()).expect("as many values as pixels")
}

/// Reads an array of one value for each pixel.
fn numbers(path: &Path, expected: [usize; 2]) -> Result<Vec<f32>, MeshJobError> {
    let array = npy::read(path)?;
    if array.shape != [expected[1], expected[0]] {
        return Err(MeshJobError::Size { path: path.to_owned(), found: array.shape, expected });
    }
    Ok(match array.data {
        NpyData::F32(values) => values,
        other => other.to_f64().into_iter().map(|v| v as f32).collect(),
    })
}
