//! The maps of every view into their files.

use std::fs;
use std::path::Path;

use ::priors::{DepthKind, PriorMaps, Rays};
use anyhow::{Context, bail};
use io::npy::{self, NpyArray, NpyData};
use io::raster::{Band, BandData, DepthScale, write_depth_png, write_map, write_png_gray, write_png_rgb};
use numeric::Progress as _;
use raster::{Grid, NO_DATA};
use report::{ViewPictures, ViewRow, depth_preview, mask_preview, normal_preview, side_by_side};

use super::content::Dataset;
use super::options::Normals;
use crate::progress::Watcher;

/// Folders of maps.
const FOLDERS: [&str; 8] = ["raw_depth", "raw_normal", "raw_mask", "masks", "class", "object", "depth_png", "previews"];
/// Views that the page shows.
pub(super) const IN_PAGE: usize = 6;

/// What was written.
#[derive(Debug)]
pub(super) struct Written {
    pub(super) rows: Vec<ViewRow>,
    pub(super) pictures: Vec<ViewPictures>,
    /// Length of a step of the 16-bit maps.
    pub(super) depth_png_step: f64,
}

/// Renders and writes the maps of all views.
pub(super) fn write(dataset: &Dataset<'_>, folder: &Path, watcher: &Watcher) -> anyhow::Result<Written> {
    for name in FOLDERS.into_iter().chain(dataset.args.geotiff.then_some("geotiff")) {
        let path = folder.join(name);
        fs::create_dir_all(&path).with_context(|| format!("cannot make the folder: {}", path.display()))?;
    }
    let rays = dataset.cameras.model.lenses.iter().map(Rays::new).collect::<Result<Vec<_>, _>>()?;
    let render = |view: usize| dataset.render(view, &rays[dataset.cameras.model.views[view].lens]);
    let count = dataset.views.len();
    let (mut rows, mut pictures) = (Vec::with_capacity(count), Vec::new());
    watcher.begin("maps", 2 * count);
    for view in 0..count {
        let maps = render(view);
        write_view(dataset, folder, view, &maps)?;
        let in_folder = spread(view, count, dataset.args.previews);
        let in_page = spread(view, count, dataset.args.previews.min(IN_PAGE));
        if in_folder || in_page {
            let stem = &dataset.cameras.stems[view];
            let (depth, normals) = (depth_preview(&maps.depth_m), normal_preview(&maps.normal));
            let path = |what: &str| folder.join("previews").join(format!("{stem}_{what}.png"));
            write_png_rgb(path("depth"), &depth, false)?;
            write_png_rgb(path("normal"), &normals, false)?;
            let sheet = side_by_side(&[&depth, &normals, &mask_preview(&maps.mask())]);
            write_png_rgb(folder.join("previews").join(format!("{stem}.png")), &sheet, false)?;
            if in_page {
                pictures.push(ViewPictures { name: stem.clone(), maps: vec![("depth", depth), ("normals", normals)] });
            }
        }
        rows.push(row(dataset, view, &maps));
        watcher.step();
    }
    // One step for all views, so that their values can be compared; the largest depth is known only now.
    let largest = rows.iter().filter_map(|row| row.depth_range).map(|range| range[1]).fold(0.0, f32::max);
    let step = DepthScale::Fit.step_m(f64::from(largest)).context("the depths are too large for 16-bit maps")?;
    for stem in &dataset.cameras.stems {
        let path = folder.join("depth_png").join(format!("{stem}.png"));
        write_depth_png(path, &read_depth(folder, stem)?, DepthScale::Step(step), false)?;
        watcher.step();
    }
    Ok(Written { rows, pictures, depth_png_step: step })
}

/// The depths of a view as they were written: all together are too many to be kept.
fn read_depth(folder: &Path, stem: &str) -> anyhow::Result<Grid<f32>> {
    let path = folder.join("raw_depth").join(format!("{stem}.npy"));
    match npy::read(&path)? {
        NpyArray { shape, data: NpyData::F32(depth) } if shape.len() == 2 => {
            Grid::from_vec(shape[1], shape[0], depth).with_context(|| format!("cannot use {}", path.display()))
        }
        _ => bail!("someone else wrote to the output folder: {}", path.display()),
    }
}

/// Whether a view is one of `wanted` that are spread over all.
pub(super) fn spread(view: usize, count: usize, wanted: usize) -> bool {
    let wanted = wanted.min(count);
    wanted > 0 && (view == 0 || view * wanted / count != (view - 1) * wanted / count)
}

impl Dataset<'_> {
    /// The maps of a view in the lengths and the axes of the dataset.
    fn render(&self, view: usize, rays: &Rays) -> PriorMaps {
        let mut maps = PriorMaps::render(self.model, &self.views[view], rays, self.args.map_config());
        let scale = self.frame.scale();
        if scale != 1.0 {
            maps.depth_m.data_mut().iter_mut().for_each(|d| *d = (f64::from(*d) * scale) as f32);
        }
        if self.args.normals == Normals::World && self.frame.turns() {
            let turned = |n: &mut [f32; 3]| *n = self.frame.turn(n.map(f64::from)).map(|c| c as f32);
            maps.normal.data_mut().iter_mut().for_each(turned);
        }
        maps
    }
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

fn write_view(dataset: &Dataset<'_>, folder: &Path, view: usize, maps: &PriorMaps) -> anyhow::Result<()> {
    let stem = &dataset.cameras.stems[view];
    let path = |kind: &str, ending: &str| folder.join(kind).join(format!("{stem}.{ending}"));
    let (width, height) = (maps.depth_m.width(), maps.depth_m.height());
    let mask = maps.mask();
    npy::write(path("raw_depth", "npy"), &[height, width], maps.depth_m.data(), false)?;
    npy::write(path("raw_normal", "npy"), &[height, width, 3], maps.normal.data().as_flattened(), false)?;
    npy::write(path("raw_mask", "npy"), &[height, width], mask.data(), false)?;
    npy::write(path("class", "npy"), &[height, width], maps.class.data(), false)?;
    npy::write(path("object", "npy"), &[height, width], maps.object.data(), false)?;
    write_png_gray(path("masks", "png"), &mask.map(|seen| if *seen { 255 } else { 0 }), false)?;
    if dataset.args.geotiff { write_geotiffs(dataset, &folder.join("geotiff"), stem, maps) } else { Ok(()) }
}

fn write_geotiffs(dataset: &Dataset<'_>, folder: &Path, stem: &str, maps: &PriorMaps) -> anyhow::Result<()> {
    let path = |what: &str| folder.join(format!("{stem}_{what}.tif"));
    let depth = maps.depth_m.map(|d| if d.is_finite() { *d } else { f32::NAN });
    let kind = match dataset.args.map_config().depth {
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
    write_map(path("class"), &class, Some(f64::from(::priors::MISSING_CLASS)), &[], false)?;
    let object = [Band { description: "object_number", data: BandData::U32(&maps.object) }];
    write_map(path("object"), &object, Some(f64::from(::priors::NO_OBJECT)), &[], false)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::spread;

    #[test]
    fn pictures_are_spread_over_the_views() {
        for (count, wanted, expected) in [(10, 3, 3), (5, 12, 5), (100, 6, 6), (1, 1, 1), (7, 0, 0)] {
            let chosen = (0..count).filter(|&view| spread(view, count, wanted)).count();
            assert_eq!(chosen, expected, "{wanted} of {count}");
        }
        assert!(spread(0, 10, 3));
    }
}
