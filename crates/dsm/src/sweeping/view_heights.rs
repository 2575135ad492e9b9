//! Heights of views that are in memory: the height sweep without files, map or fusion.
//!
//! The views and sources are chosen as a run chooses them, from the geometry of the cameras alone.
//! The cameras are taken as they are: nothing corrects their pointing.

use std::path::PathBuf;

use camera::RpcCamera;
use numeric::Progress;
use raster::{Grid, Window};
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::{HeightMap, SweepView};

use crate::config::{EARTH_RANGE, Preset};
use crate::error::{DsmError, DsmSetting};
use crate::images::scene_image::SceneImage;
use crate::planning::levels::{SweepLevels, choose_levels, height_step_m, smallest_sides};
use crate::planning::sources::widest_parallax;
use crate::planning::view_geometry::{ViewGeometry, angle_merit};
use crate::sweeping::scene_sweep::{SceneSweep, sweep_scene};
use crate::tuning::SweepTuning;
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
/// [`DsmError::TooFewImages`], [`DsmError::Value`] for a range off the Earth,
/// [`DsmError::NoOverlap`], [`DsmError::NoParallax`], [`DsmError::Camera`], [`DsmError::Sweep`],
/// [`DsmError::Cancelled`].
pub fn sweep_views(
    images: Vec<ViewImage>,
    range: HeightRange,
    preset: Preset,
    progress: &dyn Progress,
) -> Result<Vec<ViewHeights>, DsmError> {
    if images.len() < 2 {
        return Err(DsmError::TooFewImages { found: images.len() });
    }
    if !(EARTH_RANGE.low_m <= range.low_m && range.low_m < range.high_m && range.high_m <= EARTH_RANGE.high_m) {
        return Err(DsmError::value(
            DsmSetting::HeightRange,
            format!("{} {}", range.low_m, range.high_m),
            "two heights of the Earth's surface in metres above the ellipsoid, the lower first",
        ));
    }
    let tuning = preset.tuning();
    let geometry = ViewGeometry::at(&described(&images), range.middle_m())?;
    let sources = sources_of(&geometry, images.len(), &tuning)?;
    let step_m = height_step_m(widest_parallax(&sources, &geometry), &tuning);
    let windows: Vec<Window> =
        images.iter().map(|image| Window::whole(image.pixels.width(), image.pixels.height())).collect();
    let levels = choose_levels(range, step_m, &smallest_sides(&windows), &tuning);
    let views: Vec<SweepView> = images.into_iter().map(|i| SweepView::new(i.camera, i.pixels)).collect();
    let sweep = SceneSweep::new(range, step_m, levels, sources, &tuning);
    progress.begin("sweeping heights", views.len() * levels.count());
    let maps = sweep_scene(&views, &sweep, progress)?.maps;
    confirmed(&views, sweep.sources, maps, levels)
}

/// Describes the images as a run does. There is no file to name: errors name the position.
fn described(images: &[ViewImage]) -> Vec<SceneImage> {
    let one = |(number, image): (usize, &ViewImage)| SceneImage {
        path: PathBuf::from(format!("view {number}")),
        number,
        rpc_format: String::new(),
        camera: image.camera.clone(),
        size: (image.pixels.width(), image.pixels.height()),
        acquired_s: None,
        satellite: None,
        sun: None,
        stated_incidence_deg: None,
        gain: 1.0,
        band: None,
        masks: Vec::new(),
        doubts: Vec::new(),
    };
    images.iter().enumerate().map(one).collect()
}

/// Chooses the sources of each view: the views at the best angles.
fn sources_of(geometry: &ViewGeometry, count: usize, tuning: &SweepTuning) -> Result<Vec<Vec<usize>>, DsmError> {
    let useful = geometry.useful_pairs()?;
    let merit = |i: usize, j: usize| geometry.pair(ImagePair::new(i, j)).map_or(0.0, |p| angle_merit(p.angle_deg));
    let of_view = |i: usize| {
        let mut own: Vec<usize> =
            (0..count).filter(|j| *j != i && useful.contains(&ImagePair::new(i, *j).ordered())).collect();
        own.sort_by(|&a, &b| merit(i, b).total_cmp(&merit(i, a)).then(a.cmp(&b)));
        own.truncate(tuning.sources);
        own
    };
    Ok((0..count).map(of_view).collect())
}

/// Counts, for each height, the sources that confirm it.
fn confirmed(
    views: &[SweepView],
    sources: Vec<Vec<usize>>,
    maps: Vec<HeightMap>,
    levels: SweepLevels,
) -> Result<Vec<ViewHeights>, DsmError> {
    let level = levels.finest;
    let heights: Vec<Heights<'_>> =
        maps.iter().enumerate().map(|(index, map)| Heights { index, view: &views[index], map }).collect();
    let counts = heights.iter().map(|own| {
        let others: Vec<Heights<'_>> = sources[own.index].iter().map(|&source| heights[source]).collect();
        count_agreeing(*own, &others, level as u32, &ConsistencyConfig::default())
    });
    let counts: Vec<_> = counts.collect::<Result<_, _>>()?;
    let all = maps.into_iter().zip(counts).zip(sources);
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
            let camera = RpcCamera::new(io::rpc::read_for_image(&path).unwrap().rpc);
            let source = io::raster::ImageSource::open(&path).unwrap();
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
        assert!(matches!(fast(twice, range), Err(DsmError::NoParallax { .. })));
        assert!(matches!(fast(town(), HeightRange::new(280.0, 170.0)), Err(DsmError::Value { .. })));
        views.truncate(1);
        assert!(matches!(fast(views, range), Err(DsmError::TooFewImages { found: 1 })));
    }
}
