//! Whether the tie points fit better when the images are mirrored or when they exchange their RPCs.
//!
//! Tie points are places in pictures, whatever RPCs these have. Where the RPCs belong to the
//! pictures, no other assignment lets more rays meet. Images that are all turned by 180° cannot be
//! told so: their rays meet as well, at heights with the opposite sign.

use camera::{ImagePoint, RpcCamera};
use sweep::pointing::{AdjustConfig, Adjustment, Track, adjust};

use crate::images::scene_image::SceneImage;
use crate::notes::Notes;
use crate::pointing::match_images::MatchedImages;
use crate::pointing::ties::{PairTies, TIES_MIN, join_pairs};

/// Ties that fit as well as this need no other explanation, pixels: half of what ties leave on good
/// scenes at most.
const FITS_PX: f64 = 0.15;
/// Another assignment is the true one when it leaves at most this share of the residual. On good
/// scenes every other one leaves more than the given one does.
const BETTER: f64 = 0.5;
/// Share of the ties that must go into the better fit.
const KEPT: f64 = 0.8;
/// All exchanges of so many images are tried; of more, those of any two.
const ALL_MAX: usize = 4;
/// Exchanges of two are tried among so many images at most. A larger block shows an exchange by the
/// corrections of the two images.
const EXCHANGED_MAX: usize = 12;

/// Another way in which pictures and RPCs may belong together.
enum Other {
    Mirrored,
    /// RPC of each image, by the position of the image to which it was given.
    Exchanged(Vec<usize>),
}

/// Warns when the ties fit much better with mirrored images or with exchanged RPCs.
///
/// The ties are taken as they were found. Those on which the views agree under the given RPCs were
/// chosen to fit these.
pub(crate) fn warn_of_other_fits(images: &[SceneImage], matched: &MatchedImages, notes: &mut Notes<'_>) {
    let as_found = |found: &PairTies| PairTies::new(found.pair, found.as_found().to_vec());
    let pairs: Vec<PairTies> = matched.ties.iter().map(as_found).collect();
    let tracks = &join_pairs(&pairs).0;
    let found = adjust(&matched.cameras, &matched.sizes, tracks, &AdjustConfig::default());
    let given_px = found.residual_px.1;
    if tracks.len() < TIES_MIN || given_px.is_nan() || given_px <= FITS_PX {
        return;
    }
    let given = found.ground.iter().flatten().count();
    let fits = others(images.len()).into_iter().filter_map(|other| {
        let fit = fit(&other, matched, tracks);
        let kept = fit.ground.iter().flatten().count();
        let is_better = fit.residual_px.1 <= BETTER * given_px && kept as f64 >= KEPT * given as f64;
        is_better.then_some((fit.residual_px.1, other))
    });
    let Some((px, other)) = fits.min_by(|a, b| a.0.total_cmp(&b.0)) else { return };
    let residuals = format!("residuals of {px:.2} px instead of {given_px:.2} px");
    let name = |i: usize| images[i].path.display().to_string();
    match other {
        Other::Mirrored => {
            let all: Vec<String> = (0..images.len()).map(name).collect();
            notes.warn(format!(
                "the tie points fit better when all images are mirrored, with {residuals}: the pixels seem to be \
                 mirrored against their RPCs, and the surface is then mirrored too; give the images as they were \
                 delivered: {}",
                all.join(", ")
            ));
        }
        Other::Exchanged(rpcs) => {
            let moved = (0..images.len()).filter(|i| rpcs[*i] != *i);
            let moved: Vec<String> = moved.map(|i| format!("{} with that of {}", name(i), name(rpcs[i]))).collect();
            notes.warn(format!(
                "the tie points fit better when images exchange their RPCs, with {residuals}: the RPCs seem to belong \
                 to other images, and heights are wrong; check {}",
                moved.join(", ")
            ));
        }
    }
}

/// Returns the other assignments that are tried for a number of images.
fn others(count: usize) -> Vec<Other> {
    let mut all = vec![Other::Mirrored];
    // Two exchanged images are the given ones with heights of the opposite sign.
    if (3..=ALL_MAX).contains(&count) {
        all.extend(orders(count).into_iter().skip(1).map(Other::Exchanged));
    } else if (ALL_MAX + 1..=EXCHANGED_MAX).contains(&count) {
        let two = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
        let exchanged = |(i, j)| {
            let mut order: Vec<usize> = (0..count).collect();
            order.swap(i, j);
            order
        };
        all.extend(two.map(exchanged).map(Other::Exchanged));
        all.extend([1, count - 1].map(|by| Other::Exchanged((0..count).map(|i| (i + by) % count).collect())));
    }
    all
}

/// Returns all orders of the numbers below `count`, the natural one first.
fn orders(count: usize) -> Vec<Vec<usize>> {
    let Some(last) = count.checked_sub(1) else { return vec![Vec::new()] };
    let mut all = Vec::new();
    for place in (0..=last).rev() {
        all.extend(orders(last).into_iter().map(|mut order| {
            order.insert(place, last);
            order
        }));
    }
    all
}

/// Adjusts the pointing under another assignment.
fn fit(other: &Other, matched: &MatchedImages, tracks: &[Track]) -> Adjustment {
    let config = AdjustConfig::default();
    match other {
        Other::Mirrored => adjust(&matched.cameras, &matched.sizes, &mirrored(tracks, &matched.sizes), &config),
        Other::Exchanged(rpcs) => {
            let cameras: Vec<RpcCamera> = rpcs.iter().map(|from| matched.cameras[*from].clone()).collect();
            adjust(&cameras, &matched.sizes, tracks, &config)
        }
    }
}

/// Returns tracks in images whose columns are counted from the other side.
fn mirrored(tracks: &[Track], sizes: &[(usize, usize)]) -> Vec<Track> {
    let place =
        |&(view, at): &(usize, ImagePoint)| (view, ImagePoint::new(sizes[view].0 as f64 - 1.0 - at.sample, at.line));
    tracks.iter().map(|track| track.iter().map(place).collect()).collect()
}
