//! The maps of every perspective view and their files.

use std::path::Path;

use ::priors::{DepthKind, MISSING_CLASS, NO_OBJECT, NormalFrame, PriorMaps, Rays};
use formats::npy::{self, NpyArray, NpyData};
use formats::raster::{Band, BandData, DepthScale, write_depth_png, write_map, write_png_gray, write_png_rgb};
use numeric::Progress;
use raster::{Grid, NO_DATA};
use report::{ViewPictures, ViewRow, depth_preview, mask_preview, normal_preview, side_by_side};

use super::dataset::Dataset;
use super::error::PriorsJobError;
use super::images;
use super::previews::{IN_PAGE, is_spread};
use job::files::{self, FileError};

/// Folders of maps.
const FOLDERS: [&str; 8] = ["raw_depth", "raw_normal", "raw_mask", "masks", "class", "object", "depth_png", "previews"];

/// The maps that were written.
#[derive(Debug)]
pub(super) struct WrittenMaps {
    pub(super) rows: Vec<ViewRow>,
    pub(super) pictures: Vec<ViewPictures>,
    /// Length of a step of the 16-bit depth maps.
    pub(super) depth_png_step: f64,
}

/// Renders and writes the maps of all views.
pub(super) fn write(
    dataset: &Dataset<'_>,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<WrittenMaps, PriorsJobError> {
    let pictures = dataset.pictures.map(|_| images::FOLDER);
    for name in FOLDERS.into_iter().chain(dataset.config.geotiff.then_some("geotiff")).chain(pictures) {
        files::create_folder(&folder.join(name))?;
        // Names with folders have them in every kind of map.
        for stem in &dataset.cameras.stems {
            if let Some((above, _)) = stem.rsplit_once('/') {
                files::create_folder(&folder.join(name).join(above))?;
            }
        }
    }
    let rays = dataset.cameras.model.lenses.iter().map(Rays::new).collect::<Result<Vec<_>, _>>()?;
    let count = dataset.views.len();
    let (mut rows, mut pictures) = (Vec::with_capacity(count), Vec::new());
    progress.begin("maps", 2 * count);
    for view in 0..count {
        progress.check_cancelled()?;
        let maps = render(dataset, view, &rays[dataset.cameras.model.views[view].lens]);
        write_view(dataset, folder, view, &maps)?;
        if let Some(pictures) = dataset.pictures {
            let crop = dataset.cameras.crops[dataset.cameras.model.views[view].lens];
            pictures.write(folder, view, &maps.mask(), crop)?;
        }
        pictures.extend(write_previews(dataset, folder, view, &maps)?);
        rows.push(row(dataset, view, &maps));
        progress.step();
    }
    let depth_png_step = write_depth_pngs(dataset, folder, &rows, progress)?;
    Ok(WrittenMaps { rows, pictures, depth_png_step })
}

/// Writes 16-bit depth maps of one step for all views, so that their values can be compared, and
/// returns the step.
fn write_depth_pngs(
    dataset: &Dataset<'_>,
    folder: &Path,
    rows: &[ViewRow],
    progress: &dyn Progress,
) -> Result<f64, PriorsJobError> {
    // The largest depth is known only after all views have been rendered.
    let largest = rows.iter().filter_map(|row| row.depth_range).map(|range| range[1]).fold(0.0, f32::max);
    let step = DepthScale::Fit.step_m(f64::from(largest)).ok_or(PriorsJobError::DepthScale)?;
    for stem in &dataset.cameras.stems {
        progress.check_cancelled()?;
        let path = folder.join("depth_png").join(format!("{stem}.png"));
        write_depth_png(path, &read_depth(folder, stem)?, DepthScale::Step(step), false).map_err(FileError::from)?;
        progress.step();
    }
    Ok(step)
}

/// Reads the depths of a view back from its file, because those of all views together may not fit
/// into memory.
fn read_depth(folder: &Path, stem: &str) -> Result<Grid<f32>, PriorsJobError> {
    let path = folder.join("raw_depth").join(format!("{stem}.npy"));
    let grid = match npy::read(&path)? {
        NpyArray { shape, data: NpyData::F32(depth) } if shape.len() == 2 => Grid::from_vec(shape[1], shape[0], depth),
        _ => None,
    };
    grid.ok_or(PriorsJobError::Disturbed { path })
}

/// Renders the maps of a view in the lengths and axes of the dataset.
fn render(dataset: &Dataset<'_>, view: usize, rays: &Rays) -> PriorMaps {
    let mut maps = PriorMaps::render(dataset.model, &dataset.views[view], rays, dataset.config.maps);
    let scale = dataset.frame.scale();
    if scale != 1.0 {
        maps.depth_m.data_mut().iter_mut().for_each(|d| *d = (f64::from(*d) * scale) as f32);
    }
    if dataset.config.maps.normals == NormalFrame::World && dataset.frame.turns() {
        let turned = |n: &mut [f32; 3]| *n = dataset.frame.turn(n.map(f64::from)).map(|c| c as f32);
        maps.normal.data_mut().iter_mut().for_each(turned);
    }
    maps
}

fn row(dataset: &Dataset<'_>, view: usize, maps: &PriorMaps) -> ViewRow {
    let depths = || maps.depth_m.data().iter().copied().filter(|d| d.is_finite());
    let range = [depths().fold(f32::INFINITY, f32::min), depths().fold(f32::NEG_INFINITY, f32::max)];
    let counts = dataset.visible.per_view[view];
    ViewRow {
        name: dataset.cameras.model.views[view].name.clone(),
        size: [maps.depth_m.width(), maps.depth_m.height()],
        hit_pixels: maps.hits(),
        depth_range: range[0].is_finite().then_some(range),
        candidates: counts.candidates,
        visible: counts.visible,
    }
}

/// Writes the preview pictures of a view that has some, and returns the pictures for the page of
/// the report.
fn write_previews(
    dataset: &Dataset<'_>,
    folder: &Path,
    view: usize,
    maps: &PriorMaps,
) -> Result<Option<ViewPictures>, FileError> {
    let (count, wanted) = (dataset.views.len(), dataset.config.previews);
    let in_page = is_spread(view, count, wanted.min(IN_PAGE));
    if !in_page && !is_spread(view, count, wanted) {
        return Ok(None);
    }
    let stem = &dataset.cameras.stems[view];
    let (depth, normals) = (depth_preview(&maps.depth_m), normal_preview(&maps.normal));
    let path = |what: &str| folder.join("previews").join(format!("{stem}_{what}.png"));
    write_png_rgb(path("depth"), &depth, false)?;
    write_png_rgb(path("normal"), &normals, false)?;
    let sheet = side_by_side(&[&depth, &normals, &mask_preview(&maps.mask())]);
    write_png_rgb(folder.join("previews").join(format!("{stem}.png")), &sheet, false)?;
    let pictures = || ViewPictures { name: stem.clone(), maps: vec![("depth", depth), ("normals", normals)] };
    Ok(in_page.then(pictures))
}

fn write_view(dataset: &Dataset<'_>, folder: &Path, view: usize, maps: &PriorMaps) -> Result<(), FileError> {
    let stem = &dataset.cameras.stems[view];
    let path = |kind: &str, ending: &str| folder.join(kind).join(format!("{stem}.{ending}"));
    let (width, height) = (maps.depth_m.width(), maps.depth_m.height());
    let shape = [height, width];
    let mask = maps.mask();
    let miss = dataset.config.miss.depth();
    let depth = maps.depth_m.map(|depth| if depth.is_finite() { *depth } else { miss });
    npy::write(path("raw_depth", "npy"), &shape, depth.data(), false).map_err(FileError::write)?;
    npy::write(path("raw_normal", "npy"), &[height, width, 3], maps.normal.data().as_flattened(), false)
        .map_err(FileError::write)?;
    npy::write(path("raw_mask", "npy"), &shape, mask.data(), false).map_err(FileError::write)?;
    npy::write(path("class", "npy"), &shape, maps.class.data(), false).map_err(FileError::write)?;
    npy::write(path("object", "npy"), &shape, maps.object.data(), false).map_err(FileError::write)?;
    write_png_gray(path("masks", "png"), &mask.map(|seen| if *seen { 255 } else { 0 }), false)?;
    if dataset.config.geotiff { write_geotiffs(dataset, &folder.join("geotiff"), stem, maps) } else { Ok(()) }
}

fn write_geotiffs(dataset: &Dataset<'_>, folder: &Path, stem: &str, maps: &PriorMaps) -> Result<(), FileError> {
    let path = |what: &str| folder.join(format!("{stem}_{what}.tif"));
    let depth = maps.depth_m.map(|d| if d.is_finite() { *d } else { f32::NAN });
    let kind = match dataset.config.maps.depth {
        DepthKind::ZDepth => "z-depth",
        DepthKind::RayLength => "ray length",
    };
    let no_data = Some(f64::from(NO_DATA));
    let bands = [Band { description: "depth", data: BandData::F32(&depth) }];
    write_map(path("depth"), &bands, no_data, &[("DEPTH_KIND", kind)], false)?;
    let component = |i: usize| maps.normal.map(|n| n[i]);
    let components = [component(0), component(1), component(2)];
    let names = ["normal_x", "normal_y", "normal_z"];
    let bands: Vec<Band<'_>> =
        names.iter().zip(&components).map(|(&description, c)| Band { description, data: BandData::F32(c) }).collect();
    write_map(path("normal"), &bands, no_data, &[], false)?;
    let class = [Band { description: "surface_class", data: BandData::U8(&maps.class) }];
    write_map(path("class"), &class, Some(f64::from(MISSING_CLASS)), &[], false)?;
    let object = [Band { description: "object_number", data: BandData::U32(&maps.object) }];
    write_map(path("object"), &object, Some(f64::from(NO_OBJECT)), &[], false)?;
    Ok(())
}
