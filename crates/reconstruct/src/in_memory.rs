//! Heights and surfaces of views that are in memory: what a run does, without its files.
//!
//! The views and sources are chosen as a run chooses them, from the geometry of the cameras alone.
//! The cameras are taken as they are: nothing corrects their pointing.

use camera::RpcCamera;
use numeric::Progress;
use raster::{Grid, Window};
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::{HeightMap, SweepView};

use crate::error::ReconstructError;
use crate::grid::DsmGrid;
use crate::planning::levels::{choose_levels, height_step_m, smallest_sides};
use crate::planning::sources::{SourceCandidates, widest_parallax};
use crate::planning::view_geometry::{ImageGeometry, ViewGeometry};
use crate::scene_sweep::{SceneSweep, sweep_scene};
use crate::surface::fill::Fill;
use crate::surface::make::{SurfaceCounts, SurfaceInput, SurfaceOptions, make_surface};
use crate::surface::rasters::SurfaceRasters;
use crate::tuning::Preset;
use crate::values::{HeightRange, ImagePair};

/// An image in memory with its camera.
#[derive(Debug, Clone)]
pub struct ViewImage {
    /// Camera in the frame of the whole image.
    pub camera: RpcCamera,
    /// Grey values, counts of a sensor; NaN where there is none.
    pub pixels: Grid<f32>,
}

/// Heights of a view that is in memory, on the pixels of pyramid level [`ViewHeights::level`].
#[derive(Debug, Clone)]
pub struct ViewHeights {
    /// Level: each halves the image, and 0 is the full resolution.
    pub level: usize,
    /// Positions of the views that it was compared with, the best first.
    pub sources: Vec<usize>,
    /// Heights relative to [`HeightMap::origin_m`], deviations, and what supports them.
    pub map: HeightMap,
    /// Number of sources that confirm the height of each pixel.
    pub agreeing: Grid<u8>,
}

/// Computes the heights of views from one another. A view without a partner has NaN everywhere.
///
/// # Errors
/// [`ReconstructError::TooFewViews`], [`ReconstructError::Range`] for a range off the Earth,
/// [`ReconstructError::NoOverlap`], [`ReconstructError::NoParallax`], [`ReconstructError::Camera`],
/// [`ReconstructError::Sweep`], [`ReconstructError::Cancelled`].
pub fn sweep_views(
    images: Vec<ViewImage>,
    range: HeightRange,
    preset: Preset,
    progress: &dyn Progress,
) -> Result<Vec<ViewHeights>, ReconstructError> {
    let MemoryScene { views, sweep, .. } = MemoryScene::of(images, range, preset)?;
    let maps = sweep_scene(&views, &sweep, progress)?.maps;
    confirmed(&views, sweep, maps)
}

/// Computes the surface of views on a grid.
///
/// # Errors
/// Those of [`sweep_views`], and [`ReconstructError::Crs`] for a CRS that PROJ does not know.
///
/// ```no_run
/// use numeric::Silent;
/// use raster::GeoTransform;
/// use reconstruct::{DsmGrid, Fill, HeightRange, Preset, ViewImage, surface_of_views};
///
/// # fn read() -> Vec<ViewImage> { Vec::new() }
/// let images: Vec<ViewImage> = read();
/// let geotransform = GeoTransform([500_000.0, 0.5, 0.0, 4_800_000.0, 0.0, -0.5]);
/// let grid = DsmGrid { epsg: 32631, geotransform, size: (400, 300), gsd_m: 0.5 };
/// let range = HeightRange::new(170.0, 280.0);
/// let (preset, fill) = (Preset::Balanced, Fill::Justified);
/// let (rasters, counts) = surface_of_views(images, &grid, range, preset, fill, &Silent)?;
/// let first_m = rasters.origin_m + f64::from(rasters.height_m[(0, 0)]);
/// println!("{} cells observed, the first one at {first_m} m", counts.cells.observed);
/// # Ok::<(), reconstruct::ReconstructError>(())
/// ```
pub fn surface_of_views(
    images: Vec<ViewImage>,
    grid: &DsmGrid,
    range: HeightRange,
    preset: Preset,
    fill: Fill,
    progress: &dyn Progress,
) -> Result<(SurfaceRasters, SurfaceCounts), ReconstructError> {
    let MemoryScene { views, mut sweep, useful, pixel_m } = MemoryScene::of(images, range, preset)?;
    sweep.lattices_px = preset.tuning().lattices_px();
    let heights = sweep_scene(&views, &sweep, progress)?;
    let input = SurfaceInput {
        options: SurfaceOptions { fill, height_range: Some(range), tile: SurfaceOptions::USUAL_TILE },
        sweep: &sweep,
        useful: &useful,
        grid,
        pixel_m,
        // Without tie points nothing is known of it.
        camera_m: 0.0,
        core: grid.whole(),
        mask: None,
    };
    make_surface(input, views, heights, progress)
}

/// Views in memory, and the sweep that a run would choose for them.
struct MemoryScene {
    views: Vec<SweepView>,
    sweep: SceneSweep,
    /// Pairs of views that look from different directions.
    useful: Vec<ImagePair>,
    /// Side of a pixel of the coarsest image on the ground, metres.
    pixel_m: f64,
}

impl MemoryScene {
    fn of(images: Vec<ViewImage>, range: HeightRange, preset: Preset) -> Result<Self, ReconstructError> {
        if images.len() < 2 {
            return Err(ReconstructError::TooFewViews { found: images.len() });
        }
        if !range.is_on_earth() {
            return Err(ReconstructError::Range { range });
        }
        let tuning = preset.tuning();
        let size = |image: &ViewImage| (image.pixels.width(), image.pixels.height());
        let described: Vec<ImageGeometry<'_>> =
            images.iter().map(|image| ImageGeometry { camera: &image.camera, size: size(image) }).collect();
        let geometry = ViewGeometry::at(&described, range.middle_m())?;
        let useful = geometry.useful_pairs()?;
        let unmatched = useful.iter().map(|pair| (pair.ordered(), 0)).collect();
        let sources = SourceCandidates::of(&geometry, &unmatched, None, &tuning).choose_everywhere();
        let pixel_m = geometry.coarsest_sampling_m(images.iter().map(|image| &image.camera));
        let step_m = height_step_m(widest_parallax(&sources, &geometry), &tuning);
        let windows: Vec<Window> = described.iter().map(|image| Window::whole(image.size.0, image.size.1)).collect();
        let levels = choose_levels(range, step_m, &smallest_sides(&windows), &tuning);
        let views = images.into_iter().map(|image| SweepView::new(image.camera, image.pixels)).collect();
        Ok(Self { views, sweep: SceneSweep::new(range, step_m, levels, sources, &tuning), useful, pixel_m })
    }
}

/// Counts, for each height, the sources that confirm it.
fn confirmed(
    views: &[SweepView],
    sweep: SceneSweep,
    maps: Vec<HeightMap>,
) -> Result<Vec<ViewHeights>, ReconstructError> {
    let level = sweep.levels.finest;
    let heights: Vec<Heights<'_>> =
        maps.iter().enumerate().map(|(index, map)| Heights { index, view: &views[index], map }).collect();
    let counts = heights.iter().map(|own| {
        let others: Vec<Heights<'_>> = sweep.sources[own.index].iter().map(|&source| heights[source]).collect();
        count_agreeing(*own, &others, level as u32, &ConsistencyConfig::default())
    });
    let counts: Vec<_> = counts.collect::<Result<_, _>>()?;
    let all = maps.into_iter().zip(counts).zip(sweep.sources);
    Ok(all.map(|((map, counts), sources)| ViewHeights { level, sources, map, agreeing: counts.agreeing }).collect())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use numeric::Silent;

    use super::*;

    fn town() -> Vec<ViewImage> {
        let view = |number: u8| {
            let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
            let path = folder.join(format!("view_{number}.tif"));
            let camera = RpcCamera::new(formats::rpc::read_for_image(&path).unwrap().rpc);
            let source = formats::raster::ImageSource::open(&path).unwrap();
            let window = Window::whole(source.info().width, source.info().height);
            ViewImage { camera, pixels: source.read_luma(window).unwrap().luma }
        };
        [1, 3].map(view).into()
    }

    /// The median of the confirmed heights is that of the town's ground.
    #[test]
    fn views_in_memory_get_heights() {
        let found = sweep_views(town(), HeightRange::new(170.0, 280.0), Preset::Fast, &Silent).unwrap();
        assert_eq!((found.len(), found[0].level, found[0].sources.as_slice()), (2, 1, [1].as_slice()));
        let mut sure: Vec<f32> = found[0]
            .map
            .height_m
            .data()
            .iter()
            .zip(found[0].agreeing.data())
            .filter(|(_, n)| **n > 0)
            .map(|(h, _)| *h)
            .collect();
        assert!(sure.len() * 2 > found[0].agreeing.data().len(), "{} pixels", sure.len());
        let median = numeric::upper_median(&mut sure).unwrap_or(f32::NAN) + found[0].map.origin_m as f32;
        assert!((180.0..230.0).contains(&median), "{median}");
    }

    #[test]
    fn what_cannot_give_heights_is_an_error() {
        let range = HeightRange::new(170.0, 280.0);
        let mut views = town();
        let twice = vec![views[0].clone(), views[0].clone()];
        let fast = |views, range| sweep_views(views, range, Preset::Fast, &Silent);
        assert!(matches!(fast(twice, range), Err(ReconstructError::NoParallax { .. })));
        assert!(matches!(fast(town(), HeightRange::new(280.0, 170.0)), Err(ReconstructError::Range { .. })));
        views.truncate(1);
        assert!(matches!(fast(views, range), Err(ReconstructError::TooFewViews { found: 1 })));
    }
}
