//! Second stage of a run: tie points, and the correction of the cameras' pointing.

use camera::ImageCorrection;
use numeric::Choice;
use reconstruct::{HeightRange, ImagePair, ViewGeometry};
use serde::{Deserialize, Serialize};
use sweep::SweepView;
use sweep::pointing::{AdjustConfig, Adjustment, ModelOrder, Track, adjust};

use crate::config::DsmConfig;
use crate::error::DsmError;
use crate::georeferencing::control::{Controlled, GroundControl};
use crate::images::image_mask::note_masks;
use crate::images::open::Opened;
use crate::images::order::{as_given, in_order_of};
use crate::images::radiometry::ImageRadiometry;
use crate::images::scene_image::SceneImage;
use crate::notes::{LISTED_MAX, Notes};
use crate::planning::dem::dem_heights;
use crate::pointing::evidence::warn_of_domains;
use crate::pointing::image_checks::{grossly_off, unconnected};
use crate::pointing::match_images::{MatchedImages, asked_pairs, match_images, pair_names};
use crate::pointing::other_fits::warn_of_other_fits;
use crate::pointing::pair_heights::{PairHeights, off_along_sight};
use crate::pointing::partners::ALL_MAX;
use crate::pointing::same_picture::{at_one_shift, same_picture};
use crate::pointing::tie_quality::{by_image, warn_of_images, warn_of_residual};
use crate::pointing::ties::{PairTies, TIES_MIN, join_pairs, tie_heights};
use crate::report::{CorrectionOrder, PointingReport};
use crate::session::Session;
use job::corrections::Corrections;

/// Where no two views are further apart than this, heights are ten times less precise than
/// positions, and a warning is given.
const ANGLE_WEAK_DEG: f64 = 3.0;

/// Second stage of a run: the images with corrected cameras, and what the tie points show.
///
/// It can be written as JSON and read back without a change of the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Pointed {
    /// Images with corrected cameras.
    pub images: Vec<SceneImage>,
    /// Noise and contrast of the images.
    pub radiometry: Vec<ImageRadiometry>,
    /// Whether the scene fits the memory and is computed at once.
    pub is_whole: bool,
    /// Pairs that see the same ground from different directions, the best angles first.
    pub useful: Vec<ImagePair>,
    /// Pairs to match: the useful ones that are asked for.
    pub pairs: Vec<ImagePair>,
    /// Tie points by pair.
    pub ties: Vec<PairTies>,
    /// Corrections found, one per image. They are in the cameras only if `pointing.applied`.
    pub corrections: Vec<ImageCorrection>,
    /// Size of the correction and residuals.
    pub pointing: PointingReport,
    /// Heights of the tie points without outliers; `None` when there are too few.
    pub tie_heights: Option<HeightRange>,
    /// Heights of the given elevation model over the scene.
    pub dem_heights: Option<HeightRange>,
    /// Choices made so far.
    pub choices: Vec<Choice>,
    /// Warnings given so far.
    pub warnings: Vec<String>,
}

/// Reads the images, or windows of them when they do not fit the memory, finds tie points, and
/// corrects the cameras.
///
/// # Errors
/// [`DsmError::Reconstruct`], [`DsmError::Blank`], [`DsmError::SamePixels`]
/// for images that give no heights; [`DsmError::NoPointing`] for too few tie points;
/// [`DsmError::Value`], [`DsmError::BoundsMissScene`], [`DsmError::Memory`] for a request that
/// cannot be served; [`DsmError::Image`], [`DsmError::Camera`], [`DsmError::Crs`],
/// [`DsmError::Cancelled`].
pub fn point(config: &DsmConfig, opened: &Opened, session: &mut Session<'_>) -> Result<Pointed, DsmError> {
    session.progress.check_cancelled()?;
    let mut images = opened.images.clone();
    let config = &in_order_of(config, &images);
    if let Some(path) = &config.corrections {
        let earlier = Corrections::read(path).map_err(DsmError::Corrections)?;
        for image in &mut images {
            image.camera.correction = earlier.for_image(&image.path, session.progress);
        }
    }
    let mut notes = Notes::new(session.progress);
    note_masks(&images, &mut notes)?;
    let matched = match_images(config, &images, session)?;
    check_pictures(&images, &matched, session.views.as_deref())?;
    let mut points = GroundControl::read(config.control.as_deref(), &images, &mut notes)?;
    let (tracks, contradictory) = join_pairs(&matched.ties);
    // What control points do to an image is no fault of its RPC, which ties alone can tell.
    let Controlled { found, by_ties } = points.adjust(&matched.cameras, &matched.sizes, &tracks, &mut notes)?;
    let is_applied = is_applied(config, &found, &by_ties, &mut notes)?;
    warn_of_sights(&images, &matched, (&tracks, &by_ties), &mut notes);
    warn_of_other_fits(&images, &matched, &mut notes);
    let by_image = by_image(&images, &matched, &found, &tracks);
    if is_applied {
        warn_of_images(&by_image, &mut notes);
        warn_of_residual(found.residual_px.1, &by_image, &mut notes);
        correct_cameras(&mut images, session, &found.corrections);
    }
    let mut pointing = PointingReport::new(&found, (tracks.len(), contradictory), is_applied, by_image);
    pointing.control = points.report(&images, &matched.cameras, (&found, is_applied), &mut notes);
    let MatchedImages { geometry, mut useful, ties, radiometry, is_whole, .. } = matched;
    if is_applied {
        drop_unconnected(config, &mut useful, &ties, &mut notes);
    }
    let tied: Vec<ImagePair> = ties.iter().map(|t| t.pair.ordered()).collect();
    let sought: Vec<ImagePair> = useful.iter().copied().filter(|pair| tied.contains(pair)).collect();
    let pairs = choose_pairs(config, &images, &sought, &geometry, &mut notes)?;
    session.lap("pointing");
    let dem_heights =
        config.dem.as_deref().map(|path| dem_heights(path, config.dem_vertical, &geometry, &mut notes)).transpose()?;
    Ok(Pointed {
        images,
        radiometry,
        is_whole,
        useful,
        pairs,
        // What was only looked at stays behind: stages that are written and read back are the same.
        ties: ties.into_iter().map(|found| PairTies::new(found.pair, found.ties)).collect(),
        pointing,
        tie_heights: tie_heights(&found),
        corrections: found.corrections,
        dem_heights,
        choices: notes.choices,
        warnings: notes.warnings,
    })
}

/// Refuses images without contrast, and one picture under two RPCs.
fn check_pictures(images: &[SceneImage], matched: &MatchedImages, views: Option<&[SweepView]>) -> Result<(), DsmError> {
    let path = |i: usize| images[i].path.clone();
    let blank = matched.radiometry.iter().position(ImageRadiometry::is_blank);
    let pictures = matched.radiometry.iter().filter(|c| !c.is_blank()).count();
    if let (Some(first), true) = (blank, pictures < 2) {
        return Err(DsmError::Blank { path: path(first) });
    }
    match at_one_shift(&matched.ties)
        .map_or_else(|| same_picture(images, &matched.geometry, views), |pair| Ok(Some(pair)))?
    {
        Some(pair) => Err(DsmError::SamePixels { first: path(pair.first), second: path(pair.second) }),
        None => Ok(()),
    }
}

/// Returns whether corrections are to be put into the cameras: unless that is switched off.
///
/// # Errors
/// [`DsmError::NoPointing`] when the ties are too few.
fn is_applied(
    config: &DsmConfig,
    found: &Adjustment,
    by_ties: &Adjustment,
    notes: &mut Notes<'_>,
) -> Result<bool, DsmError> {
    let ties = found.ground.iter().flatten().count();
    if !config.pointing {
        notes.choose("pointing", "as given".to_owned(), "the correction is switched off");
        return Ok(false);
    }
    if ties < TIES_MIN {
        return Err(DsmError::NoPointing { ties, needed: TIES_MIN, images: config.images.clone() });
    }
    for (view, apart_px) in grossly_off(&by_ties.corrections) {
        notes.warn(format!(
            "the pointing of an image is {apart_px:.0} px off that of the others, far more than providers state; it is \
             corrected, but check that the RPC belongs to the image: {}",
            config.images[view].display()
        ));
    }
    let order = match CorrectionOrder::from(found.order) {
        CorrectionOrder::None => "none needed",
        CorrectionOrder::Translation => "a shift per image",
        CorrectionOrder::Drift => "a shift per image that grows along it",
        CorrectionOrder::Affine => "an affine map per image",
    };
    let (before, after) = found.residual_px;
    notes.choose(
        "pointing",
        order.to_owned(),
        format!("{ties} tie points, residual {before:.2} px before and {after:.2} px after, by BIC"),
    );
    Ok(true)
}

/// Warns of images that are off along their lines of sight, which ties of one pair cannot tell from
/// a height.
fn warn_of_sights(
    images: &[SceneImage],
    matched: &MatchedImages,
    (tracks, found): (&[Track], &Adjustment),
    notes: &mut Notes<'_>,
) {
    let as_given = AdjustConfig { max_order: ModelOrder::None, ..AdjustConfig::default() };
    let heights = |ties: &PairTies| {
        let pair = ties.pair;
        let geometry = matched.geometry.pair(pair).filter(|_| ties.ties.len() >= TIES_MIN)?;
        let of_pair = |track: &Track| -> Track { track.iter().filter(|(view, _)| pair.has(*view)).copied().collect() };
        let seen = tracks.iter().map(of_pair).enumerate().filter(|(_, track)| track.len() == 2);
        let (numbers, seen): (Vec<usize>, Vec<Track>) = seen.unzip();
        let ground = adjust(&matched.cameras, &matched.sizes, &seen, &as_given).ground;
        let heights = numbers.into_iter().zip(ground).filter_map(|(track, ground)| Some((track, ground?.height_m)));
        let views = [pair.first, pair.second];
        Some(PairHeights { views, height_m: heights.collect(), px_per_m: geometry.parallax_px_per_m })
    };
    let pairs: Vec<PairHeights> = matched.ties.iter().filter_map(heights).collect();
    let correction_px = |view: usize| {
        let [sample, line] = found.corrections[view].translation_px;
        sample.hypot(line)
    };
    if let Some((view, apart_px)) = off_along_sight(&pairs, correction_px) {
        notes.warn(format!(
            "the pairs of an image see heights that are {apart_px:.0} px of parallax apart from those of the others: \
             its pointing is off along the line of sight, and heights may be wrong; check that the RPC belongs to the \
             image: {}",
            images[view].path.display()
        ));
    }
    if let Some(seen) = tie_heights(found) {
        warn_of_domains(images, seen, notes);
    }
}

/// Puts corrections into the cameras of images and views.
fn correct_cameras(images: &mut [SceneImage], session: &mut Session<'_>, corrections: &[ImageCorrection]) {
    for (image, correction) in images.iter_mut().zip(corrections) {
        image.camera.correction = *correction;
    }
    for (view, correction) in session.views.iter_mut().flatten().zip(corrections) {
        view.camera.correction = *correction;
    }
}

/// Leaves out the pairs of views that no tie points connect with the others, and names these views.
fn drop_unconnected(config: &DsmConfig, useful: &mut Vec<ImagePair>, ties: &[PairTies], notes: &mut Notes<'_>) {
    let aside = unconnected(config.images.len(), ties);
    for view in &aside {
        notes.warn(format!(
            "an image is set aside: fewer than {TIES_MIN} tie points connect it with the others, \
             so its pointing is not known; without the pointing correction it is used as it is: {}",
            config.images[*view].display()
        ));
    }
    useful.retain(|pair| !aside.iter().any(|view| pair.has(*view)));
}

/// Chooses the pairs to sweep.
fn choose_pairs(
    config: &DsmConfig,
    images: &[SceneImage],
    useful: &[ImagePair],
    geometry: &ViewGeometry,
    notes: &mut Notes<'_>,
) -> Result<Vec<ImagePair>, DsmError> {
    let pairs = asked_pairs(config, images, useful)?;
    let widest = pairs.iter().filter_map(|p| geometry.pair(*p)).max_by(|a, b| a.angle_deg.total_cmp(&b.angle_deg));
    if let Some(pair) = widest.filter(|p| p.angle_deg < ANGLE_WEAK_DEG) {
        notes.warn(format!(
            "the views look along nearly the same line, {:.1}° apart at most: \
             a pixel of parallax is {:.1} m of height; add an image from another direction",
            pair.angle_deg,
            1.0 / pair.parallax_px_per_m.max(f64::MIN_POSITIVE)
        ));
    }
    for pair in config.pairs.iter().flatten().filter(|p| !useful.contains(&p.ordered())) {
        notes.warn(format!(
            "the pair {} is left out: it shares too little ground, looks along the same line or has no tie points",
            as_given(*pair, images)
        ));
    }
    let reason = match config.pairs {
        Some(_) => "given",
        None if useful.len() <= ALL_MAX => "all that share ground at a useful angle, best angle first",
        None => "the best over each part of every image, and those that connect the images",
    };
    let text = if images.len() > LISTED_MAX {
        format!("{} of {} images", pairs.len(), images.len())
    } else {
        pair_names(&pairs, images)
    };
    notes.choose("pairs", text, reason);
    Ok(pairs)
}
