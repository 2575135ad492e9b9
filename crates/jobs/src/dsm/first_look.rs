//! The first look at a scene of which only the RPCs are known: at which heights its images can show the same ground,
//! and the tie points found there.
//!
//! An RPC's HEIGHT_OFF and HEIGHT_SCALE usually hold the scene's heights, and sometimes do not (crops, fits to flat
//! ground, coefficients of another block). Two images from different directions share ground only within some heights,
//! which bounds the search whatever the RPCs say.

use camera::RpcCamera;
use raster::Window;
use sweep::SweepView;
use sweep::pointing::TieConfig;

use crate::dsm::chunks;
use crate::dsm::config::DsmConfig;
use crate::dsm::geometry::{footprint, local_polygon, overlap_share};
use crate::dsm::memory;
use crate::dsm::pictures;
use crate::dsm::pointing::{PairTies, match_pairs};
use crate::dsm::scene::{Geometry, OVERLAP_MIN, Opened, read_views};
use crate::dsm::setup::{self, EARTH_RANGE_M, OutputGrid};
use crate::dsm::tie_windows::{Character, match_in_windows};
use crate::error::PipelineError;
use numeric::Progress;

/// Heights between which overlaps are looked at, metres: footprints move by tens of metres over it.
const STEP_M: f64 = 50.0;

/// Pixels read around what the bounds ask for, full resolution: patches, aggregation and pointing errors reach out.
const WINDOW_MARGIN: usize = 96;

/// What is known before the pointing: the first geometry, the pairs that can give heights, and the ties.
pub(crate) struct Looked {
    pub(crate) first: Geometry,
    pub(crate) useful: Vec<(usize, usize)>,
    /// In the frame of each image's window.
    pub(crate) ties: Vec<PairTies>,
    /// The part of each image that is used; `None` is all of it.
    pub(crate) windows: Vec<Option<Window>>,
    /// The cameras of these windows.
    pub(crate) cameras: Vec<RpcCamera>,
    /// Their columns and rows.
    pub(crate) sizes: Vec<(usize, usize)>,
    /// Which images have no contrast.
    pub(crate) blank: Vec<bool>,
    pub(crate) pixels: Pixels,
}

/// The images' pixels.
pub(crate) enum Pixels {
    /// All that are used.
    Whole(Vec<SweepView>),
    /// Too many to hold at once: what windows of them told.
    ByChunk(Vec<Character>),
}

impl Looked {
    fn best_ties(&self) -> usize {
        self.ties.iter().map(|t| t.ties.len()).max().unwrap_or(0)
    }
}

/// Reads the images and matches them, first at the heights for which the RPCs say that they are made; where that gives
/// no ties, at all heights at which the images share ground. `lap` is told when the images are read.
pub(crate) fn look(
    config: &DsmConfig,
    images: &[Opened],
    progress: &dyn Progress,
    lap: &mut dyn FnMut(&str),
) -> Result<Looked, PipelineError> {
    let guess = images.iter().map(|o| o.camera.rpc.height_off).sum::<f64>() / images.len() as f64;
    let valid = setup::validity_range(images, config.height_range_m);
    let expected = Geometry::at(images, guess.clamp(valid.0, valid.1));
    let looked = expected.and_then(|first| look_at(config, images, first, valid, progress, lap));
    let enough = |l: &Result<Looked, PipelineError>| l.as_ref().is_ok_and(|l| l.best_ties() >= setup::TIES_MIN);
    if enough(&looked) || matches!(looked, Err(PipelineError::Image(_) | PipelineError::Memory { .. })) {
        return looked;
    }
    let Some(shared) = SharedHeights::of(images).filter(|s| s.range_m.0 < valid.0 || s.range_m.1 > valid.1) else {
        return looked;
    };
    let again = Geometry::at(images, shared.best_m)
        .and_then(|first| look_at(config, images, first, shared.range_m, progress, lap));
    // What was wrong where the scene should be says more than what is wrong elsewhere.
    if enough(&again) { again } else { looked }
}

fn look_at(
    config: &DsmConfig,
    images: &[Opened],
    first: Geometry,
    search: (f64, f64),
    progress: &dyn Progress,
    lap: &mut dyn FnMut(&str),
) -> Result<Looked, PipelineError> {
    let useful = first.useful_pairs()?;
    let pairs = asked_pairs(config, &useful)?;
    let gsd = images.iter().filter_map(|o| setup::ground_sampling(o, first.centre)).fold(0.0, f64::max);
    let grid = setup::choose_grid(config, &first, gsd)?;
    let windows = windows(config, images, &grid, search)?;
    if !fits(config, images, &windows, &grid) {
        // A limit that holds not even a small chunk is refused before anything is read.
        chunks::choose_side(config, images, &grid, (first.centre.height_m, first.centre.height_m))?;
        let (ties, characters) = match_in_windows(images, &grid, &pairs, search, progress)?;
        return Ok(Looked {
            first,
            useful,
            ties,
            windows: vec![None; images.len()],
            cameras: images.iter().map(|o| o.camera.clone()).collect(),
            sizes: images.iter().map(|o| o.size).collect(),
            blank: characters.iter().map(Character::is_blank).collect(),
            pixels: Pixels::ByChunk(characters),
        });
    }
    progress.begin("reading images", images.len());
    let views = read_views(images, &windows, &|| progress.step())?;
    lap("read");
    progress.begin("matching tie points", pairs.len());
    let ties = match_pairs(&views, &pairs, search, &TieConfig::default(), &|| progress.step());
    Ok(Looked {
        first,
        useful,
        ties,
        windows,
        cameras: views.iter().map(|v| v.camera.clone()).collect(),
        sizes: views.iter().map(|v| (v.levels[0].width(), v.levels[0].height())).collect(),
        blank: views.iter().map(pictures::is_blank).collect(),
        pixels: Pixels::Whole(views),
    })
}

/// Whether the scene may be read at once.
fn fits(config: &DsmConfig, images: &[Opened], windows: &[Option<Window>], grid: &OutputGrid) -> bool {
    let cells = grid.size.0 * grid.size.1;
    let pixels = |(o, w): (&Opened, &Option<Window>)| w.map_or(o.size.0 * o.size.1, |w| w.width * w.height) as u64;
    let pixels: Vec<u64> = images.iter().zip(windows).map(pixels).collect();
    let asked = config.chunk.is_none_or(|side| side >= grid.size.0.max(grid.size.1));
    asked && memory::needed_mb(&pixels, cells as u64) <= memory::limit_mb(config)
}

/// The useful pairs, or those of them that were asked for.
pub(crate) fn asked_pairs(config: &DsmConfig, useful: &[(usize, usize)]) -> Result<Vec<(usize, usize)>, PipelineError> {
    let pairs: Vec<(usize, usize)> = match &config.pairs {
        None => useful.to_vec(),
        Some(asked) => useful.iter().copied().filter(|p| asked.iter().any(|a| ordered(a) == *p)).collect(),
    };
    if pairs.is_empty() {
        return Err(PipelineError::Value {
            name: "--pairs",
            found: "no pair that shares ground under a useful angle".to_owned(),
            expected: format!("some of {}", pair_names(useful)),
        });
    }
    Ok(pairs)
}

/// The part of each image to read: all of it, or what the bounds may need.
fn windows(
    config: &DsmConfig,
    images: &[Opened],
    grid: &OutputGrid,
    search: (f64, f64),
) -> Result<Vec<Option<Window>>, PipelineError> {
    if config.bounds.is_none() {
        return Ok(vec![None; images.len()]);
    }
    let range = config.height_range_m.unwrap_or(search);
    let window = |o: &Opened| {
        let w = setup::image_window(o, grid, range, WINDOW_MARGIN)?;
        w.map(Some).ok_or_else(|| PipelineError::Value {
            name: "--bounds",
            found: format!("an area that an image does not see: {}", o.path.display()),
            expected: "an area that every image sees, or only the images that see it".to_owned(),
        })
    };
    images.iter().map(window).collect()
}

pub(crate) fn ordered(pair: &(usize, usize)) -> (usize, usize) {
    (pair.0.min(pair.1), pair.0.max(pair.1))
}

pub(crate) fn pair_names(pairs: &[(usize, usize)]) -> String {
    pairs.iter().map(|(i, j)| format!("{}-{}", i + 1, j + 1)).collect::<Vec<_>>().join(" ")
}

/// Heights of the Earth at which two images share ground, and the one at which they share most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SharedHeights {
    pub(crate) best_m: f64,
    pub(crate) range_m: (f64, f64),
}

impl SharedHeights {
    /// Looks at all pairs of images; `None` when no two share ground at any height.
    pub(crate) fn of(images: &[Opened]) -> Option<Self> {
        let steps = ((EARTH_RANGE_M.1 - EARTH_RANGE_M.0) / STEP_M) as usize;
        let heights = (0..=steps).map(|i| EARTH_RANGE_M.0 + STEP_M * i as f64);
        let shared: Vec<(f64, f64)> =
            heights.map(|h| (h, largest_overlap(images, h))).filter(|(_, s)| *s >= OVERLAP_MIN).collect();
        let (first, last) = (shared.first()?.0, shared.last()?.0);
        let best_m = shared.iter().max_by(|a, b| a.1.total_cmp(&b.1))?.0;
        let range_m = ((first - STEP_M).max(EARTH_RANGE_M.0), (last + STEP_M).min(EARTH_RANGE_M.1));
        Some(Self { best_m, range_m })
    }
}

/// The largest share of ground that two of the images have in common at a height; 0 where cameras fail.
fn largest_overlap(images: &[Opened], height_m: f64) -> f64 {
    let prints: Vec<_> = images.iter().filter_map(|o| footprint(&o.camera, o.size, height_m).ok()).collect();
    let Some(origin) = prints.first().and_then(|p| p.first()) else { return 0.0 };
    let frame = geodesy::EnuFrame::new(*origin);
    let outlines: Vec<_> = prints.iter().map(|p| local_polygon(p, &frame)).collect();
    let pairs = outlines.iter().enumerate().flat_map(|(i, a)| outlines[..i].iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| overlap_share(a, b)).fold(0.0, f64::max)
}
