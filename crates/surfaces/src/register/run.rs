//! Runs the register job.

use std::path::PathBuf;

use camera::{ImageCorrection, RpcCamera};
use geodesy::LonLatHeight;
use numeric::{Progress, upper_median};
use occlusion::OcclusionSurface;
use sweep::pointing::{ControlPoint, ModelOrder};

use super::config::{RegisterConfig, RegisterOrder};
use super::error::RegisterError;
use super::evidence::{AGREES_PX, POINTS_FOR_ORDERS, adjusted_to_most, order_of, residuals, sharing};
use super::matching::{ENOUGH, Found, Searched};
use super::model::{Looks, Model, NewImage};
use super::page;
use super::report::{RegisterReport, RegisteredImage};
use job::error::JobError;
use job::{report_page, threads};

/// Most rounds. The first is within a pixel, the second within a tenth.
const ROUNDS: usize = 5;
/// Change of the correction that ends the rounds, pixels.
const SETTLED_PX: f64 = 0.01;
/// Search around the expected places in the second round, pixels: what a drift adds to the shift
/// at the borders of an image of usual size.
const CLOSE_PX: f64 = 4.0;
/// Search in the rounds after it, pixels: as far as least-squares matching reaches. A stripe or a
/// house further lies outside.
const SETTLING_PX: f64 = 2.0;
/// Least number of points.
const POINTS_MIN: usize = 8;
/// Points searched for of which one must be found and agree. At a wrong shift 1 of 50 did, under
/// two suns in a wood (`random:8340`), at right ones 1 of 20 and more.
const TRIED_PER_POINT: usize = 25;

/// Registers an image and writes the report with its correction.
///
/// # Errors
/// [`JobError`]: inputs that cannot be read, a model that the image does not show, matches
/// that do not agree, an output that exists.
///
/// ```
/// use surfaces::register::{RegisterConfig, RegisterModel, run};
/// let town = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town"));
/// let folder = tempfile::tempdir()?;
/// let images = vec![town.join("view_1.tif")];
/// let model = RegisterModel::Surface { dsm: town.join("truth/dsm.tif"), images };
/// let config = RegisterConfig::new(town.join("view_2.tif"), model, folder.path().join("view_2.json"));
/// let report = run(&config, &numeric::Silent)?;
/// assert!(report.agree > 20 && report.rms_px < 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &RegisterConfig, progress: &dyn Progress) -> Result<RegisterReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &RegisterConfig, progress: &dyn Progress) -> Result<RegisterReport, RegisterError> {
    config.validate()?;
    report_page::refuse_existing(&config.output, config.overwrite)?;
    let report = threads::install(config.threads, || register(config, progress))??;
    report_page::write_page(&config.output, &page::of(&report)?, &report, config.overwrite)?;
    Ok(report)
}

fn register(config: &RegisterConfig, progress: &dyn Progress) -> Result<RegisterReport, RegisterError> {
    let rpc = formats::rpc::read_for_image(&config.image)?.rpc;
    let camera = RpcCamera { rpc, correction: ImageCorrection::IDENTITY };
    let model = Model::open(config, &camera, progress)?;
    let mut new = open(config, &model, camera)?;
    let info = new.image.source.info();
    let size = (info.width, info.height);
    let surface = OcclusionSurface::new(&model.heights, model.cell_m);
    let mut searched = Searched::new(&model, &surface, new.gsd_m);
    progress.begin("rounds", ROUNDS);
    let (mut found, mut rounds) = first_found(&mut searched, &mut new, config, progress)?;
    loop {
        if found.points.len() < POINTS_MIN {
            return Err(too_few(found.points.len(), found.tried, config));
        }
        let before = new.image.camera.clone();
        let (correction, order) = corrected(&before, size, &found.points, rounds, config.order);
        new.image.camera.correction = correction;
        rounds += 1;
        progress.step();
        let moved = change(&before, &new.image.camera, &found.points);
        if rounds == ROUNDS || (moved < SETTLED_PX && rounds > 1) {
            return judged(config, &model, &new, &found, (rounds, order), progress);
        }
        let reach_px = if rounds == 1 { CLOSE_PX } else { SETTLING_PX };
        found = searched.search(&new, reach_px.min(config.reach_px), progress)?;
    }
}

/// Searches for the first points, and returns the rounds before it.
///
/// That is done under each of the shifts on which the model agrees, and the one under which most
/// points share a shift is kept: two suns can make the wrong one the likeliest. Without such a
/// shift, each point is searched for as far as the pointing may be wrong.
fn first_found(
    searched: &mut Searched<'_>,
    new: &mut NewImage,
    config: &RegisterConfig,
    progress: &dyn Progress,
) -> Result<(Found, usize), RegisterError> {
    let raw = new.image.camera.correction;
    let mut best: Option<(usize, Found, ImageCorrection)> = None;
    for [samples, lines] in searched.common_shifts(new, config.reach_px, progress)? {
        let correction = ImageCorrection::translation(samples, lines);
        new.image.camera.correction = correction;
        let found = searched.search(new, CLOSE_PX.min(config.reach_px), progress)?;
        let count = sharing(&new.image.camera, &found.points).len();
        if count >= best.as_ref().map_or(POINTS_MIN, |(most, ..)| most + 1) {
            best = Some((count, found, correction));
        }
        if count >= ENOUGH {
            break;
        }
    }
    if let Some((_, found, correction)) = best {
        new.image.camera.correction = correction;
        return Ok((found, 1));
    }
    new.image.camera.correction = raw;
    Ok((searched.search(new, config.reach_px, progress)?, 0))
}

/// Returns the least number of points, of so many that were searched for.
fn needed(tried: usize) -> usize {
    POINTS_MIN.max(tried.div_ceil(TRIED_PER_POINT))
}

fn too_few(found: usize, tried: usize, config: &RegisterConfig) -> RegisterError {
    RegisterError::TooFew { found, tried, needed: needed(tried), reach_px: config.reach_px }
}

/// Opens the new image on the model.
fn open(config: &RegisterConfig, model: &Model, camera: RpcCamera) -> Result<NewImage, RegisterError> {
    let middle = [model.heights.width(), model.heights.height()].map(|cells| 0.5 * (cells as f64 - 1.0));
    let [lon, lat] = model.ground.lonlat(middle[0], middle[1]);
    let gsd = camera.gsd(LonLatHeight::new(lon, lat, model.middle_m));
    let gsd_m = gsd.map_err(|source| RegisterError::Camera { path: config.image.clone(), source })?.mean_m();
    let image = model.look_through(&config.image, camera)?;
    Ok(NewImage { path: config.image.clone(), image, gsd_m })
}

/// Returns the correction that follows from the points that share a shift, and its order. The first
/// round finds a shift, where all of the model together told none: matches of an image that is laid
/// beside its place tell no more.
fn corrected(
    camera: &RpcCamera,
    size: (usize, usize),
    points: &[ControlPoint],
    rounds: usize,
    wanted: RegisterOrder,
) -> (ImageCorrection, RegisterOrder) {
    let sharing = sharing(camera, points);
    // The order is that of the whole correction, so it follows no linear part of an earlier round.
    let raw = RpcCamera { rpc: camera.rpc.clone(), correction: ImageCorrection::IDENTITY };
    let shift = |axis: usize| {
        let mut all: Vec<f64> = residuals(&raw, &sharing).map(|residual| residual[axis]).collect();
        upper_median(&mut all).unwrap_or(0.0)
    };
    let near = RpcCamera { correction: ImageCorrection::translation(shift(0), shift(1)), ..raw.clone() };
    let order = match wanted {
        _ if rounds == 0 => ModelOrder::Translation,
        RegisterOrder::Evidence => order_of(&near, size, &sharing),
        RegisterOrder::Shift => ModelOrder::Translation,
        RegisterOrder::Drift => ModelOrder::Drift,
        RegisterOrder::Affine => ModelOrder::Affine,
    };
    let named = match order {
        ModelOrder::Drift => RegisterOrder::Drift,
        ModelOrder::Affine => RegisterOrder::Affine,
        ModelOrder::None | ModelOrder::Translation => RegisterOrder::Shift,
    };
    (adjusted_to_most(&near, size, &sharing, order), named)
}

/// Returns how far a new correction moves the points at most, pixels.
fn change(before: &RpcCamera, after: &RpcCamera, points: &[ControlPoint]) -> f64 {
    let moved = residuals(before, points).zip(residuals(after, points));
    moved.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max)
}

/// Returns the place of a point in the image and its residual, rounded to a thousandth of a pixel.
fn seen_with((point, [along, across]): (&ControlPoint, [f64; 2])) -> Option<[f64; 4]> {
    let (_, seen) = point.seen.first()?;
    let values = [seen.sample, seen.line, along, across];
    values.iter().all(|value| value.is_finite()).then(|| values.map(|value| (1e3 * value).round() / 1e3))
}

fn judged(
    config: &RegisterConfig,
    model: &Model,
    new: &NewImage,
    found: &Found,
    (rounds, order): (usize, RegisterOrder),
    progress: &dyn Progress,
) -> Result<RegisterReport, RegisterError> {
    let camera = &new.image.camera;
    let mut lengths: Vec<f64> = residuals(camera, &found.points).map(|[a, b]| a.hypot(b)).collect();
    let agreeing: Vec<f64> = lengths.iter().copied().filter(|length| *length <= AGREES_PX).collect();
    let (agree, count) = (agreeing.len(), lengths.len());
    if 2 * agree < count {
        return Err(RegisterError::NoAgreement { agree, found: count });
    }
    if agree < needed(found.tried) {
        return Err(too_few(agree, found.tried, config));
    }
    if config.order == RegisterOrder::Evidence && agree < POINTS_FOR_ORDERS {
        progress.warn(&format!(
            "{agree} points agree, and {POINTS_FOR_ORDERS} are needed to tell a drift and an affine map from a shift: \
             the correction may be off towards the borders of the image"
        ));
    }
    let info = new.image.source.info();
    let middle = camera::ImagePoint::new(0.5 * (info.width as f64 - 1.0), 0.5 * (info.height as f64 - 1.0));
    let moved = camera.correction.apply(middle);
    let named = |path: &PathBuf, correction: ImageCorrection| RegisteredImage {
        path: path.canonicalize().unwrap_or_else(|_| path.clone()),
        applied_correction: Some(correction),
    };
    let others: &[(PathBuf, crate::ortho::OrthoImage)] = match &model.looks {
        Looks::Images(images) => images,
        Looks::Picture(_) => &[],
    };
    let others = others.iter().map(|(path, image)| named(path, image.camera.correction));
    Ok(RegisterReport {
        images: std::iter::once(named(&new.path, camera.correction)).chain(others).collect(),
        order,
        tried: found.tried,
        found: count,
        agree,
        rms_px: (agreeing.iter().map(|length| length * length).sum::<f64>() / agree as f64).sqrt(),
        median_px: upper_median(&mut lengths).unwrap_or(f64::NAN),
        shift_px: [moved.sample - middle.sample, moved.line - middle.line],
        gsd_m: new.gsd_m,
        rounds,
        size: (info.width, info.height),
        residuals_px: found.points.iter().zip(residuals(camera, &found.points)).filter_map(seen_with).collect(),
    })
}
