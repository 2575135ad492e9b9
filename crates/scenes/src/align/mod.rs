//! The alignment job: moves a COLMAP model to the world by GPS positions of its images or by points
//! known in both. [`ManualAlign`] does so by hand, over a map.
//!
//! The moved model is in metres along the axes of a map, relative to the origin in `origin.json`.

mod by_hand;
mod config;
mod error;
mod output;
mod photograph;
mod text;
mod world;

use std::path::Path;

use colmap::align::{
    AlignConfig, AlignError, CameraUp, Disturbance, ModelAlignment, NoiseLevel, PointPair, align, align_upright,
    camera_up, disturbed, sensitivity, spread_ratio, tilt_sigma_deg,
};
use formats::splat_ply::LocalOrigin;
use serde::Serialize;

pub use by_hand::{AlignMap, ManualAlign, ManualAlignConfig, ManualAlignReport, ManualFit, ManualStart};
pub use config::AlignJobConfig;
pub use output::SimilarityParts;

use error::AlignJobError;
use job::error::JobError;
use job::files::create_folder;
use job::output_folder::OutputFolder;
use job::report_page;
use numeric::Progress;
use output::{ModelWithPoints, ModelWriter};
use world::{KnownPositions, World};

/// The report, which is written last.
const REPORT: &str = "align.json";
/// Ratio of the cameras' spread across their line to that along it, below which the job warns.
const SPREAD_LOW: f64 = 0.05;
/// Standard deviation of the tilt above which positions do not determine it, degrees. Three of them
/// are about two degrees.
const TILT_LOOSE_DEG: f64 = 0.7;
/// Greatest spread of the cameras' up directions that are held level, degrees.
const HELD_SPREAD_DEG: f64 = 25.0;

/// Where a model lies in the world, and how well the positions agree.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AlignJobReport {
    /// Folder of the model.
    pub model: String,
    /// Table of the positions.
    pub positions: String,
    /// Origin that the moved model is relative to.
    pub origin: LocalOrigin,
    /// Similarity from the model to the world, relative to `origin`.
    pub world_from_model: SimilarityParts,
    /// Number of positions known in both frames.
    pub pairs: usize,
    /// Number of pairs within the threshold.
    pub inliers: usize,
    /// Number of positions whose image is not in the model.
    pub positions_without_image: usize,
    /// Largest residual of an inlier, metres.
    pub threshold_m: f64,
    /// Root mean square residual of the inliers, metres.
    pub rmse_m: f64,
    /// Spread of the positions across their line relative to that along it.
    pub spread_across_line: f64,
    /// Standard deviation of the tilt as far as the positions determine it, degrees; `None` where
    /// they do not.
    pub tilt_sigma_deg: Option<f64>,
    /// Whether the tilt comes from the up directions of the cameras, because the positions do not
    /// determine it.
    pub upright: bool,
    /// Residual of every pair.
    pub residuals: Vec<AlignResidual>,
    /// Sensitivity to noise, one entry per level.
    pub noise: Vec<NoiseLevel>,
}

/// Residual of one pair.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlignResidual {
    /// Name of the image, or number of the point.
    pub name: String,
    /// Distance between the position and the moved model, metres.
    pub residual_m: f64,
    /// Whether the pair is within the threshold.
    pub inlier: bool,
}

/// Aligns a COLMAP model and writes the moved model with a report.
///
/// # Errors
/// [`JobError`]: an input that cannot be read, positions that determine no similarity, an
/// output that exists.
///
/// ```
/// use scenes::align::{AlignJobConfig, run};
/// let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/cameras/sparse/0");
/// let folder = tempfile::tempdir()?;
/// let table = folder.path().join("gps.csv");
/// let mut text = "name,easting,northing,height\n".to_owned();
/// for view in formats::colmap::read(model.as_ref())?.views {
///     let [x, y, z] = view.pose.centre;
///     text += &format!("{},{x},{y},{z}\n", view.name);
/// }
/// std::fs::write(&table, text)?;
/// let mut config = AlignJobConfig::new(model.into(), table, folder.path().join("aligned"));
/// config.crs_epsg = Some(32631);
/// let report = run(&config, &numeric::Silent)?;
/// assert!((report.world_from_model.scale - 1.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(config: &AlignJobConfig, progress: &dyn Progress) -> Result<AlignJobReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &AlignJobConfig, progress: &dyn Progress) -> Result<AlignJobReport, AlignJobError> {
    config.validate()?;
    let report_path = config.output.join(REPORT);
    report_page::refuse_existing(&report_path, config.overwrite)?;
    let folder = OutputFolder::take(&config.output)?;
    progress.begin("alignment", 3);
    let model = read_model(&config.model, progress)?;
    progress.step();
    let positions = formats::control::read(&config.positions)?;
    let world = World::of(&positions, config.crs_epsg, config.vertical)?;
    let known = world.known(&positions, &model.cameras)?;
    let search = AlignConfig { threshold_m: config.threshold_m, seed: config.seed, ..AlignConfig::default() };
    let Aligned { alignment, tilt_sigma_deg, upright } = aligned(config.use_gravity, &known.pairs, &model, &search)
        .map_err(|source| AlignJobError::Alignment { pairs: known.pairs.len(), source })?;
    let noise = config.noise.as_ref();
    let levels = noise.map(|noise| sensitivity(&known.pairs, &alignment, noise, &search)).unwrap_or_default();
    progress.step();
    progress.check_cancelled()?;
    let mut report = report(config, &world, &known, &alignment, levels);
    (report.tilt_sigma_deg, report.upright) = (Some(tilt_sigma_deg).filter(|sigma| sigma.is_finite()), upright);
    folder.remove(REPORT)?;
    let writer =
        ModelWriter { model: &model, origin: &world.origin, encoding: config.encoding, overwrite: config.overwrite };
    writer.write(&config.output, "", &alignment.world_from_model)?;
    write_under_noise(config, &known, &alignment, &search, &writer, progress)?;
    let lead = "A camera model moved to the world by pairs of points.";
    report_page::write(&report_path, ("Alignment", lead), &report, Vec::new(), config.overwrite)?;
    progress.step();
    warn_of(&report, progress);
    Ok(report)
}

/// An alignment, and where its tilt comes from.
struct Aligned {
    alignment: ModelAlignment,
    /// Standard deviation of the tilt that the positions give, degrees.
    tilt_sigma_deg: f64,
    upright: bool,
}

/// Aligns a model by its positions, and by the up directions of its cameras where the positions do
/// not determine the tilt.
fn aligned(
    use_gravity: bool,
    pairs: &[PointPair],
    model: &ModelWithPoints,
    search: &AlignConfig,
) -> Result<Aligned, AlignError> {
    let plain = align(pairs, search);
    let tilt_sigma_deg = plain.as_ref().map_or(f64::INFINITY, |found| tilt_sigma_deg(pairs, found));
    let up = if use_gravity && tilt_sigma_deg > TILT_LOOSE_DEG { held_up(model) } else { None };
    match (plain, up) {
        (Ok(_) | Err(AlignError::Degenerate { .. }), Some(up)) => {
            let alignment = align_upright(pairs, &up, search)?;
            Ok(Aligned { alignment, tilt_sigma_deg, upright: true })
        }
        (plain, _) => Ok(Aligned { alignment: plain?, tilt_sigma_deg, upright: false }),
    }
}

/// Returns the up direction of cameras that are held level.
fn held_up(model: &ModelWithPoints) -> Option<CameraUp> {
    let rotations: Vec<[[f64; 3]; 3]> = model.cameras.views.iter().map(|view| view.pose.rotation).collect();
    camera_up(&rotations).filter(|up| up.spread_deg <= HELD_SPREAD_DEG)
}

fn read_model(folder: &Path, progress: &dyn Progress) -> Result<ModelWithPoints, AlignJobError> {
    let has_points = ["points3D.bin", "points3D.txt"].iter().any(|name| folder.join(name).is_file());
    if has_points {
        let (cameras, points) = formats::colmap::read_with_points(folder)?;
        return Ok(ModelWithPoints { cameras, points });
    }
    progress.warn(&format!("the model has no points3D: only its cameras are aligned: {}", folder.display()));
    Ok(ModelWithPoints { cameras: formats::colmap::read(folder)?, points: Vec::new() })
}

fn report(
    config: &AlignJobConfig,
    world: &World,
    known: &KnownPositions,
    alignment: &ModelAlignment,
    noise: Vec<NoiseLevel>,
) -> AlignJobReport {
    let residuals = known.names.iter().zip(&alignment.residuals_m).zip(&alignment.inliers);
    let residual = |((name, &residual_m), &inlier): ((&String, &f64), &bool)| AlignResidual {
        name: name.clone(),
        residual_m,
        inlier,
    };
    AlignJobReport {
        model: config.model.display().to_string(),
        positions: config.positions.display().to_string(),
        origin: world.origin.clone(),
        world_from_model: SimilarityParts::from(&alignment.world_from_model),
        pairs: known.pairs.len(),
        inliers: alignment.inlier_count(),
        positions_without_image: known.unknown,
        threshold_m: alignment.threshold_m,
        rmse_m: alignment.rmse_m(),
        spread_across_line: spread_ratio(known.pairs.iter().map(|p| p.source)),
        tilt_sigma_deg: None,
        upright: false,
        residuals: residuals.map(residual).collect(),
        noise,
    }
}

/// Writes the models under noise to folders such as `translation_3m_seed_2` and
/// `rotation_10deg_seed_1`.
fn write_under_noise(
    config: &AlignJobConfig,
    known: &KnownPositions,
    alignment: &ModelAlignment,
    search: &AlignConfig,
    writer: &ModelWriter<'_>,
    progress: &dyn Progress,
) -> Result<(), AlignJobError> {
    let (Some(noise), Some(folder)) = (&config.noise, &config.noise_output) else { return Ok(()) };
    create_folder(folder)?;
    let translations = noise.translation_m.iter().map(|&m| (Disturbance::TranslationM(m), format!("translation_{m}m")));
    let rotations = noise.rotation_deg.iter().map(|&deg| (Disturbance::RotationDeg(deg), format!("rotation_{deg}deg")));
    for (disturbance, name) in translations.chain(rotations) {
        for seed in 1..=noise.seeds {
            match disturbed(&known.pairs, alignment, disturbance, seed, search) {
                Ok(similarity) => writer.write(folder, &format!("{name}_seed_{seed}"), &similarity)?,
                Err(error) => progress.warn(&format!("{name}, seed {seed}: {error}")),
            }
        }
    }
    Ok(())
}

fn warn_of(report: &AlignJobReport, progress: &dyn Progress) {
    let spread = report.spread_across_line;
    let tilt = report.tilt_sigma_deg.map_or("unbounded".to_owned(), |deg| format!("{deg:.1}°"));
    let is_loose = report.tilt_sigma_deg.is_none_or(|deg| deg > TILT_LOOSE_DEG);
    if report.upright {
        progress.warn(&format!(
            "the positions do not determine the tilt (standard deviation {tilt}), so it follows the up direction of the \
             cameras"
        ));
    } else if is_loose {
        progress.warn(&format!(
            "the positions do not determine the tilt (standard deviation {tilt}): add positions beside their line, or at \
             other heights"
        ));
    } else if spread < SPREAD_LOW {
        progress.warn(&format!(
            "the positions lie almost on a line (spread {spread:.3}): the rotation about it is uncertain"
        ));
    }
    if report.positions_without_image > 0 {
        progress.warn(&format!("{} positions are of images that are not in the model", report.positions_without_image));
    }
}
