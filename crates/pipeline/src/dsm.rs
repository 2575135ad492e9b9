//! The DSM job, from images to files.

use std::time::Instant;

use camera::ImagePoint;
use raster::{Grid, Window};
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::fusion::{
    FillConfig, FusionConfig, GridFrame, PlacedView, fill_voids, fuse_views, place_view, remove_speckle,
};
use sweep::pointing::{AdjustConfig, Adjustment, ModelOrder};
use sweep::{HeightMap, View};

use crate::config::DsmConfig;
use crate::error::PipelineError;
use crate::first_look::{Looked, asked_pairs, look, ordered, pair_names};
use crate::heights::{SceneHeights, SweepPlan, sweep_scene};
use crate::memory;
use crate::output::{self, FILLED, Product};
use crate::pictures;
use crate::pointing::{PairTies, adjust_views};
use crate::progress::Progress;
use crate::report::{DsmReport, ImageReport, PairReport, PointingReport, StageTime, SurfaceReport};
use crate::scene::{Geometry, Opened, open};
use crate::setup::{self, Choices, EARTH_RANGE_M, OutputGrid};

/// Isolated patches of less ground than a square of this side are speckle: smaller than a house, metres.
const SPECKLE_SIDE_M: f64 = 5.0;
/// … and never of fewer cells than this, whatever the grid.
const SPECKLE_CELLS_MIN: usize = 9;
/// Where no two views are further apart than this, heights are ten times less precise than positions, and the user is told.
const ANGLE_WEAK_DEG: f64 = 3.0;
/// Smaller output tiles cost more to manage than to fill, cells.
const TILE_MIN: usize = 64;
/// Heights around a void are looked for within this many metres: the shadow side of a tower.
const FILL_REACH_M: f64 = 40.0;
/// Voids up to this many metres across are closed: the shadow side of a house.
const FILL_NARROW_M: f64 = 10.0;
/// A surface hides what is this many times its height away: views lean by up to 30°, and shadows reach further.
const FILL_HIDDEN: f64 = 1.0;
/// Heights around a void that differ by more than this per metre between them are two surfaces: steeper than streets.
const FILL_SLOPE: f64 = 0.05;
/// A facet steeper than this (rise over run) is a tear, not a surface: about 70°. Two hypotheses apart is no tear yet.
const TEAR_SLOPE: f64 = 2.75;

/// A height around which the views agree on less of the picture's contrast than this has no picture behind it: the best of
/// several unrelated pictures reaches nearly this.
const SUPPORT_MIN: f32 = 0.2;
/// A height that stands out from all others by less than this, of the worst cost, may be chance, as on water: what is known
/// around says more. Half of it and twice it are alike on simulated towns; JAX_068 gains in completeness with every set of its
/// views, and loses 0.02 m of MAE with one pair.
const CONFIDENCE_MIN: f32 = 0.1;

/// Runs a DSM job and writes its results.
///
/// # Errors
/// See [`PipelineError`]; nothing is left half-written.
pub fn run_dsm(config: &DsmConfig, progress: &dyn Progress) -> Result<DsmReport, PipelineError> {
    validate(config)?;
    output::check_target(config)?;
    let threads = config.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| PipelineError::Threads { threads, reason: e.to_string() })?;
    pool.install(|| Job::new(config, progress).run())
}

/// Looks at everything that can be wrong with a request before any file is opened.
fn validate(config: &DsmConfig) -> Result<(), PipelineError> {
    if config.images.len() < 2 {
        return Err(PipelineError::TooFewImages { found: config.images.len() });
    }
    for (i, path) in config.images.iter().enumerate() {
        if config.images[..i].contains(path) {
            return Err(PipelineError::SameImage { path: path.clone() });
        }
    }
    let value =
        |name, found: String, expected: &str| Err(PipelineError::Value { name, found, expected: expected.to_owned() });
    if let Some(gsd) = config.gsd_m
        && !(gsd.is_finite() && gsd > 0.0)
    {
        return value("--gsd", gsd.to_string(), "a positive cell size in metres");
    }
    if let Some((lo, hi)) = config.height_range_m
        && !(EARTH_RANGE_M.0 <= lo && lo < hi && hi <= EARTH_RANGE_M.1)
    {
        return value(
            "--height-range",
            format!("{lo} {hi}"),
            "two heights of the Earth's surface in metres above the ellipsoid, the lower first",
        );
    }
    if let Some(b) = config.bounds
        && !(b.iter().all(|v| v.is_finite()) && b[0] < b[2] && b[1] < b[3])
    {
        return value("--bounds", format!("{b:?}"), "x_min y_min x_max y_max in the DSM's CRS");
    }
    if config.tile < TILE_MIN {
        return value("--tile", config.tile.to_string(), "64 or more cells");
    }
    if config.threads == Some(0) {
        return value("--threads", "0".to_owned(), "1 or more");
    }
    let n = config.images.len();
    let views =
        config.pairs.iter().flatten().flat_map(|&(i, j)| [i, j]).chain(config.references.iter().flatten().copied());
    if let Some(bad) = views.into_iter().find(|&v| v >= n) {
        return value("--pairs or --reference", (bad + 1).to_string(), &format!("an image's position, 1 to {n}"));
    }
    Ok(())
}

struct Job<'a> {
    config: &'a DsmConfig,
    progress: &'a dyn Progress,
    choices: Choices<'a>,
    times: Vec<StageTime>,
    since: Instant,
}

impl<'a> Job<'a> {
    fn new(config: &'a DsmConfig, progress: &'a dyn Progress) -> Self {
        let choices = Choices { made: Vec::new(), warnings: Vec::new(), progress };
        Self { config, progress, choices, times: Vec::new(), since: Instant::now() }
    }

    fn lap(&mut self, stage: &str) {
        lap(&mut self.times, &mut self.since, stage);
    }

    fn run(mut self) -> Result<DsmReport, PipelineError> {
        let config = self.config;
        let tuning = config.preset.tuning();
        let mut images = open(&config.images)?;
        let Looked { first, useful, windows, mut views, ties } = {
            let (times, since) = (&mut self.times, &mut self.since);
            look(config, &images, self.progress, &mut |stage| lap(times, since, stage))?
        };
        self.check_pictures(&views, &windows, &ties)?;
        let (adjustment, tracks) = adjust_views(&views, &ties, &AdjustConfig::default());
        let pointed = self.point(&mut images, &mut views, &windows, &adjustment);
        let useful = if pointed { self.connected(useful, &ties) } else { useful };
        let pairs = self.pairs(&useful, &first)?;
        self.lap("pointing");

        let dem_span = self.dem_span(&first)?;
        let range = setup::height_range(config, dem_span, &adjustment, &mut self.choices)?;
        let middle = setup::middle_height(&adjustment, range);
        let geometry = Geometry::at(&images, middle)?;
        let gsds: Vec<Option<f64>> = images.iter().map(|o| setup::ground_sampling(o, geometry.centre)).collect();
        let coarsest = gsds.iter().flatten().copied().fold(0.0, f64::max);
        let grid = setup::choose_grid(config, &geometry, coarsest, &mut self.choices)?;
        let sources = setup::choose_sources(config, &geometry, &pairs, &ties, &tuning, &mut self.choices)?;
        let found = (sources.as_slice(), &geometry);
        let range = setup::with_towers(config, range, &views, found, coarsest, &tuning, &mut self.choices)?;
        let sides = setup::smallest_sides(&views);
        let plan = setup::plan_sweep(range, sources, &geometry, &sides, &tuning, &mut self.choices);

        self.progress.begin("sweeping heights", views.len() * (plan.top_level - plan.bottom_level + 1));
        let heights = sweep_scene(&views, &plan, &|| self.progress.step())?;
        self.lap("sweep");
        let evaluations = heights.evaluations;
        let (product, surface) = self.surface(&views, &plan, &useful, heights, &grid)?;
        self.lap("fusion");

        self.progress.begin("writing", 1);
        let report = DsmReport {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            images: image_reports(&images, &gsds, &geometry, &adjustment),
            pairs: pair_reports(&geometry, &ties),
            pointing: PointingReport::new(&adjustment, tracks.len(), pointed),
            height_range_m: range,
            hypotheses: evaluations,
            surface,
            choices: self.choices.made.clone(),
            warnings: self.choices.warnings.clone(),
            stages: self.times.clone(),
            peak_memory_mb: memory::peak_mb(),
        };
        let report = output::write(config, &grid, &product, report)?;
        self.progress.step();
        Ok(report)
    }

    /// Refuses one picture under two RPCs.
    fn check_pictures(
        &self,
        views: &[View],
        windows: &[Option<Window>],
        ties: &[PairTies],
    ) -> Result<(), PipelineError> {
        let path = |i: usize| self.config.images[i].clone();
        let blank: Vec<usize> = (0..views.len()).filter(|&i| pictures::is_blank(&views[i])).collect();
        if let (Some(&first), true) = (blank.first(), views.len() < blank.len() + 2) {
            return Err(PipelineError::Blank { path: path(first) });
        }
        let origins: Vec<[f64; 2]> = windows.iter().map(|w| w.map_or([0.0; 2], |w| [w.x as f64, w.y as f64])).collect();
        match pictures::same_picture(ties, &origins, setup::TIES_MIN) {
            Some((a, b)) => Err(PipelineError::SamePixels { first: path(a), second: path(b) }),
            None => Ok(()),
        }
    }

    /// The pairs among the views that tie points connect; the others are set aside, and named.
    fn connected(&mut self, useful: Vec<(usize, usize)>, ties: &[PairTies]) -> Vec<(usize, usize)> {
        let aside = pictures::unconnected(self.config.images.len(), ties, setup::TIES_MIN);
        for view in &aside {
            self.choices.warn(format!(
                "an image is set aside: fewer than {} tie points connect it with the others, so its pointing is not known; \
                 --no-pointing uses it as it is: {}",
                setup::TIES_MIN,
                self.config.images[*view].display()
            ));
        }
        useful.into_iter().filter(|(i, j)| !aside.contains(i) && !aside.contains(j)).collect()
    }

    /// The pairs to sweep, told with their reason.
    fn pairs(&mut self, useful: &[(usize, usize)], geometry: &Geometry) -> Result<Vec<(usize, usize)>, PipelineError> {
        let pairs = asked_pairs(self.config, useful)?;
        let widest =
            pairs.iter().filter_map(|p| geometry.pair(p.0, p.1)).max_by(|a, b| a.angle_deg.total_cmp(&b.angle_deg));
        if let Some(pair) = widest.filter(|p| p.angle_deg < ANGLE_WEAK_DEG) {
            self.choices.warn(format!(
                "the views look along nearly the same line, {:.1}° apart at most: a pixel of parallax is {:.1} m of height; \
                 add an image from another direction",
                pair.angle_deg,
                1.0 / pair.parallax_px_per_m.max(f64::MIN_POSITIVE)
            ));
        }
        for pair in self.config.pairs.iter().flatten().filter(|p| !useful.contains(&ordered(p))) {
            self.choices.warn(format!(
                "the pair {}-{} is left out: it shares too little ground, looks along the same line or has no tie points",
                pair.0 + 1,
                pair.1 + 1
            ));
        }
        let reason = match self.config.pairs {
            Some(_) => "given".to_owned(),
            None => "all that share ground at a useful angle, best angle first".to_owned(),
        };
        self.choices.tell("pairs", pair_names(&pairs), reason);
        Ok(pairs)
    }

    /// Puts the corrections into the cameras, unless pointing is off or the ties are too few; says whether it did.
    fn point(
        &mut self,
        images: &mut [Opened],
        views: &mut [View],
        windows: &[Option<Window>],
        found: &Adjustment,
    ) -> bool {
        let ties = found.ground.iter().flatten().count();
        if !self.config.pointing {
            self.choices.tell("pointing", "as given".to_owned(), "--no-pointing");
            return false;
        }
        if ties < setup::TIES_MIN {
            self.choices.warn(format!(
                "the pointing of the RPCs is not corrected: {ties} tie points found, {} needed",
                setup::TIES_MIN
            ));
            return false;
        }
        let order = match found.order {
            ModelOrder::None => "none needed",
            ModelOrder::Translation => "a shift per image",
            ModelOrder::Affine => "an affine map per image",
        };
        for (view, apart_px) in pictures::grossly_off(&found.corrections) {
            self.choices.warn(format!(
                "the pointing of an image is {apart_px:.0} px off that of the others, far more than providers state; it is \
                 corrected, but check that the RPC belongs to the image: {}",
                self.config.images[view].display()
            ));
        }
        let (before, after) = found.residual_px;
        self.choices.tell(
            "pointing",
            order.to_owned(),
            format!("{ties} tie points, residual {before:.2} px before and {after:.2} px after, by BIC"),
        );
        for ((view, image), (correction, window)) in
            views.iter_mut().zip(images).zip(found.corrections.iter().zip(windows))
        {
            view.camera.correction = *correction;
            let origin = window.map_or(ImagePoint::new(0.0, 0.0), |w| ImagePoint::new(-w.x as f64, -w.y as f64));
            image.camera = view.camera.cropped(origin);
        }
        true
    }

    /// The span of the DEM's heights over the scene, above the ellipsoid.
    fn dem_span(&self, geometry: &Geometry) -> Result<Option<(f64, f64)>, PipelineError> {
        self.config.dem.as_deref().map(|path| crate::dem::height_span(path, geometry)).transpose()
    }

    /// Consistency, fusion and clean-up.
    fn surface(
        &mut self,
        views: &[View],
        plan: &SweepPlan,
        useful: &[(usize, usize)],
        heights: SceneHeights,
        grid: &OutputGrid,
    ) -> Result<(Product, SurfaceReport), PipelineError> {
        let all: Vec<Heights<'_>> = heights
            .maps
            .iter()
            .enumerate()
            .filter(|(i, _)| !plan.sources[*i].is_empty())
            .map(|(index, map)| Heights { index, view: &views[index], map })
            .collect();
        self.progress.begin("fusing", all.len() + 1);
        let lonlat =
            |g: geodesy::LonLatHeight| grid.projection.map_from_lonlat(g.lon_deg, g.lat_deg).ok().map(|p| [p.x, p.y]);
        let frame = GridFrame { geotransform: grid.geotransform, map_from_ground: &lonlat };
        let level = plan.bottom_level as u32;
        let jump_m = same_surface_m(plan, grid);
        let mut placed = Vec::with_capacity(all.len());
        let mut kept = Vec::with_capacity(all.len());
        for own in &all {
            let mut keep = agreeing(*own, &all, useful, level)?;
            if let Some(asked) = self.config.height_range_m {
                drop_outside(&mut keep, own.map, asked);
            }
            kept.push(keep.data().iter().filter(|k| **k).count() as f64 / keep.data().len().max(1) as f64);
            placed.push(place_view(*own, level, &keep, jump_m, &frame)?);
            self.progress.step();
        }
        let (product, surface) = self.fuse(&placed, plan, grid, heights.maps[0].origin_m)?;
        self.progress.step();
        Ok((product, SurfaceReport { kept_by_view: kept, ..surface }))
    }

    fn fuse(
        &self,
        placed: &[PlacedView],
        plan: &SweepPlan,
        grid: &OutputGrid,
        origin_m: f64,
    ) -> Result<(Product, SurfaceReport), PipelineError> {
        let gsd = grid.gsd_m;
        // Heights and their places are as coarse as the level that they come from.
        let coarser = f64::from(1u32 << plan.bottom_level);
        let step_m = plan.step_at(plan.bottom_level);
        let same_surface_m = same_surface_m(plan, grid);
        let fusion = FusionConfig {
            same_surface_m,
            tear_m: (TEAR_SLOPE * gsd * coarser).max(2.0 * step_m) as f32,
            tile: self.config.tile,
        };
        let mut fused = fuse_views(placed, grid.size, &fusion);
        let speckle_cells = ((SPECKLE_SIDE_M / gsd).powi(2) as usize).max(SPECKLE_CELLS_MIN);
        let removed = remove_speckle(&mut fused.height_m, (2.0 * step_m).max(2.0 * gsd) as f32, speckle_cells);
        let observed = fused.height_m.data().iter().filter(|h| !h.is_nan()).count();
        if observed == 0 {
            return Err(PipelineError::NoSurface { range: plan.range_m });
        }
        let fill = FillConfig {
            reach_cells: (FILL_REACH_M / gsd).ceil() as usize,
            narrow_cells: (FILL_NARROW_M / gsd) as f32,
            hidden_cells_per_m: (FILL_HIDDEN / gsd) as f32,
            same_surface_m: (2.0 * gsd) as f32,
            slope_m: (FILL_SLOPE * gsd) as f32,
        };
        let filled = fill_voids(&mut fused.height_m, &fill);
        let product = Product::new(fused, filled, origin_m);
        let cells = grid.size.0 * grid.size.1;
        let filled = product.filled.data().iter().filter(|f| **f == FILLED).count();
        let surface = SurfaceReport {
            cells,
            observed,
            filled,
            void: cells - observed - filled,
            speckle_removed: removed,
            kept_by_view: Vec::new(),
        };
        Ok((product, surface))
    }
}

/// Heights on the grid closer than this may belong to one surface.
fn same_surface_m(plan: &SweepPlan, grid: &OutputGrid) -> f32 {
    (2.0 * plan.step_at(plan.bottom_level)).max(1.5 * grid.gsd_m) as f32
}

/// Which pixels enough other views agree with: a third of the views that see this one's ground from another direction,
/// so that a chance agreement of two among many does not put a height on the map, and at least one. A single reference
/// view has nobody to agree with: its heights stand.
fn agreeing(
    own: Heights<'_>,
    all: &[Heights<'_>],
    useful: &[(usize, usize)],
    level: u32,
) -> Result<Grid<bool>, PipelineError> {
    let partner = |h: &Heights<'_>| useful.contains(&(own.index.min(h.index), own.index.max(h.index)));
    let others: Vec<Heights<'_>> = all.iter().copied().filter(partner).collect();
    if others.is_empty() {
        return Ok(own.map.height_m.map(|h| !h.is_nan()));
    }
    let counts = count_agreeing(own, &others, level, &ConsistencyConfig::default())?;
    let needed = ((others.len() + 1) / 3).clamp(1, usize::from(u8::MAX)) as u8;
    let mut keep = counts.map(|n| *n >= needed);
    let reliability = own.map.support.data().iter().zip(own.map.confidence.data());
    for (keep, (support, confidence)) in keep.data_mut().iter_mut().zip(reliability) {
        *keep = *keep && *support >= SUPPORT_MIN && *confidence >= CONFIDENCE_MIN;
    }
    Ok(keep)
}

fn lap(times: &mut Vec<StageTime>, since: &mut Instant, stage: &str) {
    times.push(StageTime { stage: stage.to_owned(), seconds: since.elapsed().as_secs_f64() });
    *since = Instant::now();
}

/// Leaves out what lies outside the heights that were asked for.
fn drop_outside(keep: &mut Grid<bool>, map: &HeightMap, (lo, hi): (f64, f64)) {
    for (keep, h) in keep.data_mut().iter_mut().zip(map.height_m.data()) {
        *keep = *keep && (lo..=hi).contains(&(map.origin_m + f64::from(*h)));
    }
}

fn image_reports(images: &[Opened], gsds: &[Option<f64>], geometry: &Geometry, found: &Adjustment) -> Vec<ImageReport> {
    let one = |(i, o): (usize, &Opened)| ImageReport {
        path: o.path.clone(),
        rpc: o.rpc_format.clone(),
        size: o.size,
        gsd_m: gsds.get(i).copied().flatten(),
        incidence_deg: o.camera.view_direction(geometry.centre).ok().map(|v| v.incidence_deg()),
        correction: found.corrections.get(i).copied(),
        applied_correction: o.camera.correction,
    };
    images.iter().enumerate().map(one).collect()
}

fn pair_reports(geometry: &Geometry, ties: &[PairTies]) -> Vec<PairReport> {
    let one = |t: &PairTies| {
        let geometry = geometry.pair(t.reference, t.source).copied()?;
        Some(PairReport { images: (t.reference + 1, t.source + 1), geometry, ties: t.ties.len() })
    };
    ties.iter().filter_map(one).collect()
}
