//! Third stage of a run: the plan, with everything that is needed to compute a chunk.

use camera::ImageCorrection;
use formats::raster::iso_time;
use numeric::{Choice, Muted};
use reconstruct::{
    DsmGrid, HeightRange, ImagePair, SceneSweep, SweepLevels, SweepTuning, ViewGeometry, choose_levels, height_step_m,
    probe, smallest_sides, widest_parallax,
};
use serde::{Deserialize, Serialize};

use crate::config::DsmConfig;
use crate::error::{DsmError, DsmSetting};
use crate::images::image_pixels::read_view;
use crate::images::order::{as_given, in_order_of};
use crate::images::radiometry::ImageRadiometry;
use crate::images::scene_image::SceneImage;
use crate::masks::ground_mask::warn_of_masks;
use crate::memory;
use crate::notes::Notes;
use crate::planning::chunk_plan::{ChunkPlan, ChunkPlanner, ChunkSweep, ChunkWork, read_chunk_views};
use crate::planning::chunk_side::{choose_side, cores, needed_mb};
use crate::planning::grid::{choose_grid, note_grid};
use crate::planning::height_choice::{choose_heights, middle_height_m};
use crate::planning::sources::{choose_sources, source_candidates};
use crate::planning::step_notes::{note_levels, note_step};
use crate::pointing::point::Pointed;
use crate::pointing::ties::PairTies;
use crate::report::{ImageReport, PairReport, PointingReport};
use crate::session::Session;

/// Third stage of a run: everything that is needed to compute the chunks and to merge them.
///
/// A scene that fits the memory is a plan of one chunk. A plan can be written as JSON and read back
/// without a change of the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Plan {
    /// Version of the program that made the plan.
    pub version: String,
    /// Configuration of the run.
    pub config: DsmConfig,
    /// Images with corrected cameras.
    pub images: Vec<SceneImage>,
    /// Noise and contrast of the images.
    pub radiometry: Vec<ImageRadiometry>,
    /// Grid of the DSM.
    pub grid: DsmGrid,
    /// Pairs that see the same ground from different directions, the best angles first.
    pub useful: Vec<ImagePair>,
    /// Side of a pixel of the coarsest image on the ground, metres.
    pub pixel_m: f64,
    /// Distance of two height hypotheses at full resolution, metres.
    pub step_m: f64,
    /// Heights of the scene, metres above the ellipsoid.
    pub height_range: HeightRange,
    /// Parameters of the sweep.
    pub tuning: SweepTuning,
    /// Largest side of a chunk, cells; `None` when the scene is computed at once.
    pub chunk_side: Option<usize>,
    /// Chunks, whose cores cover the grid.
    pub chunks: Vec<ChunkPlan>,
    /// Parts of the report that are known before the heights.
    pub report: PlanReport,
    /// Choices made so far.
    pub choices: Vec<Choice>,
    /// Warnings given so far.
    pub warnings: Vec<String>,
}

/// Parts of the report that are known before the heights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PlanReport {
    /// Images in the order of the configuration.
    pub images: Vec<ImageReport>,
    /// Pairs that were matched.
    pub pairs: Vec<PairReport>,
    /// Correction of the pointing.
    pub pointing: PointingReport,
}

/// Difference of the incidence angles that an item and the RPC of one image may have, degrees: the
/// angle changes by 2° within a long strip, and some catalogues state it at the sensor.
const STATED_VIEW_DEG: f64 = 5.0;

/// Standard deviation of the residuals of tie points between images whose cameras are exact,
/// pixels: what the simulated scenes have, 0.21 to 0.24.
const TIE_NOISE_PX: f64 = 0.24;

impl Plan {
    /// Returns the deviation of heights that the cameras leave, metres.
    ///
    /// What the residuals of the tie points are larger than the noise of the ties is a displacement
    /// of each image. That of two images is `√2` times as large, and changes heights as parallax
    /// does. Without tie points nothing is known of it, and the result is 0.
    pub(crate) fn camera_deviation_m(&self) -> f64 {
        let PointingReport { applied, residual_before_px, residual_after_px, .. } = self.report.pointing;
        let residual_px = if applied { residual_after_px } else { residual_before_px };
        let excess = residual_px.powi(2) - TIE_NOISE_PX.powi(2);
        if excess > 0.0 { (2.0 * excess).sqrt() * self.step_m / self.tuning.step_px } else { 0.0 }
    }
}

/// Chooses grid, heights, sources, steps and chunks.
///
/// # Errors
/// [`DsmError::NoTies`], [`DsmError::RangeMissesScene`], [`DsmError::BoundsMissScene`],
/// [`DsmError::Value`], [`DsmError::Memory`] for a request that cannot be served;
/// [`DsmError::Prior`], [`DsmError::Image`], [`DsmError::Camera`], [`DsmError::Crs`],
/// [`DsmError::Reconstruct`]; [`DsmError::Cancelled`].
pub fn plan(config: &DsmConfig, pointed: &Pointed, session: &mut Session<'_>) -> Result<Plan, DsmError> {
    session.progress.check_cancelled()?;
    if config.reference_dem.is_some() && pointed.pointing.reference.is_none() {
        let found = "given, but the cameras were not moved onto it";
        return Err(DsmError::value(DsmSetting::ReferenceDem, found, "cameras from the stage that co-registers"));
    }
    let tuning = config.preset.tuning();
    let mut notes = Notes::resume(&pointed.choices, &pointed.warnings, session.progress);
    let images = &pointed.images;
    // They were told when the images were opened.
    notes.warnings.extend(images.iter().flat_map(|image| image.doubts.iter().cloned()));
    let (given, config) = (config, &in_order_of(config, images));
    let range = choose_heights(config, pointed, &mut notes)?;
    let geometry = SceneImage::geometry(images, middle_height_m(pointed.tie_heights, range))?;
    let gsds_m: Vec<Option<f64>> =
        (0..images.len()).map(|i| geometry.ground_sampling_m(&images[i].camera, i)).collect();
    let pixel_m = gsds_m.iter().flatten().copied().fold(0.0, f64::max);
    let grid = choose_grid(config, &geometry, pixel_m)?;
    note_grid(config, &grid, pixel_m, &mut notes);
    warn_of_masks(config, &grid, &mut notes)?;
    note_stated_views(images, &geometry, &mut notes);
    let sources = choose_sources(config, &geometry, pointed, &tuning, &mut notes)?;
    if let Some(path) = &config.prior {
        session.prior(path)?.note(&grid, &mut notes)?;
    }
    let widest = widest_parallax(&sources, &geometry);
    let scene = PlannedScene {
        config,
        pointed,
        grid: &grid,
        sources: &sources,
        geometry: &geometry,
        tuning: &tuning,
        widest,
        step_m: height_step_m(widest, &tuning),
        pixel_m,
    };
    let (height_range, chunk_side, chunks) = if pointed.is_whole {
        scene.at_once(range, session, &mut notes)?
    } else {
        scene.by_chunks(range, session, &mut notes)?
    };
    session.lap("planning");
    Ok(Plan {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        config: given.clone(),
        images: images.clone(),
        radiometry: pointed.radiometry.clone(),
        useful: pointed.useful.clone(),
        pixel_m,
        step_m: scene.step_m,
        height_range,
        chunk_side,
        chunks,
        report: PlanReport {
            images: image_reports(images, &gsds_m, &geometry, &pointed.corrections),
            pairs: pair_reports(images, &geometry, &pointed.ties),
            pointing: pointed.pointing.clone(),
        },
        grid,
        tuning,
        choices: notes.choices,
        warnings: notes.warnings,
    })
}

/// What is known of a scene before its chunks are planned.
struct PlannedScene<'a> {
    config: &'a DsmConfig,
    pointed: &'a Pointed,
    grid: &'a DsmGrid,
    sources: &'a [Vec<usize>],
    geometry: &'a ViewGeometry,
    tuning: &'a SweepTuning,
    /// Largest parallax of a pair, pixels per metre.
    widest: f64,
    step_m: f64,
    pixel_m: f64,
}

/// Heights of the scene, side of the chunks, chunks.
type Division = (HeightRange, Option<usize>, Vec<ChunkPlan>);

impl PlannedScene<'_> {
    /// Plans the scene as one chunk, whose windows are the whole images.
    fn at_once(
        &self,
        range: HeightRange,
        session: &mut Session<'_>,
        notes: &mut Notes<'_>,
    ) -> Result<Division, DsmError> {
        let images = &self.pointed.images;
        let windows: Vec<_> = images.iter().map(SceneImage::whole).collect();
        let sides = smallest_sides(&windows);
        let range = match self.config.height_range_m {
            Some(_) => range,
            None => self.with_towers(range, &sides, session, notes)?,
        };
        note_step(self.widest, self.tuning, notes);
        let levels = choose_levels(range, self.step_m, &sides, self.tuning);
        note_levels(levels, range, self.step_m, notes);
        let core = self.grid.whole();
        let sweep = ChunkSweep {
            extent: core,
            needed_mb: needed_mb(self.config, &windows, self.grid),
            windows: windows.into_iter().map(Some).collect(),
            sources: self.sources.to_vec(),
            height_range: range,
            levels,
        };
        Ok((range, None, vec![ChunkPlan { core, work: ChunkWork::Sweep(sweep) }]))
    }

    /// Extends the heights of the tie points by what stands outside them, see [`probe`].
    fn with_towers(
        &self,
        range: HeightRange,
        sides: &[usize],
        session: &mut Session<'_>,
        notes: &mut Notes<'_>,
    ) -> Result<HeightRange, DsmError> {
        let views = match session.views.take() {
            Some(views) => views,
            None => {
                let images = &self.pointed.images;
                let windows: Vec<_> = images.iter().map(|image| Some(image.whole())).collect();
                read_chunk_views(images, &self.pointed.radiometry, &windows, read_view)?
            }
        };
        let sweep = SceneSweep::new(range, self.step_m, SweepLevels::only(0), self.sources.to_vec(), self.tuning);
        let found = probe::extended_range(&views, &sweep, self.pixel_m, sides, &Muted(session.progress));
        session.views = Some(views);
        let Some(found) = found? else { return Ok(range) };
        let HeightRange { low_m, high_m } = found.range;
        let reason = format!("{} pixels of a coarse sweep show what no tie point does", found.pixels);
        notes.choose("height range", format!("{low_m:.1} to {high_m:.1} m"), reason);
        Ok(found.range)
    }

    /// Divides the scene, or the part of it inside the bounds, into chunks. A part that fits the
    /// memory is one chunk.
    fn by_chunks(
        &self,
        range: HeightRange,
        session: &Session<'_>,
        notes: &mut Notes<'_>,
    ) -> Result<Division, DsmError> {
        let config = self.config;
        note_step(self.widest, self.tuning, notes);
        let side = choose_side(config, &self.pointed.images, self.grid, range)?;
        let planner = ChunkPlanner {
            config,
            tuning: self.tuning,
            images: &self.pointed.images,
            radiometry: &self.pointed.radiometry,
            grid: self.grid,
            projection: &self.grid.projection()?,
            candidates: source_candidates(config, self.geometry, self.pointed, self.tuning),
            geometry: self.geometry,
            step_m: self.step_m,
            pixel_m: self.pixel_m,
            range,
            progress: session.progress,
        };
        let chunks = planner.chunks(cores(self.grid.size, side))?;
        if let [only] = &chunks[..] {
            let ChunkWork::Sweep(sweep) = &only.work else {
                let found = "an area that fewer than two images see";
                return Err(DsmError::value(DsmSetting::Bounds, found, "an area that at least two images see"));
            };
            note_levels(sweep.levels, sweep.height_range, self.step_m, notes);
            return Ok((sweep.height_range, None, chunks));
        }
        let reason = match config.chunk {
            Some(_) => "given".to_owned(),
            None => format!("the largest that {} MB allow", memory::limit_mb(config)),
        };
        notes.choose("chunks", format!("{} of up to {side} cells a side", chunks.len()), reason);
        Ok((range, Some(side), chunks))
    }
}

/// Warns of STAC items that state another line of sight than the RPC has.
fn note_stated_views(images: &[SceneImage], geometry: &ViewGeometry, notes: &mut Notes<'_>) {
    for (i, image) in images.iter().enumerate() {
        let Some(stated_deg) = image.stated_incidence_deg else { continue };
        let Some(found_deg) = incidence_deg(image, geometry, i) else { continue };
        if (stated_deg - found_deg).abs() > STATED_VIEW_DEG {
            notes.warn(format!(
                "the item states an incidence angle of {stated_deg:.1}°, the RPC has {found_deg:.1}°: check whether they \
                 belong to one image: {}",
                image.path.display()
            ));
        }
    }
}

/// Returns the angle of the line of sight to the vertical, degrees.
fn incidence_deg(image: &SceneImage, geometry: &ViewGeometry, number: usize) -> Option<f64> {
    image.camera.view_direction(geometry.middle_of(number)).ok().map(|v| v.incidence_deg())
}

fn image_reports(
    images: &[SceneImage],
    gsds_m: &[Option<f64>],
    geometry: &ViewGeometry,
    corrections: &[ImageCorrection],
) -> Vec<ImageReport> {
    let one = |(i, image): (usize, &SceneImage)| ImageReport {
        path: image.path.clone(),
        rpc: image.rpc_format.clone(),
        size: image.size,
        acquired: image.acquired_s.and_then(iso_time),
        satellite: image.satellite.clone(),
        sun: image.sun,
        gsd_m: gsds_m.get(i).copied().flatten(),
        incidence_deg: incidence_deg(image, geometry, i),
        correction: corrections.get(i).copied(),
        applied_correction: image.camera.correction,
    };
    let mut all: Vec<(usize, ImageReport)> = images.iter().enumerate().map(|(i, o)| (o.number, one((i, o)))).collect();
    all.sort_by_key(|(number, _)| *number);
    all.into_iter().map(|(_, report)| report).collect()
}

fn pair_reports(images: &[SceneImage], geometry: &ViewGeometry, ties: &[PairTies]) -> Vec<PairReport> {
    let one = |t: &PairTies| {
        let geometry = geometry.pair(t.pair).copied()?;
        let ImagePair { first, second } = as_given(t.pair, images);
        Some(PairReport { images: (first + 1, second + 1), geometry, ties: t.ties.len() })
    };
    ties.iter().filter_map(one).collect()
}
