//! The heights that are possible before anything is known of a scene: those for which the RPCs are
//! valid, and those at which the images share ground, whatever their RPCs state.
//!
//! HEIGHT_OFF and HEIGHT_SCALE of an RPC usually hold the heights of the scene, and sometimes do
//! not (crops, fits to flat ground, coefficients of another block). Two images from different
//! directions share ground only within some heights, which bounds the search in any case.

use reconstruct::{HeightRange, OVERLAP_MIN, footprint, local_polygon, overlap_share};

use crate::images::scene_image::SceneImage;

/// Distance of the heights that are looked at, metres. Footprints move by tens of metres over it.
const STEP_M: f64 = 50.0;

/// Heights at which two images share ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SharedHeights {
    /// Height at which two images share most ground, metres.
    pub(crate) best_m: f64,
    pub(crate) range: HeightRange,
}

impl SharedHeights {
    /// Looks at all pairs of images; `None` when no two share ground at any height.
    pub(crate) fn of(images: &[SceneImage]) -> Option<Self> {
        let steps = (HeightRange::EARTH.span_m() / STEP_M) as usize;
        let heights = (0..=steps).map(|i| HeightRange::EARTH.low_m + STEP_M * i as f64);
        let shared: Vec<(f64, f64)> =
            heights.map(|h| (h, largest_overlap(images, h))).filter(|(_, s)| *s >= OVERLAP_MIN).collect();
        let (first, last) = (shared.first()?.0, shared.last()?.0);
        let best_m = shared.iter().max_by(|a, b| a.1.total_cmp(&b.1))?.0;
        Some(Self { best_m, range: HeightRange::new(first, last).grown(STEP_M, STEP_M).cut_to(HeightRange::EARTH) })
    }
}

/// Returns the heights that are possible before anything is known of the scene: those for which the
/// RPCs are valid, and the given range.
pub(crate) fn validity_range(images: &[SceneImage], asked: Option<HeightRange>) -> HeightRange {
    let ranges = images.iter().map(|image| {
        let r = &image.camera.rpc;
        HeightRange::new(r.height_off - r.height_scale.abs(), r.height_off + r.height_scale.abs())
    });
    let nothing = HeightRange::new(f64::INFINITY, f64::NEG_INFINITY);
    let range = ranges.chain(asked).fold(nothing, HeightRange::union).cut_to(HeightRange::EARTH);
    if range.low_m < range.high_m { range } else { HeightRange::EARTH }
}

/// Returns the largest share of ground that two of the images have in common at a height; 0 where
/// cameras fail.
fn largest_overlap(images: &[SceneImage], height_m: f64) -> f64 {
    let prints: Vec<_> = images.iter().filter_map(|o| footprint(&o.camera, o.size, height_m).ok()).collect();
    let Some(origin) = prints.first().and_then(|p| p.first()) else { return 0.0 };
    let frame = geodesy::EnuFrame::new(*origin);
    let outlines: Vec<_> = prints.iter().map(|p| local_polygon(p, &frame)).collect();
    let pairs = outlines.iter().enumerate().flat_map(|(i, a)| outlines[..i].iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| overlap_share(a, b)).fold(0.0, f64::max)
}
