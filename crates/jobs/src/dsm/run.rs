//! The DSM job, from images to files.

use std::time::Instant;

use camera::{ImagePoint, RpcCamera};
use raster::Window;
use sweep::SweepView;
use sweep::pointing::{AdjustConfig, Adjustment, ModelOrder};

use crate::dsm::chunks::{self, ChunkTotal, ChunkedScene, Outcome};
use crate::dsm::config::{DsmConfig, Tuning};
use crate::dsm::first_look::{Looked, Pixels, asked_pairs, look, ordered, pair_names};
use crate::dsm::heights::sweep_scene;
use crate::dsm::memory;
use crate::dsm::output::{self, ChunkedOutput};
use crate::dsm::pictures;
use crate::dsm::pointing::{PairTies, adjust_cameras};
use crate::dsm::prior::CityPrior;
use crate::dsm::report::{
    ChunksReport, DsmReport, FailedChunk, ImageReport, PairReport, PointingReport, PriorReport, StageTime,
    SurfaceReport,
};
use crate::dsm::scene::{Geometry, Opened, open};
use crate::dsm::setup::{self, Choices, EARTH_RANGE_M, OutputGrid};
use crate::dsm::surface::{Counts, SurfaceInput, make_surface};
use crate::dsm::tie_windows::Character;
use crate::error::PipelineError;
use numeric::Progress;

/// Where no two views are further apart than this, heights are ten times less precise than positions, and the user is told.
const ANGLE_WEAK_DEG: f64 = 3.0;
/// Smaller output tiles cost more to manage than to fill, cells.
const TILE_MIN: usize = 64;

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
    if let Some(side) = config.chunk.filter(|side| *side < TILE_MIN) {
        return value("--chunk", side.to_string(), "64 or more cells");
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
        let Looked { first, useful, ties, windows, cameras, sizes, blank, mut pixels } = {
            let (times, since) = (&mut self.times, &mut self.since);
            look(config, &images, self.progress, &mut |stage| lap(times, since, stage))?
        };
        self.check_pictures(&blank, &windows, &ties)?;
        let (adjustment, tracks) = adjust_cameras(&cameras, &sizes, &ties, &AdjustConfig::default());
        let pointed = self.is_pointed(&adjustment);
        if pointed {
            point(&mut images, &mut pixels, cameras, &windows, &adjustment);
        }
        let useful = if pointed { self.connected(useful, &ties) } else { useful };
        let pairs = self.pairs(&useful, &first)?;
        self.lap("pointing");

        let dem_span = self.dem_span(&first)?;
        let range = setup::height_range(config, dem_span, &adjustment, &mut self.choices)?;
        let middle = setup::middle_height(&adjustment, range);
        let geometry = Geometry::at(&images, middle)?;
        let gsds: Vec<Option<f64>> = images.iter().map(|o| setup::ground_sampling(o, geometry.centre)).collect();
        let coarsest = gsds.iter().flatten().copied().fold(0.0, f64::max);
        let grid = setup::choose_grid(config, &geometry, coarsest)?;
        setup::tell_grid(config, &grid, coarsest, &mut self.choices);
        let sources = setup::choose_sources(config, &geometry, &pairs, &ties, &tuning, &mut self.choices)?;
        let prior = self.config.prior.as_deref().map(|path| CityPrior::read(path, &mut self.choices)).transpose()?;
        let scene = Scene { images: &images, geometry, useful, sources, range, coarsest, grid: &grid, tuning, prior };
        let drawn = |range, hypotheses, surface, chunks| DsmReport {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            images: image_reports(&images, &gsds, &scene.geometry, &adjustment),
            pairs: pair_reports(&scene.geometry, &ties),
            pointing: PointingReport::new(&adjustment, tracks.len(), pointed),
            height_range_m: range,
            hypotheses,
            surface,
            chunks,
            prior: None,
            choices: Vec::new(),
            warnings: Vec::new(),
            stages: Vec::new(),
            peak_memory_mb: None,
        };
        match pixels {
            Pixels::Whole(views) => self.at_once(&scene, views, drawn),
            Pixels::ByChunk(characters) => self.by_chunks(&scene, &characters, drawn),
        }
    }

    /// Sweeps all views and writes the surface.
    fn at_once(
        mut self,
        scene: &Scene<'_>,
        views: Vec<SweepView>,
        drawn: impl Drawn,
    ) -> Result<DsmReport, PipelineError> {
        let Scene { geometry, sources, tuning, grid, coarsest, .. } = scene;
        let found = (sources.as_slice(), geometry);
        let range = setup::with_towers(self.config, scene.range, &views, found, *coarsest, tuning, &mut self.choices)?;
        let step_m = setup::height_step(sources, geometry, tuning);
        setup::tell_step(sources, geometry, tuning, &mut self.choices);
        let mut plan = setup::plan_sweep(range, step_m, sources.clone(), &setup::smallest_sides(&views), tuning);
        plan.priors =
            scene.prior.as_ref().map(|prior| prior.seen_from(&views, *coarsest)).transpose()?.unwrap_or_default();
        setup::tell_levels(&plan, &mut self.choices);

        self.progress.begin("sweeping heights", views.len() * (plan.top_level - plan.bottom_level + 1));
        let heights = sweep_scene(&views, &plan, &|| self.progress.step())?;
        self.lap("sweep");
        let hypotheses = heights.evaluations;
        let prior = scene.prior.as_ref().map(|prior| prior.report(&heights.findings, &mut self.choices));
        let core = Window::whole(grid.size.0, grid.size.1);
        let input = SurfaceInput {
            config: self.config,
            plan: &plan,
            useful: &scene.useful,
            grid,
            pixel_m: scene.coarsest,
            core,
        };
        self.progress.begin("fusing", 1 + sources.iter().filter(|s| !s.is_empty()).count());
        let (product, counts) = make_surface(input, views, heights, &|| self.progress.step())?;
        if counts.observed == 0 {
            return Err(PipelineError::NoSurface { range });
        }
        self.lap("fusion");

        self.progress.begin("writing", 1);
        let report = self.told(drawn(range, hypotheses, surface_report(grid, counts), None), prior);
        let report = output::write(self.config, grid, &product, report)?;
        self.progress.step();
        Ok(report)
    }

    /// Sweeps a large scene chunk by chunk. A chunk that fails leaves a void, and the others go on.
    fn by_chunks(
        mut self,
        scene: &Scene<'_>,
        characters: &[Character],
        drawn: impl Drawn,
    ) -> Result<DsmReport, PipelineError> {
        let (config, grid) = (self.config, scene.grid);
        setup::tell_step(&scene.sources, &scene.geometry, &scene.tuning, &mut self.choices);
        let side = chunks::choose_side(config, scene.images, grid, scene.range)?;
        let mut cores = chunks::cores(grid.size, side);
        self.tell_chunks(cores.len(), side);
        let chunked = ChunkedScene {
            config,
            tuning: &scene.tuning,
            images: scene.images,
            characters,
            grid,
            useful: &scene.useful,
            sources: &scene.sources,
            step_m: setup::height_step(&scene.sources, &scene.geometry, &scene.tuning),
            gsd_m: scene.coarsest,
            range_m: scene.range,
            prior: scene.prior.as_ref(),
        };
        let mut output = ChunkedOutput::begin(config, grid)?;
        let mut total = ChunkTotal { report: ChunksReport { side, ..ChunksReport::default() }, ..Default::default() };
        self.progress.begin("sweeping chunks", cores.len());
        cores.reverse();
        while let Some(core) = cores.pop() {
            match chunked.sweep(core) {
                Ok(Outcome::TooLarge) => {
                    // The quarters come in its place; the last of them makes its step.
                    cores.extend(chunks::quarters(core).into_iter().rev());
                    continue;
                }
                Ok(Outcome::Swept(swept)) => {
                    output.put(core, &swept.product)?;
                    total.add(&swept);
                }
                Ok(Outcome::Unseen) => {
                    total.report.unseen += 1;
                    total.leave(core);
                }
                Err(error) => {
                    let bounds = grid.part(core)?.bounds();
                    self.choices.warn(format!("the chunk {bounds:.1?} is left void: {}", reason_of(&error)));
                    total.report.failed.push(FailedChunk { bounds, reason: reason_of(&error) });
                    total.leave(core);
                    total.error.get_or_insert(error);
                }
            }
            self.progress.step();
        }
        self.lap("chunks");
        let ChunkTotal { counts, evaluations, range_m, report, error, findings } = total;
        if counts.observed == 0 {
            return Err(error.unwrap_or(PipelineError::NoSurface { range: scene.range }));
        }
        self.progress.begin("writing", 1);
        let surface = surface_report(grid, counts);
        let prior = scene.prior.as_ref().map(|prior| prior.report(&findings, &mut self.choices));
        let report = self.told(drawn(range_m.unwrap_or(scene.range), evaluations, surface, Some(report)), prior);
        let report = output.finish(report)?;
        self.progress.step();
        Ok(report)
    }

    fn tell_chunks(&mut self, count: usize, side: usize) {
        let reason = match self.config.chunk {
            Some(_) => "given".to_owned(),
            None => format!("the largest that {} MB allow", memory::limit_mb(self.config)),
        };
        self.choices.tell("chunks", format!("{count} of up to {side} cells a side"), reason);
    }

    /// The report with what was said and measured on the way.
    fn told(&mut self, report: DsmReport, prior: Option<PriorReport>) -> DsmReport {
        DsmReport {
            prior,
            choices: self.choices.made.clone(),
            warnings: self.choices.warnings.clone(),
            stages: self.times.clone(),
            peak_memory_mb: memory::peak_mb(),
            ..report
        }
    }

    /// Refuses one picture under two RPCs.
    fn check_pictures(
        &self,
        blank: &[bool],
        windows: &[Option<Window>],
        ties: &[PairTies],
    ) -> Result<(), PipelineError> {
        let path = |i: usize| self.config.images[i].clone();
        let pictures = blank.iter().filter(|b| !**b).count();
        if let (Some(first), true) = (blank.iter().position(|b| *b), pictures < 2) {
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

    /// Whether corrections are to be put into the cameras: unless pointing is off or the ties are too few.
    fn is_pointed(&mut self, found: &Adjustment) -> bool {
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
        true
    }

    /// The span of the DEM's heights over the scene, above the ellipsoid.
    fn dem_span(&self, geometry: &Geometry) -> Result<Option<(f64, f64)>, PipelineError> {
        self.config.dem.as_deref().map(|path| crate::dsm::dem::height_span(path, geometry)).transpose()
    }
}

/// What is known of a scene when its heights are to be computed.
struct Scene<'a> {
    /// With corrected cameras.
    images: &'a [Opened],
    geometry: Geometry,
    /// Pairs that look from different directions.
    useful: Vec<(usize, usize)>,
    sources: Vec<Vec<usize>>,
    /// Heights to search, metres above the ellipsoid.
    range: (f64, f64),
    /// The coarsest image's pixel, metres.
    coarsest: f64,
    grid: &'a OutputGrid,
    tuning: Tuning,
    /// A city model.
    prior: Option<CityPrior>,
}

/// Draws up the report: heights searched, hypotheses, surface, chunks.
trait Drawn: FnOnce((f64, f64), u64, SurfaceReport, Option<ChunksReport>) -> DsmReport {}

impl<F: FnOnce((f64, f64), u64, SurfaceReport, Option<ChunksReport>) -> DsmReport> Drawn for F {}

/// An error with its causes.
fn reason_of(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |e| e.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

fn surface_report(grid: &OutputGrid, counts: Counts) -> SurfaceReport {
    let share = |(kept, all): &(u64, u64)| (*all > 0).then(|| *kept as f64 / *all as f64);
    SurfaceReport {
        cells: grid.size.0 * grid.size.1,
        observed: counts.observed,
        filled: counts.filled,
        void: counts.void,
        speckle_removed: counts.speckle_removed,
        kept_by_view: counts.kept.iter().filter_map(share).collect(),
    }
}

/// Puts the corrections found in the windows' frames into the cameras of windows and images.
fn point(
    images: &mut [Opened],
    pixels: &mut Pixels,
    cameras: Vec<RpcCamera>,
    windows: &[Option<Window>],
    found: &Adjustment,
) {
    for (i, mut camera) in cameras.into_iter().enumerate() {
        camera.correction = found.corrections[i];
        let origin = windows[i].map_or(ImagePoint::new(0.0, 0.0), |w| ImagePoint::new(-w.x as f64, -w.y as f64));
        images[i].camera = camera.cropped(origin);
        if let Pixels::Whole(views) = pixels {
            views[i].camera = camera;
        }
    }
}

fn lap(times: &mut Vec<StageTime>, since: &mut Instant, stage: &str) {
    times.push(StageTime { stage: stage.to_owned(), seconds: since.elapsed().as_secs_f64() });
    *since = Instant::now();
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
