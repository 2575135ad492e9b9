//! The DSM job, from images to files.

use std::time::Instant;

use camera::ImagePoint;
use raster::{Grid, Window};
use sweep::View;
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::fusion::{
    FillConfig, FusionConfig, GridFrame, PlacedView, fill_holes, fuse_views, place_view, remove_speckle,
};
use sweep::pointing::{AdjustConfig, Adjustment, ModelOrder, TieConfig};

use crate::config::DsmConfig;
use crate::error::PipelineError;
use crate::heights::{SceneHeights, SweepPlan, sweep_scene};
use crate::memory;
use crate::output::{self, FILLED, Product};
use crate::pointing::{PairTies, adjust_views, match_pairs};
use crate::progress::Progress;
use crate::report::{DsmReport, ImageReport, PairReport, PointingReport, StageTime, SurfaceReport};
use crate::scene::{Geometry, Opened, open, read_views};
use crate::setup::{self, Choices, EARTH_RANGE_M, OutputGrid};

/// Pixels read around what the bounds ask for, full resolution: patches, aggregation and pointing errors reach out.
const WINDOW_MARGIN: usize = 96;
/// Isolated patches of less ground than a square of this side are speckle: smaller than a house, metres.
const SPECKLE_SIDE_M: f64 = 5.0;
/// … and never of fewer cells than this, whatever the grid.
const SPECKLE_CELLS_MIN: usize = 9;
/// Smaller output tiles cost more to manage than to fill, cells.
const TILE_MIN: usize = 64;
/// Holes up to this many metres across are closed: the shadow side of a house.
const FILL_SIDE_M: f64 = 10.0;
/// A facet steeper than this (rise over run) is a tear, not a surface: about 70°.
const TEAR_SLOPE: f64 = 2.75;

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
        self.times.push(StageTime { stage: stage.to_owned(), seconds: self.since.elapsed().as_secs_f64() });
        self.since = Instant::now();
    }

    fn run(mut self) -> Result<DsmReport, PipelineError> {
        let config = self.config;
        let tuning = config.preset.tuning();
        let mut images = open(&config.images)?;
        let guess = images.iter().map(|o| o.camera.rpc.height_off).sum::<f64>() / images.len() as f64;
        let search = self.first_range(&images)?;
        let first = Geometry::at(&images, guess.clamp(search.0, search.1))?;
        let useful = first.useful_pairs()?;
        let pairs = self.pairs(&useful)?;
        let windows = self.windows(&images, &first, search)?;
        memory::check(config, &images, &windows)?;
        self.progress.begin("reading images", images.len());
        let mut views = read_views(&images, &windows, &|| self.progress.step())?;
        self.lap("read");

        self.progress.begin("matching tie points", pairs.len());
        let tie_config = TieConfig::default();
        let ties = match_pairs(&views, &pairs, search, &tie_config, &|| self.progress.step());
        let (adjustment, tracks) = adjust_views(&views, &ties, &AdjustConfig::default());
        let pointed = self.point(&mut images, &mut views, &windows, &adjustment);
        self.lap("pointing");

        let dem_span = self.dem_span(&first)?;
        let range = setup::height_range(config, dem_span, &adjustment, &mut self.choices)?;
        let middle = setup::middle_height(&adjustment, range);
        let geometry = Geometry::at(&images, middle)?;
        let gsds: Vec<Option<f64>> = images.iter().map(|o| setup::ground_sampling(o, geometry.centre)).collect();
        let coarsest = gsds.iter().flatten().copied().fold(0.0, f64::max);
        let grid = setup::choose_grid(config, &geometry, coarsest, &mut self.choices)?;
        let sources = setup::choose_sources(config, &geometry, &pairs, &ties, &tuning, &mut self.choices)?;
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

    /// The heights among which tie points are searched.
    fn first_range(&self, images: &[Opened]) -> Result<(f64, f64), PipelineError> {
        let valid = setup::validity_range(images);
        if valid.0 >= valid.1 {
            return Err(PipelineError::Value {
                name: "the RPCs' height validity",
                found: format!("{:.0} to {:.0} m", valid.0, valid.1),
                expected: "a range that holds heights of the Earth's surface".to_owned(),
            });
        }
        Ok(valid)
    }

    /// The pairs to match: all useful ones, or those of them that were asked for.
    fn pairs(&mut self, useful: &[(usize, usize)]) -> Result<Vec<(usize, usize)>, PipelineError> {
        let ordered = |p: &(usize, usize)| (p.0.min(p.1), p.0.max(p.1));
        let pairs: Vec<(usize, usize)> = match &self.config.pairs {
            None => useful.to_vec(),
            Some(asked) => {
                for pair in asked.iter().filter(|p| !useful.contains(&ordered(p))) {
                    self.choices.warn(format!(
                        "the pair {}-{} is left out: it shares too little ground or looks along the same line",
                        pair.0 + 1,
                        pair.1 + 1
                    ));
                }
                useful.iter().copied().filter(|p| asked.iter().any(|a| ordered(a) == *p)).collect()
            }
        };
        if pairs.is_empty() {
            return Err(PipelineError::Value {
                name: "--pairs",
                found: "no pair that shares ground under a useful angle".to_owned(),
                expected: format!("some of {}", pair_names(useful)),
            });
        }
        let reason = match self.config.pairs {
            Some(_) => "given".to_owned(),
            None => "all that share ground at a useful angle, best angle first".to_owned(),
        };
        self.choices.tell("pairs", pair_names(&pairs), reason);
        Ok(pairs)
    }

    /// The part of each image to read: all of it, or what the bounds may need.
    fn windows(
        &self,
        images: &[Opened],
        geometry: &Geometry,
        search: (f64, f64),
    ) -> Result<Vec<Option<Window>>, PipelineError> {
        if self.config.bounds.is_none() {
            return Ok(vec![None; images.len()]);
        }
        // The grid's placement needs no height; its choices are told later, once they are final.
        let mut unheard = Choices { made: Vec::new(), warnings: Vec::new(), progress: &crate::progress::Silent };
        let gsd = images.iter().filter_map(|o| setup::ground_sampling(o, geometry.centre)).fold(0.0, f64::max);
        let grid = setup::choose_grid(self.config, geometry, gsd, &mut unheard)?;
        let range = self.config.height_range_m.unwrap_or(search);
        let window = |o: &Opened| {
            let w = setup::image_window(o, &grid, range, WINDOW_MARGIN)?;
            w.map(Some).ok_or_else(|| PipelineError::Value {
                name: "--bounds",
                found: format!("an area that an image does not see: {}", o.path.display()),
                expected: "an area that every image sees, or only the images that see it".to_owned(),
            })
        };
        images.iter().map(window).collect()
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
        let mut placed = Vec::with_capacity(all.len());
        let mut kept = Vec::with_capacity(all.len());
        for own in &all {
            let keep = agreeing(*own, &all, useful, level)?;
            kept.push(keep.data().iter().filter(|k| **k).count() as f64 / keep.data().len().max(1) as f64);
            placed.push(place_view(*own, level, &keep, &frame)?);
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
        let step_m = plan.step_m * coarser;
        let same_surface_m = (2.0 * step_m).max(1.5 * gsd) as f32;
        let fusion =
            FusionConfig { same_surface_m, tear_m: (TEAR_SLOPE * gsd * coarser) as f32, tile: self.config.tile };
        let mut fused = fuse_views(placed, grid.size, &fusion);
        let speckle_cells = ((SPECKLE_SIDE_M / gsd).powi(2) as usize).max(SPECKLE_CELLS_MIN);
        let removed = remove_speckle(&mut fused.height_m, (2.0 * step_m).max(2.0 * gsd) as f32, speckle_cells);
        let observed = fused.height_m.data().iter().filter(|h| !h.is_nan()).count();
        if observed == 0 {
            return Err(PipelineError::NoSurface { range: plan.range_m });
        }
        let fill = FillConfig { max_cells: (FILL_SIDE_M / gsd).powi(2) as usize, same_surface_m: (2.0 * gsd) as f32 };
        let filled = fill_holes(&mut fused.height_m, &fill);
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
    Ok(counts.map(|n| *n >= needed))
}

fn pair_names(pairs: &[(usize, usize)]) -> String {
    pairs.iter().map(|(i, j)| format!("{}-{}", i + 1, j + 1)).collect::<Vec<_>>().join(" ")
}

fn image_reports(images: &[Opened], gsds: &[Option<f64>], geometry: &Geometry, found: &Adjustment) -> Vec<ImageReport> {
    let one = |(i, o): (usize, &Opened)| ImageReport {
        path: o.path.clone(),
        rpc: o.rpc_format.clone(),
        size: o.size,
        gsd_m: gsds.get(i).copied().flatten(),
        incidence_deg: o.camera.view_direction(geometry.centre).ok().map(|v| v.incidence_deg()),
        correction: found.corrections.get(i).copied(),
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
