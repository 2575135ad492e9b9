//! Stage between the pointing and the plan: co-registration to a reference elevation model.
//!
//! A trial DSM of half the resolution is made with the pointing found so far and aligned with the
//! reference: the horizontal shift with the least NMAD, and the median of the differences. All
//! cameras are moved by that shift. A second trial DSM of the run's own preset then measures what
//! is left, because edges are found to a fraction of a pixel only, and the cameras are moved by
//! that. Where much was left, a third one tells whether the shifts converge.
//!
//! A shift without evidence is an error: a reference beside the scene, surfaces that differ too
//! much, relief that fits hardly better at the shift than elsewhere or whose parts find shifts of
//! their own, or shifts that do not converge. The standard error of the shift follows from those of
//! the parts and is reported.

use std::collections::BTreeSet;
use std::path::Path;

use camera::{ImageCorrection, ImagePoint, RpcCamera};
use crs::{MapProjection, VerticalDatum};
use eval::{MetresFromCells, Registration, Shift, register_surfaces};
use geodesy::LonLatHeight;
use numeric::{Muted, Silent, nearest_quantile};
use raster::{Grid, reduce};
use reconstruct::{DsmGrid, Fill, HeightRange, Preset};

use crate::chunks::chunk::{ChunkContent, run_chunk};
use crate::config::DsmConfig;
use crate::error::{DsmError, DsmSetting};
use crate::georeferencing::control::GroundControl;
use crate::georeferencing::plane_fit::FittedPlane;
use crate::georeferencing::reference_dem::reference_on;
use crate::images::scene_image::SceneImage;
use crate::notes::Notes;
use crate::planning::chunk_plan::ChunkWork;
use crate::planning::dem::warn_of_datum;
use crate::planning::grid::choose_grid;
use crate::planning::plan::{Plan, plan};
use crate::pointing::point::Pointed;
use crate::report::ReferenceReport;
use crate::session::Session;

/// Largest horizontal shift that is searched for, and largest vertical shift that is believed,
/// metres. Providers state errors of up to 10 m; a larger difference of heights is one of datums or
/// units.
const SEARCH_M: f64 = 25.0;
/// Most cells of the trial DSM. A larger scene gets larger cells.
const CELLS_MAX: f64 = 16e6;
/// Most chunks of a large scene that are swept for the trial DSM.
const CHUNKS_MAX: usize = 16;
/// Multiples of the golden ratio, modulo one, are spread evenly however many there are. So are the
/// chunks at these parts of their list, over its rows and over the columns.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;
/// Least part of the scene's width and height that the common cells must span for a plane: beyond
/// them it is extrapolated.
const PLANE_SPAN_MIN: f64 = 0.6;
/// Least number of cells that both surfaces have.
const COMMON_MIN: usize = 1000;
/// Least share of the trial DSM's observed cells that the reference has too.
const COMMON_SHARE_MIN: f64 = 0.2;
/// Greatest NMAD of the differences after the alignment, metres. Global elevation models of 30 m
/// stay below it in mountains.
const NMAD_MAX_M: f64 = 8.0;
/// Greatest standard error of the horizontal shift, and greatest shift that may be left after the
/// cameras were moved, cells of the coarser surface and metres on top of them. Parts of one scene
/// that find shifts by chance have a standard error of three cells.
const ERROR_CELLS: f64 = 0.2;
const ERROR_M: f64 = 0.5;
/// Standard errors that belong to what may be left.
const LEFT_ERRORS: f64 = 2.0;
/// Trial surfaces after which the shifts must have converged.
const TRIALS_MAX: usize = 3;
/// Least ratio of the NMAD that a typical shift of the search leaves to that of the best one. Of
/// relief that has nothing to do with the scene it is one, but for the chance of the best.
const CONTRAST_MIN: f64 = 1.1;
/// Rounds of the fit of the plane, each of which leaves out what is further off than
/// [`PLANE_NMADS`].
const PLANE_ROUNDS: usize = 4;
const PLANE_NMADS: f64 = 3.0;
/// A reference is taken for the bare ground when a twentieth of the cells stand this far above it,
/// metres, and that many times as far as the twentieth below it. Buildings and trees are higher
/// than that; errors of surfaces, and trees and houses that only one of both has, reach to both
/// sides. Chosen on the sample town.
const STANDING_MIN_M: f64 = 3.0;
const ONE_SIDED: f64 = 3.0;
/// Share of the cells beyond the reach of a surface, at either end.
const BEYOND: f64 = 0.05;
/// A plane that changes nothing.
const LEVEL: FittedPlane = FittedPlane { centre: [0.0; 2], offset: 0.0, slope: [0.0; 2] };
/// Places per side of an image at which the old and the new camera are compared.
const CAMERA_STEPS: usize = 6;

/// Moves the cameras so that the surface agrees with the reference elevation model of the
/// configuration. Without one it returns `pointed` unchanged.
///
/// # Errors
/// [`DsmError::Reference`] where the evidence for a shift is too weak, [`DsmError::Value`] for a
/// reference that cannot be used or control points beside it, and the errors of [`plan()`] and
/// [`run_chunk`].
pub fn register(config: &DsmConfig, mut pointed: Pointed, session: &mut Session<'_>) -> Result<Pointed, DsmError> {
    let Some(path) = config.reference_dem.as_deref() else { return Ok(pointed) };
    if pointed.pointing.control.as_ref().is_some_and(|control| !control.control.is_empty()) {
        let found = "given beside control points, which place the scene too";
        return Err(DsmError::value(DsmSetting::ReferenceDem, found, "one of the two; check points may be given"));
    }
    if !pointed.pointing.applied {
        return Err(weak(path, "the images have too few tie points to agree with each other".to_owned()));
    }
    let mut notes = Notes::resume(&pointed.choices, &pointed.warnings, session.progress);
    session.progress.begin("co-registering", 2);
    let mut rounds: Vec<Round> = Vec::new();
    loop {
        let preset = if rounds.is_empty() { Preset::Fast } else { config.preset };
        let round = Round::of(config, preset, &pointed, session)?;
        if rounds.is_empty() {
            warn_of_datum(path, config.dem_vertical, round.named, &mut notes);
        }
        round.check(path)?;
        round.apply(config, &mut pointed)?;
        session.progress.step();
        rounds.push(round);
        if let [first, .., last] = &rounds[..] {
            if last.length_m() <= last.left_m(first) {
                break;
            }
            if rounds.len() == TRIALS_MAX {
                return Err(weak(
                    path,
                    format!(
                        "the shifts do not converge: the surface was moved by {} m in turn, and at most {:.2} m may be \
                         left; {}",
                        rounds.iter().map(|round| format!("{:.2}", round.length_m())).collect::<Vec<_>>().join(", "),
                        last.left_m(first),
                        last.likely_cause()
                    ),
                ));
            }
        }
    }
    let [first, .., last] = &rounds[..] else { return Ok(pointed) };
    last.warn_of_bare_ground(path, &mut notes);
    let plane = |axis: usize| 1e3 * rounds.iter().map(|round| round.plane.slope[axis]).sum::<f64>();
    let report = ReferenceReport {
        path: path.to_owned(),
        shift_m: std::array::from_fn(|axis| rounds.iter().map(|round| round.shift_m()[axis]).sum()),
        deviation_m: last.deviation_m,
        plane_m_per_km: config.reference_plane.then(|| [0, 1].map(plane)),
        cells: last.common,
        nmad_before_m: first.nmad_m.0,
        nmad_after_m: last.nmad_m.1,
        contrast: last.contrast,
        last_shift_m: last.length_m(),
    };
    let ([dx, dy, dz], [ex, ey, ez]) = (report.shift_m, report.deviation_m);
    notes.choose(
        "reference",
        format!("surface moved by {dx:.2} m east, {dy:.2} m north, {dz:.2} m up"),
        format!(
            "NMAD against the reference {:.2} m before, {:.2} m after; standard error {ex:.2}, {ey:.2}, {ez:.2} m",
            report.nmad_before_m, report.nmad_after_m
        ),
    );
    if let (Some(control), Some(points)) = (&mut pointed.pointing.control, &config.control) {
        let cameras: Vec<RpcCamera> = pointed.images.iter().map(|image| image.camera.clone()).collect();
        GroundControl::read(Some(points), &pointed.images, &mut Notes::new(&Silent))?
            .measure_again(control, &cameras, &mut notes);
    }
    pointed.pointing.reference = Some(report);
    (pointed.choices, pointed.warnings) = (notes.choices, notes.warnings);
    session.lap("co-registration");
    Ok(pointed)
}

fn weak(path: &Path, reason: String) -> DsmError {
    DsmError::Reference { path: path.to_owned(), reason }
}

/// A trial DSM compared with the reference.
struct Round {
    grid: DsmGrid,
    heights: HeightRange,
    /// Shift of the surface on the map of the grid.
    shift: Shift,
    /// What is added to the vertical shift, over the map.
    plane: FittedPlane,
    /// Standard errors of the shift, metres.
    deviation_m: [f64; 3],
    /// NMAD of a typical shift over that of the best.
    contrast: f64,
    /// Whether the shift lies at the edge of the search.
    is_at_edge: bool,
    /// Number of cells that both surfaces have.
    common: usize,
    /// NMAD of the differences before and after, metres.
    nmad_m: (f64, f64),
    /// Cell of the coarser surface, metres.
    cell_m: f64,
    /// How far the surface reaches below and above the reference, metres.
    reach_m: [f64; 2],
    /// The datum that the reference names.
    named: Option<VerticalDatum>,
}

impl Round {
    fn of(config: &DsmConfig, preset: Preset, pointed: &Pointed, session: &mut Session<'_>) -> Result<Self, DsmError> {
        let Some(path) = config.reference_dem.as_deref() else {
            return Err(DsmError::value(DsmSetting::ReferenceDem, "missing", "a file"));
        };
        let trial = trial_surface(config, preset, pointed, session)?;
        let mut grid = trial.grid;
        let mut surface = trial.surface;
        let mut reference = reference_on(path, config.dem_vertical, &grid)?;
        // A coarse reference is compared with the mean heights of cells like its own.
        while 2.0 * grid.gsd_m <= reference.cell_m && grid.size.0.min(grid.size.1) > 64 {
            surface = reduce(&surface);
            let c = grid.geotransform.0;
            let doubled = [c[0], 2.0 * c[1], 2.0 * c[2], c[3], 2.0 * c[4], 2.0 * c[5]];
            grid.geotransform = raster::GeoTransform(doubled);
            (grid.size, grid.gsd_m) = ((surface.width(), surface.height()), 2.0 * grid.gsd_m);
            reference = reference_on(path, config.dem_vertical, &grid)?;
        }
        let common = surface.data().iter().zip(reference.heights.data());
        let common = common.filter(|(a, b)| a.is_finite() && b.is_finite()).count();
        let observed = surface.data().iter().filter(|height| height.is_finite()).count();
        let share = common as f64 / observed.max(1) as f64;
        if common < COMMON_MIN || share < COMMON_SHARE_MIN {
            return Err(weak(
                path,
                format!(
                    "it has heights at {common} cells of {} m, {:.0} % of those that the images show; \
                     needed are {COMMON_MIN} cells and {:.0} %",
                    grid.gsd_m,
                    100.0 * share,
                    100.0 * COMMON_SHARE_MIN
                ),
            ));
        }
        let metres = MetresFromCells::new(&grid.geotransform, (1.0, 1.0));
        let aligned = |surface: &Grid<f32>| {
            let found = register_surfaces(surface, &reference.heights, metres, SEARCH_M);
            found.map_err(|error| weak(path, error.to_string()))
        };
        let (mut found, mut plane) = (aligned(&surface)?, LEVEL);
        if config.reference_plane {
            let fitted = known_plane(&found, &grid, (&surface, &reference.heights));
            plane = fitted.map_err(|reason| weak(path, reason))?;
            // A tilt looks like a shift where slopes face one way.
            add_plane(&mut surface, &plane, &grid);
            found = aligned(&surface)?;
        }
        let parts = "it shares heights with too few parts of the scene to tell how well the shift is known";
        Ok(Self {
            heights: trial.heights,
            shift: found.shift,
            deviation_m: found.deviation_m.ok_or_else(|| weak(path, parts.to_owned()))?,
            contrast: found.contrast,
            is_at_edge: found.is_at_edge,
            plane,
            common,
            nmad_m: found.nmad_m,
            cell_m: reference.cell_m.max(grid.gsd_m),
            reach_m: reach_m(&found.errors),
            named: reference.named,
            grid,
        })
    }

    /// Refuses a shift without evidence.
    fn check(&self, path: &Path) -> Result<(), DsmError> {
        let reason = if self.is_at_edge {
            format!("the shift seems to be larger than the {SEARCH_M} m that are searched")
        } else if self.nmad_m.1.is_nan() || self.nmad_m.1 > NMAD_MAX_M {
            format!(
                "the surfaces differ by {:.1} m (NMAD) after the alignment, at most {NMAD_MAX_M} m are trusted",
                self.nmad_m.1
            )
        } else if self.contrast < CONTRAST_MIN {
            format!(
                "an NMAD of {:.2} m is left, and any other shift leaves hardly more, {:.2} times as much where at \
                 least {CONTRAST_MIN} are needed: one of the surfaces is flat, or their relief is not the same",
                self.nmad_m.1, self.contrast
            )
        } else if self.shift_m()[2].abs() > SEARCH_M {
            format!(
                "the scene would be moved by {:.1} m in height, more than {SEARCH_M} m; check what its heights are above, \
                 and that they are in metres",
                self.shift_m()[2]
            )
        } else if self.horizontal_error_m() > self.tolerance_m() {
            format!(
                "the relief does not tell the shift: the parts of the scene leave a standard error of {:.2} m, at most \
                 {:.2} m are trusted",
                self.horizontal_error_m(),
                self.tolerance_m()
            )
        } else {
            return Ok(());
        };
        Err(weak(path, format!("{reason}; {}", self.likely_cause())))
    }

    /// Says what a reference that does not fit may be, and what to do next.
    fn likely_cause(&self) -> &'static str {
        if self.is_one_sided() {
            "it looks like a model of the bare ground, which lacks the scene's roofs and trees: give a surface model"
        } else {
            "check that it shows this place at about the time of the images, or leave it out"
        }
    }

    /// Returns whether the surface stands above the reference, but hardly reaches below.
    fn is_one_sided(&self) -> bool {
        let [below_m, above_m] = self.reach_m;
        above_m > STANDING_MIN_M && above_m > ONE_SIDED * below_m
    }

    fn horizontal_error_m(&self) -> f64 {
        self.deviation_m[0].hypot(self.deviation_m[1])
    }

    /// Returns the length of the shift that may be left after the cameras were moved by the first.
    fn left_m(&self, first: &Self) -> f64 {
        let both = self.deviation_m.iter().chain(&first.deviation_m).map(|m| m * m).sum::<f64>().sqrt();
        self.tolerance_m() + LEFT_ERRORS * both
    }

    /// Warns of a reference that the surface stands above, but hardly reaches below.
    fn warn_of_bare_ground(&self, path: &Path, notes: &mut Notes<'_>) {
        if self.is_one_sided() {
            let above_m = self.reach_m[1];
            notes.warn(format!(
                "the reference looks like a model of the bare ground: a twentieth of the scene stands {above_m:.1} m or \
                 more above it, and hardly anything lies below; roofs and trees pull the scene down then, use a surface \
                 model: {}",
                path.display()
            ));
        }
    }

    fn tolerance_m(&self) -> f64 {
        ERROR_M + ERROR_CELLS * self.cell_m
    }

    fn shift_m(&self) -> [f64; 3] {
        [self.shift.dx_m, self.shift.dy_m, self.shift.dz_m + self.plane.offset]
    }

    fn length_m(&self) -> f64 {
        self.shift_m().iter().map(|m| m * m).sum::<f64>().sqrt()
    }

    /// Moves the cameras, and the heights that the tie points showed with them.
    fn apply(&self, config: &DsmConfig, pointed: &mut Pointed) -> Result<(), DsmError> {
        let projection = self.grid.projection()?;
        for image in &mut pointed.images {
            let moved = self.moved(image, &projection);
            image.camera.correction = moved.ok_or_else(|| {
                let reason = format!("the camera cannot be moved: {}", image.path.display());
                weak(config.reference_dem.as_deref().unwrap_or(Path::new("")), reason)
            })?;
        }
        let dz = self.shift_m()[2];
        let (width, height) = (self.grid.size.0 as f64, self.grid.size.1 as f64);
        let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)].map(|(column, row)| {
            let (x, y) = self.grid.geotransform.map_from_cell(column, row);
            (self.plane.at([x, y]) - self.plane.offset).abs()
        });
        let tilt = corners.into_iter().fold(0.0, f64::max);
        pointed.tie_heights = pointed.tie_heights.map(|range| range.grown(tilt - dz, tilt + dz));
        Ok(())
    }

    /// Returns the correction with which a camera sees the moved ground where it saw the ground
    /// before.
    fn moved(&self, image: &SceneImage, projection: &MapProjection) -> Option<ImageCorrection> {
        let plain = RpcCamera::new(image.camera.rpc.clone());
        let mut seen: Vec<(ImagePoint, ImagePoint)> = Vec::new();
        for height_m in [self.heights.low_m, self.heights.high_m] {
            for step in 0..CAMERA_STEPS * CAMERA_STEPS {
                let share = |i: usize, size: usize| (i as f64 + 0.5) / CAMERA_STEPS as f64 * size as f64;
                let at =
                    ImagePoint::new(share(step % CAMERA_STEPS, image.size.0), share(step / CAMERA_STEPS, image.size.1));
                let ground = image.camera.localize(at, height_m).ok()?;
                seen.push((plain.project(self.moved_ground(ground, projection)?).ok()?, at));
            }
        }
        let fit = |value: fn(ImagePoint, ImagePoint) -> f64| {
            FittedPlane::fit(seen.iter().map(|&(from, to)| ([from.sample, from.line], value(from, to))))
        };
        let sample = fit(|from, to| to.sample - from.sample)?;
        let line = fit(|from, to| to.line - from.line)?;
        Some(ImageCorrection {
            translation_px: [sample.offset, line.offset],
            linear: [sample.slope, line.slope],
            centre: ImagePoint::new(sample.centre[0], sample.centre[1]),
        })
    }

    fn moved_ground(&self, ground: LonLatHeight, projection: &MapProjection) -> Option<LonLatHeight> {
        let map = projection.map_from_lonlat(ground.lon_deg, ground.lat_deg).ok()?;
        let (lon, lat) = projection.lonlat_from_map(map.x + self.shift.dx_m, map.y + self.shift.dy_m).ok()?;
        let up = self.shift.dz_m + self.plane.at([map.x, map.y]);
        Some(LonLatHeight::new(lon, lat, ground.height_m + up))
    }
}

/// A DSM of the whole scene that is made to be compared.
struct TrialSurface {
    grid: DsmGrid,
    /// Observed heights above the ellipsoid, metres; NaN elsewhere.
    surface: Grid<f32>,
    /// Heights that were searched.
    heights: HeightRange,
}

/// Makes a DSM of the whole scene with the pointing found so far. It has a large scene's chunks
/// only in part.
fn trial_surface(
    config: &DsmConfig,
    preset: Preset,
    pointed: &Pointed,
    session: &mut Session<'_>,
) -> Result<TrialSurface, DsmError> {
    let muted = Muted(session.progress);
    let mut own = Session::new(&muted);
    own.views = session.views.take();
    // The whole scene, so that runs with other bounds and cells find the same pointing.
    let mut trial = DsmConfig {
        preset,
        fill: Fill::None,
        gsd_m: None,
        bounds: None,
        bounds_epsg: None,
        area: None,
        crs_epsg: None,
        vertical: VerticalDatum::Ellipsoid,
        prior: None,
        references: None,
        reference_dem: None,
        reference_plane: false,
        chunk: None,
        ..config.clone()
    };
    // Heights that are given hold for the scene where the reference puts it, not where it is.
    let mut pointed = pointed.clone();
    if pointed.tie_heights.is_some() {
        (trial.height_range_m, trial.dem, trial.dem_vertical, pointed.dem_heights) = (None, None, None, None);
    }
    let pointed = &pointed;
    trial.gsd_m = Some(trial_cell_m(&trial, pointed)?);
    let planned = plan(&trial, pointed, &mut own)?;
    let mut surface = Grid::filled(planned.grid.size.0, planned.grid.size.1, f32::NAN);
    for index in spread_chunks(&planned) {
        let result = match run_chunk(&planned, index, &mut own) {
            // A part of a large scene that cannot be computed is left out of the product, too.
            Err(error) if planned.chunk_side.is_some() && !matches!(error, DsmError::Cancelled) => continue,
            result => result?,
        };
        let ChunkContent::Surface(found) = result.content else { continue };
        let (core, rasters) = (result.core, &found.rasters);
        for row in 0..core.height {
            for column in 0..core.width {
                if rasters.filled[(column, row)] == 0 {
                    let height = rasters.origin_m + f64::from(rasters.height_m[(column, row)]);
                    surface[(core.x as usize + column, core.y as usize + row)] = height as f32;
                }
            }
        }
    }
    Ok(TrialSurface { grid: planned.grid, surface, heights: planned.height_range })
}

/// Returns the chunks that are swept for a trial DSM: all, or some from all over the scene.
fn spread_chunks(plan: &Plan) -> BTreeSet<usize> {
    let is_swept = |index: &usize| matches!(plan.chunks[*index].work, ChunkWork::Sweep(_));
    let swept: Vec<usize> = (0..plan.chunks.len()).filter(is_swept).collect();
    if swept.len() <= CHUNKS_MAX {
        return swept.into_iter().collect();
    }
    let at = |i: usize| swept[((i as f64 * GOLDEN_RATIO).fract() * swept.len() as f64) as usize];
    (0..CHUNKS_MAX).map(at).collect()
}

/// Returns the cell of the trial DSM, metres: a pixel, so that the places of roofs do not depend on
/// the phase of the grid, or more for a large scene.
fn trial_cell_m(trial: &DsmConfig, pointed: &Pointed) -> Result<f64, DsmError> {
    let images = &pointed.images;
    let offsets = || images.iter().map(|image| image.camera.rpc.height_off).sum::<f64>() / images.len() as f64;
    let height_m = pointed.tie_heights.map_or_else(offsets, HeightRange::middle_m);
    let geometry = SceneImage::geometry(images, height_m)?;
    let pixel_m = geometry.coarsest_sampling_m(images.iter().map(|image| &image.camera));
    let grid = choose_grid(&DsmConfig { gsd_m: Some(pixel_m), ..trial.clone() }, &geometry, pixel_m)?;
    let cells = grid.size.0 as f64 * grid.size.1 as f64;
    Ok(pixel_m * (cells / CELLS_MAX).sqrt().max(1.0))
}

/// Returns how far the errors reach below and above their median, without [`BEYOND`] at either end.
fn reach_m(errors: &Grid<f32>) -> [f64; 2] {
    let mut errors: Vec<f64> =
        errors.data().iter().filter(|error| error.is_finite()).map(|error| f64::from(*error)).collect();
    let mut at = |share| nearest_quantile(&mut errors, share).unwrap_or(0.0);
    let (low, middle, high) = (at(BEYOND), at(0.5), at(1.0 - BEYOND));
    [middle - low, high - middle]
}

/// Returns the columns and rows that the cells of a surface span, those that `is_used`.
fn spanned(surface: &Grid<f32>, is_used: impl Fn(usize) -> bool) -> [usize; 2] {
    let width = surface.width();
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for (i, _) in surface.data().iter().enumerate().filter(|(i, height)| height.is_finite() && is_used(*i)) {
        for (axis, at) in [i % width, i / width].into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at + 1));
        }
    }
    [0, 1].map(|axis: usize| high[axis].saturating_sub(low[axis]))
}

/// Returns [`plane_of`], or why the reference shows no plane over the whole surface.
fn known_plane(
    aligned: &Registration,
    grid: &DsmGrid,
    (surface, reference): (&Grid<f32>, &Grid<f32>),
) -> Result<FittedPlane, String> {
    let (whole, common) = (spanned(surface, |_| true), spanned(surface, |i| reference.data()[i].is_finite()));
    let shares = [0, 1].map(|axis| common[axis] as f64 / whole[axis].max(1) as f64);
    let is_wide = shares.iter().all(|share| *share >= PLANE_SPAN_MIN);
    plane_of(aligned, grid).filter(|_| is_wide).ok_or_else(|| {
        let [width, height] = shares.map(|share| 100.0 * share);
        let least = 100.0 * PLANE_SPAN_MIN;
        format!("for a plane it spans too little of the scene, {width:.0} % by {height:.0} %; needed are {least:.0} %")
    })
}

/// Adds the heights of a plane to a surface.
fn add_plane(surface: &mut Grid<f32>, plane: &FittedPlane, grid: &DsmGrid) {
    for row in 0..surface.height() {
        for (column, height) in surface.row_mut(row).iter_mut().enumerate() {
            let (x, y) = grid.geotransform.map_from_cell(column as f64, row as f64);
            *height += plane.at([x, y]) as f32;
        }
    }
}

/// Returns what must be added to the heights beyond the shift: a robust plane through the remaining
/// differences.
fn plane_of(aligned: &Registration, grid: &DsmGrid) -> Option<FittedPlane> {
    let width = aligned.errors.width();
    let place = |i: usize| {
        let (x, y) = grid.geotransform.map_from_cell((i % width) as f64, (i / width) as f64);
        [x, y]
    };
    let errors = aligned.errors.data().iter().enumerate().filter(|(_, error)| error.is_finite());
    let samples: Vec<([f64; 2], f64)> = errors.map(|(i, error)| (place(i), -f64::from(*error))).collect();
    let mut plane = LEVEL;
    for _ in 0..PLANE_ROUNDS {
        let off = |(at, value): &([f64; 2], f64)| value - plane.at(*at);
        let limit = PLANE_NMADS * numeric::upper_nmad(&mut samples.iter().map(off).collect::<Vec<f64>>())?;
        let near: Vec<_> = samples.iter().filter(|sample| off(sample).abs() <= limit).copied().collect();
        plane = FittedPlane::fit(near.into_iter())?;
    }
    Some(plane)
}
