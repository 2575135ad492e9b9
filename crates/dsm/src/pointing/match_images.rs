//! Matching of images of which only the RPCs are known: their pixels, when they fit the memory, and
//! tie points.
//!
//! Pointing is a property of the images. How ties are searched for follows from the images alone,
//! whatever the cells, the chunks, the preset and the memory of the run.
//!
//! The search begins at the heights for which the RPCs state that they are made. Where that gives
//! no ties, it is repeated at all heights at which the images share ground, see [`SharedHeights`].

use camera::RpcCamera;
use raster::Window;
use reconstruct::{DsmGrid, HeightRange, ImagePair, Preset, ViewGeometry};
use sweep::pointing::TieConfig;

use crate::config::DsmConfig;
use crate::error::{DsmError, DsmSetting};
use crate::images::image_pixels::read_views;
use crate::images::order::as_given;
use crate::images::radiometry::ImageRadiometry;
use crate::images::scene_image::SceneImage;
use crate::memory;
use crate::planning::chunk_side::{choose_side, needed_mb};
use crate::planning::grid::choose_grid;
use crate::pointing::partners::tie_pairs;
use crate::pointing::shared_heights::{SharedHeights, validity_range};
use crate::pointing::tie_windows::match_in_windows;
use crate::pointing::ties::{PairTies, TIES_MIN, match_pairs};
use crate::session::Session;

/// Images of up to this many pixels in all are matched as a whole, larger ones in windows. The
/// windows of eight images, which are read at once, have as many pixels, so that neither way takes
/// more memory than the other: some 250 MB.
const WHOLE_PIXELS: u64 = 24_000_000;

/// What is known before the pointing is corrected.
pub(crate) struct MatchedImages {
    /// Geometry at the height where ties were searched for, with the cameras of the providers.
    pub(crate) geometry: ViewGeometry,
    /// Pairs that can give heights, the best angles first.
    pub(crate) useful: Vec<ImagePair>,
    /// Ties of the pairs to match.
    pub(crate) ties: Vec<PairTies>,
    /// Cameras of the providers.
    pub(crate) cameras: Vec<RpcCamera>,
    /// Columns and rows of the images.
    pub(crate) sizes: Vec<(usize, usize)>,
    pub(crate) radiometry: Vec<ImageRadiometry>,
    /// Whether the whole scene is computed at once. The session then holds the views.
    pub(crate) is_whole: bool,
}

impl MatchedImages {
    fn has_ties(&self) -> bool {
        self.ties.iter().any(|t| t.ties.len() >= TIES_MIN)
    }
}

/// Reads the images and matches them.
///
/// # Errors
/// Those of the geometry ([`DsmError::Reconstruct`], [`DsmError::Camera`]),
/// of the request ([`DsmError::Value`], [`DsmError::BoundsMissScene`], [`DsmError::Memory`]),
/// [`DsmError::Image`], [`DsmError::Cancelled`].
pub(crate) fn match_images(
    config: &DsmConfig,
    images: &[SceneImage],
    session: &mut Session<'_>,
) -> Result<MatchedImages, DsmError> {
    let guess = images.iter().map(|o| o.camera.rpc.height_off).sum::<f64>() / images.len() as f64;
    let valid = validity_range(images, config.height_range_m);
    let expected = SceneImage::geometry(images, guess.clamp(valid.low_m, valid.high_m));
    let matched = expected.and_then(|geometry| match_at(config, images, geometry, valid, session));
    let has_ties = |l: &Result<MatchedImages, DsmError>| l.as_ref().is_ok_and(MatchedImages::has_ties);
    let is_final = |e: &DsmError| matches!(e, DsmError::Image(_) | DsmError::Memory { .. } | DsmError::Cancelled);
    if has_ties(&matched) || matched.as_ref().is_err_and(is_final) {
        return matched;
    }
    let is_wider = |s: &SharedHeights| s.range.low_m < valid.low_m || s.range.high_m > valid.high_m;
    let Some(shared) = SharedHeights::of(images).filter(is_wider) else { return matched };
    let views = session.views.take();
    let again = SceneImage::geometry(images, shared.best_m)
        .and_then(|geometry| match_at(config, images, geometry, shared.range, session));
    if has_ties(&again) || matches!(again, Err(DsmError::Cancelled)) {
        return again;
    }
    // The first error is the better explanation, because the scene should be where the RPCs are
    // valid.
    session.views = views;
    matched
}

fn match_at(
    config: &DsmConfig,
    images: &[SceneImage],
    geometry: ViewGeometry,
    search: HeightRange,
    session: &mut Session<'_>,
) -> Result<MatchedImages, DsmError> {
    let useful = geometry.useful_pairs()?;
    let asked = asked_pairs(config, images, &useful)?;
    let pairs = if config.pairs.is_some() { asked } else { tie_pairs(images, &geometry, &asked) };
    let gsd = geometry.coarsest_sampling_m(images.iter().map(|image| &image.camera));
    let grid = choose_grid(config, &geometry, gsd)?;
    let progress = session.progress;
    let is_whole = config.bounds.is_none() && config.area.is_none() && fits(config, images, &grid);
    if !is_whole {
        // A limit too small for the smallest chunk is refused before anything is read.
        choose_side(config, images, &grid, HeightRange::at(geometry.centre.height_m))?;
    }
    let is_small = images.iter().map(|image| memory::area(&image.whole())).sum::<u64>() <= WHOLE_PIXELS;
    let in_windows = if is_small {
        None
    } else {
        let scene =
            DsmConfig { bounds: None, bounds_epsg: None, area: None, gsd_m: None, crs_epsg: None, ..config.clone() };
        let scene = DsmConfig { preset: Preset::Balanced, ..scene };
        Some(match_in_windows(images, &choose_grid(&scene, &geometry, gsd)?, &geometry, &pairs, search, progress)?)
    };
    let views = if is_small || is_whole {
        progress.begin("reading images", images.len());
        let views = read_views(images, &|| progress.step())?;
        session.lap("read");
        progress.check_cancelled()?;
        Some(views)
    } else {
        None
    };
    let (ties, mut radiometry) = in_windows.unwrap_or_else(|| {
        progress.begin("matching tie points", pairs.len());
        let views = views.as_deref().unwrap_or_default();
        let ties = match_pairs(views, &pairs, search, (&TieConfig::default(), TIES_MIN), &|| progress.step());
        (ties, Vec::new())
    });
    if let Some(views) = &views {
        radiometry = vec![ImageRadiometry::default(); images.len()];
        radiometry.iter_mut().zip(views).for_each(|(radiometry, view)| radiometry.add_window(view));
    }
    session.views = views.filter(|_| is_whole);
    let cameras = images.iter().map(|o| o.camera.clone()).collect();
    let sizes = images.iter().map(|o| o.size).collect();
    Ok(MatchedImages { geometry, useful, ties, cameras, sizes, radiometry, is_whole })
}

/// Returns whether the scene may be computed at once: it fits the memory, and smaller chunks are
/// not asked for.
fn fits(config: &DsmConfig, images: &[SceneImage], grid: &DsmGrid) -> bool {
    let windows: Vec<Window> = images.iter().map(SceneImage::whole).collect();
    let is_one_chunk = config.chunk.is_none_or(|side| side >= grid.size.0.max(grid.size.1));
    is_one_chunk && needed_mb(config, &windows, grid) <= memory::limit_mb(config)
}

/// Returns the useful pairs, or those of them that are asked for.
///
/// # Errors
/// [`DsmError::Value`] when no useful pair is asked for.
pub(crate) fn asked_pairs(
    config: &DsmConfig,
    images: &[SceneImage],
    useful: &[ImagePair],
) -> Result<Vec<ImagePair>, DsmError> {
    let pairs: Vec<ImagePair> = match &config.pairs {
        None => useful.to_vec(),
        Some(asked) => useful.iter().copied().filter(|p| asked.iter().any(|a| a.ordered() == *p)).collect(),
    };
    if pairs.is_empty() {
        let found = "without a pair that shares ground under a useful angle";
        return Err(DsmError::value(DsmSetting::Pairs, found, format!("some of {}", pair_names(useful, images))));
    }
    Ok(pairs)
}

/// Returns the names of pairs, with the given positions of the images counted from 1: `1-2 1-3`.
pub(crate) fn pair_names(pairs: &[ImagePair], images: &[SceneImage]) -> String {
    pairs.iter().map(|pair| as_given(*pair, images).to_string()).collect::<Vec<_>>().join(" ")
}
