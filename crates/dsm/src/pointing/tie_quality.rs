//! What the tie points show of each image: how many there are, how much of the shared ground they
//! cover, and how well they fit.
//!
//! The ground that an image shares is sampled on a lattice of its pixels: a place is shared when
//! another image shows it too, at the median height of the ties. A place is covered when a tie lies
//! in its field of the lattice or in a neighbouring one.

use camera::{ImagePoint, RpcCamera};
use numeric::upper_median;
use sweep::pointing::{Adjustment, Track};

use crate::images::scene_image::SceneImage;
use crate::notes::Notes;
use crate::pointing::match_images::MatchedImages;
use crate::pointing::ties::TIES_MIN;
use crate::report::ImagePointing;

/// Fields of the lattice on a side. A dozen ties that are spread evenly cover two fifths of it, and
/// any number of ties in one corner of an image cover a twentieth.
const FIELDS: usize = 16;
/// Ties that cover less than this share of the shared ground are named. Ties on a quarter of an
/// area span half of its sides. A drift along the image is then extrapolated by as much as it was
/// observed, and its error is three times that within the ties.
const COVERED_MIN: f64 = 0.25;
/// Residuals more than this many times those of the other images are named. The median of a dozen
/// residuals is known to a third. Images of unlike sharpness and resolution differ by a factor of
/// two.
const RESIDUAL_TIMES: f64 = 3.0;
/// Residuals below this are never named, pixels: they change heights by less than matching errors.
const RESIDUAL_MIN_PX: f64 = 0.5;
/// Most residuals of an image in a report.
const SHOWN_MAX: usize = 150;

/// Returns what the ties show of each image, in the order of the configuration.
pub(crate) fn by_image(
    images: &[SceneImage],
    matched: &MatchedImages,
    found: &Adjustment,
    tracks: &[Track],
) -> Vec<ImagePointing> {
    let mut heights: Vec<f64> = found.ground.iter().flatten().map(|ground| ground.height_m).collect();
    let height_m = upper_median(&mut heights);
    let mut all: Vec<(usize, ImagePointing)> = Vec::with_capacity(images.len());
    for (view, image) in images.iter().enumerate() {
        let place = |track: &Track| track.iter().find(|(v, _)| *v == view).map(|(_, place)| *place);
        let inliers = tracks.iter().zip(&found.ground).filter(|(_, ground)| ground.is_some());
        let inliers: Vec<ImagePoint> = inliers.filter_map(|(track, _)| place(track)).collect();
        let covered = height_m.and_then(|h| covered(&matched.cameras, &matched.sizes, view, &inliers, h));
        all.push((
            image.number,
            ImagePointing {
                path: image.path.clone(),
                tracks: tracks.iter().filter_map(place).count(),
                inliers: inliers.len(),
                covered: covered.unwrap_or(f64::NAN),
                residual_px: found.view_residual_px[view],
                tie_residuals_px: tie_residuals(&matched.cameras[view], view, found, tracks),
            },
        ));
    }
    all.sort_by_key(|(number, _)| *number);
    all.into_iter().map(|(_, image)| image).collect()
}

/// Returns places and residuals of a view's inliers under its correction, rounded to a thousandth
/// of a pixel.
fn tie_residuals(camera: &RpcCamera, view: usize, found: &Adjustment, tracks: &[Track]) -> Vec<[f64; 4]> {
    let corrected = RpcCamera { rpc: camera.rpc.clone(), correction: found.corrections[view] };
    let residual = |(track, ground): (&Track, &Option<geodesy::LonLatHeight>)| {
        let (_, seen) = track.iter().find(|(v, _)| *v == view)?;
        let shown = corrected.project((*ground)?).ok()?;
        let values = [seen.sample, seen.line, seen.sample - shown.sample, seen.line - shown.line];
        Some(values.map(|value| (1e3 * value).round() / 1e3))
    };
    let all: Vec<[f64; 4]> = tracks.iter().zip(&found.ground).filter_map(residual).collect();
    let step = all.len().div_ceil(SHOWN_MAX).max(1);
    all.into_iter().step_by(step).collect()
}

/// Returns the share of a view's shared ground that ties cover; `None` when no other view shows any
/// of it.
fn covered(
    cameras: &[RpcCamera],
    sizes: &[(usize, usize)],
    view: usize,
    ties: &[ImagePoint],
    height_m: f64,
) -> Option<f64> {
    let (width, height) = (sizes[view].0 as f64, sizes[view].1 as f64);
    let field = |p: &ImagePoint| {
        let along = |at: f64, size: f64| ((at + 0.5) / size * FIELDS as f64).clamp(0.0, FIELDS as f64 - 1.0) as usize;
        (along(p.sample, width), along(p.line, height))
    };
    let mut is_near = [[false; FIELDS]; FIELDS];
    for (x, y) in ties.iter().map(field) {
        for row in &mut is_near[y.saturating_sub(1)..(y + 2).min(FIELDS)] {
            row[x.saturating_sub(1)..(x + 2).min(FIELDS)].fill(true);
        }
    }
    let is_seen = |x: usize, y: usize| {
        let at = |i: usize, size: f64| (i as f64 + 0.5) / FIELDS as f64 * size - 0.5;
        let place = ImagePoint::new(at(x, width), at(y, height));
        let Ok(ground) = cameras[view].localize(place, height_m) else { return false };
        let shows = |other: usize| {
            let is_inside = |p: ImagePoint| {
                let (columns, rows) = (sizes[other].0 as f64, sizes[other].1 as f64);
                (0.0..columns).contains(&p.sample) && (0.0..rows).contains(&p.line)
            };
            other != view && cameras[other].project(ground).is_ok_and(is_inside)
        };
        (0..cameras.len()).any(shows)
    };
    let fields = (0..FIELDS).flat_map(|y| (0..FIELDS).map(move |x| (x, y)));
    let shared: Vec<(usize, usize)> = fields.filter(|&(x, y)| is_seen(x, y)).collect();
    let near = shared.iter().filter(|&&(x, y)| is_near[y][x]).count();
    (!shared.is_empty()).then(|| near as f64 / shared.len() as f64)
}

/// Names the images whose ties cover little of what they share, or fit worse than those of the
/// others. Images with hardly any ties are set aside elsewhere.
pub(crate) fn warn_of_images(images: &[ImagePointing], notes: &mut Notes<'_>) {
    for (i, image) in images.iter().enumerate().filter(|(_, image)| image.tracks >= TIES_MIN) {
        if image.covered < COVERED_MIN {
            notes.warn(format!(
                "the tie points of an image cover only {:.0} % of the ground that it shares with others; its pointing \
                 is extrapolated over the rest, where heights may be off: {}",
                100.0 * image.covered,
                image.path.display()
            ));
        }
        let others = images.iter().enumerate().filter(|(j, other)| *j != i && other.tracks >= TIES_MIN);
        let mut others: Vec<f64> = others.map(|(_, other)| other.residual_px).collect();
        let usual = upper_median(&mut others).unwrap_or(f64::INFINITY);
        if image.residual_px > RESIDUAL_MIN_PX.max(RESIDUAL_TIMES * usual) {
            notes.warn(format!(
                "the tie points of an image fit worse than those of the others, with residuals of {:.2} px where {usual:.2} \
                 px are usual; check that its RPC belongs to it and that its pixels were not resampled: {}",
                image.residual_px,
                image.path.display()
            ));
        }
    }
}

/// Warns of a correction that leaves larger residuals than matching errors, and names the image
/// that fits worst.
pub(crate) fn warn_of_residual(residual_px: f64, images: &[ImagePointing], notes: &mut Notes<'_>) {
    let known = images.iter().filter(|image| image.residual_px.is_finite());
    let worst = known.max_by(|a, b| a.residual_px.total_cmp(&b.residual_px));
    if let Some(worst) = worst.filter(|_| residual_px > RESIDUAL_MIN_PX) {
        notes.warn(format!(
            "the tie points contradict each other by {residual_px:.2} px after the correction, where less than \
             {RESIDUAL_MIN_PX} px are usual: shadows or plants may have changed between the dates, and heights may be \
             wrong; check the RPC of the image that fits worst, with {:.2} px, or leave it out: {}",
            worst.residual_px,
            worst.path.display()
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 640;

    fn cameras() -> Vec<RpcCamera> {
        let camera = |i| {
            let path = format!("{}/../../data-samples/town/view_{i}.tif", env!("CARGO_MANIFEST_DIR"));
            RpcCamera::new(formats::rpc::read_for_image(std::path::Path::new(&path)).unwrap().rpc)
        };
        [1, 2, 3].map(camera).to_vec()
    }

    fn image(name: &str, covered: f64, residual_px: f64) -> ImagePointing {
        ImagePointing {
            path: name.into(),
            tracks: 100,
            inliers: 90,
            covered,
            residual_px,
            tie_residuals_px: Vec::new(),
        }
    }

    #[test]
    fn ties_in_a_corner_cover_little_and_spread_ones_much() {
        let share = |of: f64, count: usize| {
            let at = |i: usize, period: usize| of * SIZE as f64 * (i % period) as f64 / period as f64;
            let ties: Vec<ImagePoint> = (0..count).map(|i| ImagePoint::new(at(i, 5), at(i, 7))).collect();
            covered(&cameras(), &[(SIZE, SIZE); 3], 0, &ties, 200.0).unwrap()
        };
        assert!(share(0.1, 500) < COVERED_MIN, "{}", share(0.1, 500));
        assert!(share(1.0, 12) > COVERED_MIN, "{}", share(1.0, 12));
        assert!(share(1.0, 35) > 0.7, "{}", share(1.0, 35));
    }

    #[test]
    fn a_place_that_no_other_image_shows_is_not_shared() {
        let cameras = cameras();
        assert_eq!(covered(&cameras[..1], &[(SIZE, SIZE)], 0, &[], 200.0), None);
    }

    #[test]
    fn the_odd_image_is_named_and_good_ones_are_not() {
        let mut notes = Notes::new(&numeric::Silent);
        let good = [image("a", 0.9, 0.2), image("b", 0.5, 0.35), image("c", 0.8, 0.15), image("d", f64::NAN, 0.2)];
        warn_of_images(&good, &mut notes);
        assert!(notes.warnings.is_empty(), "{:?}", notes.warnings);
        warn_of_images(&[image("a", 0.9, 0.2), image("b", 0.1, 0.2), image("c", 0.9, 0.9)], &mut notes);
        let [covered, residual] = &notes.warnings[..] else { panic!("{:?}", notes.warnings) };
        assert!(covered.contains("10 %") && covered.ends_with(": b"), "{covered}");
        assert!(residual.contains("0.90 px") && residual.ends_with(": c"), "{residual}");
    }

    #[test]
    fn residuals_beyond_matching_errors_name_the_worst_image() {
        let mut notes = Notes::new(&numeric::Silent);
        let images = [image("a", 0.9, 0.5), image("b", 0.9, 1.1), image("c", 0.9, f64::NAN)];
        warn_of_residual(0.45, &images, &mut notes);
        assert!(notes.warnings.is_empty(), "{:?}", notes.warnings);
        warn_of_residual(0.85, &images, &mut notes);
        let [warning] = &notes.warnings[..] else { panic!("{:?}", notes.warnings) };
        assert!(warning.contains("0.85 px") && warning.contains("1.10 px") && warning.ends_with(": b"), "{warning}");
    }
}
