//! What the scene needs, each choice with its reason: height range, sources, steps, grid.

use std::collections::BTreeMap;

use crs::{CrsError, MapProjection};
use geodesy::{LonLatHeight, utm_epsg};
use raster::{GeoTransform, Window};
use sweep::pointing::Adjustment;

use crate::dsm::config::{Bounds, DsmConfig, Preset, Tuning};
use crate::dsm::geometry::shared_ground;
use crate::dsm::heights::SweepPlan;
use crate::dsm::pointing::{PairTies, span_of};
use crate::dsm::scene::{Geometry, Opened, angle_merit};
use crate::error::PipelineError;
use numeric::{Choice, Progress};

/// Fewer tie points than this do not tell the scene's heights.
pub(crate) const TIES_MIN: usize = 12;
/// Heights of the Earth's surface above the ellipsoid: the Dead Sea's shore and Everest, rounded outward.
pub(crate) const EARTH_RANGE_M: (f64, f64) = (-500.0, 9000.0);
/// Tie points seldom lie at the bottom of a pit or courtyard: searched below the lowest at least.
const MARGIN_BELOW_M: f64 = 20.0;
/// … nor on top of a mast or tower: searched above the highest at least.
const MARGIN_ABOVE_M: f64 = 60.0;
/// A given range is not searched further below the lowest tie point than this and the ties' own span.
const FAR_BELOW_M: f64 = 100.0;
/// … nor further above the highest one: no building is taller than twice this.
const FAR_ABOVE_M: f64 = 500.0;
/// The coarsest level is chosen so that the range is at most this many of its steps: the full range is then searched
/// where it is cheap, and still at several pixels per building.
const TOP_HYPOTHESES: f64 = 64.0;
/// The coarsest level used keeps at least this many pixels on a side, or its aggregation has nothing to work with.
const TOP_SIDE_MIN: usize = 48;

/// Tells a choice and keeps it for the report.
pub(crate) struct Choices<'a> {
    pub(crate) made: Vec<Choice>,
    pub(crate) warnings: Vec<String>,
    pub(crate) progress: &'a dyn Progress,
}

impl Choices<'_> {
    pub(crate) fn tell(&mut self, name: &str, value: String, reason: impl Into<String>) {
        let choice = Choice { name: name.to_owned(), value, reason: reason.into() };
        self.progress.choice(&choice);
        self.made.push(choice);
    }

    pub(crate) fn warn(&mut self, text: String) {
        self.progress.warn(&text);
        self.warnings.push(text);
    }
}

/// Where heights may be before anything is known of the scene: what the RPCs are valid for, and what is asked for.
pub(crate) fn validity_range(images: &[Opened], asked: Option<(f64, f64)>) -> (f64, f64) {
    let ranges = images.iter().map(|o| {
        let r = &o.camera.rpc;
        (r.height_off - r.height_scale.abs(), r.height_off + r.height_scale.abs())
    });
    let (lo, hi) = ranges.chain(asked).fold((f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let range = (lo.max(EARTH_RANGE_M.0), hi.min(EARTH_RANGE_M.1));
    if range.0 < range.1 { range } else { EARTH_RANGE_M }
}

/// The heights to search.
pub(crate) fn height_range(
    config: &DsmConfig,
    dem_span: Option<(f64, f64)>,
    adjustment: &Adjustment,
    choices: &mut Choices<'_>,
) -> Result<(f64, f64), PipelineError> {
    let ties = adjustment.ground.iter().flatten().count();
    let seen = span_of(adjustment, TIES_MIN);
    let (range, reason) = if let Some(given) = config.height_range_m {
        match seen {
            None => (given, "given".to_owned()),
            Some(seen) if given.1 < seen.0 || given.0 > seen.1 => {
                return Err(PipelineError::RangeMissesScene { range: given, seen });
            }
            Some(seen) => {
                warn_if_cut(given, seen, choices);
                (searched(given, seen), given_reason(given, seen))
            }
        }
    } else if let Some(span) = dem_span {
        if span.0 < EARTH_RANGE_M.0 || span.1 > EARTH_RANGE_M.1 {
            return Err(PipelineError::Value {
                name: "--dem",
                found: format!("heights from {:.0} to {:.0} m", span.0, span.1),
                expected: "heights of the Earth's surface; is its no-data value declared?".to_owned(),
            });
        }
        let reason = format!("the DEM's {:.0} to {:.0} m with margins", span.0, span.1);
        (with_margins(span), reason)
    } else {
        let Some(span) = seen else { return Err(PipelineError::NoTies { ties, needed: TIES_MIN }) };
        let reason =
            format!("{ties} tie points between {:.0} and {:.0} m, with margins for pits and towers", span.0, span.1);
        (with_margins(span), reason)
    };
    choices.tell("height range", format!("{:.1} to {:.1} m", range.0, range.1), reason);
    Ok(range)
}

/// What to search for a given range: where ties are seen outside it too, so that what is there is recognised and left
/// out instead of being given a false height inside; and not kilometres from every tie.
fn searched(given: (f64, f64), seen: (f64, f64)) -> (f64, f64) {
    let near = with_margins(seen);
    let span = seen.1 - seen.0;
    (given.0.max(seen.0 - span - FAR_BELOW_M).min(near.0), given.1.min(seen.1 + span + FAR_ABOVE_M).max(near.1))
}

fn given_reason(given: (f64, f64), seen: (f64, f64)) -> String {
    format!("given {:.1} to {:.1} m, tie points between {:.0} and {:.0} m", given.0, given.1, seen.0, seen.1)
}

fn warn_if_cut(given: (f64, f64), seen: (f64, f64), choices: &mut Choices<'_>) {
    if seen.0 < given.0 || seen.1 > given.1 {
        choices.warn(format!(
            "the height range {} to {} m cuts the scene, whose tie points lie between {:.0} and {:.0} m above the ellipsoid: \
             what is outside stays void",
            given.0, given.1, seen.0, seen.1
        ));
    }
}

/// A tenth of the span for what the ties missed, and at least the fixed margins.
fn with_margins((lo, hi): (f64, f64)) -> (f64, f64) {
    let tenth = 0.1 * (hi - lo);
    (lo - tenth.max(MARGIN_BELOW_M), hi + tenth.max(MARGIN_ABOVE_M))
}

/// For each view, the views to compare it with: those with the most tie points at the best angles.
pub(crate) fn choose_sources(
    config: &DsmConfig,
    geometry: &Geometry,
    pairs: &[(usize, usize)],
    ties: &[PairTies],
    tuning: &Tuning,
    choices: &mut Choices<'_>,
) -> Result<Vec<Vec<usize>>, PipelineError> {
    let found: BTreeMap<(usize, usize), usize> =
        ties.iter().map(|t| ((t.reference.min(t.source), t.reference.max(t.source)), t.ties.len())).collect();
    let merit = |i: usize, j: usize| {
        let angle = geometry.pair(i, j).map_or(0.0, |p| p.angle_deg);
        // One more, so that angles decide where nothing was matched.
        (1 + found.get(&(i.min(j), i.max(j))).copied().unwrap_or(0)) as f64 * angle_merit(angle).max(0.05)
    };
    let n = geometry.outlines.len();
    let mut sources = vec![Vec::new(); n];
    for (i, own) in sources.iter_mut().enumerate() {
        if config.references.as_ref().is_some_and(|r| !r.contains(&i)) {
            continue;
        }
        *own = (0..n).filter(|&j| pairs.contains(&(i.min(j), i.max(j)))).collect();
        own.sort_by(|&a, &b| merit(i, b).total_cmp(&merit(i, a)).then(a.cmp(&b)));
        own.truncate(tuning.sources);
    }
    let text: Vec<String> = sources.iter().enumerate().map(|(i, s)| format!("{}←{}", i + 1, list(s))).collect();
    choices.tell("sources", text.join(" "), format!("at most {} per view, by tie points and angle", tuning.sources));
    if sources.iter().all(Vec::is_empty) {
        return Err(PipelineError::Value {
            name: "--reference",
            found: "only images that no other one can be matched with".to_owned(),
            expected: "at least one image that shares ground with another under a useful angle".to_owned(),
        });
    }
    Ok(sources)
}

fn list(views: &[usize]) -> String {
    let names: Vec<String> = views.iter().map(|v| (v + 1).to_string()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(",") }
}

/// Pixels per metre in the pair that sees most parallax.
fn widest_parallax(sources: &[Vec<usize>], geometry: &Geometry) -> f64 {
    let used = sources.iter().enumerate().flat_map(|(i, s)| s.iter().map(move |&j| (i, j)));
    used.filter_map(|(i, j)| geometry.pair(i, j)).map(|p| p.parallax_px_per_m).fold(0.0, f64::max)
}

/// The range, extended by what stands outside it: see [`crate::dsm::probe`]. A given range is left as it is.
pub(crate) fn with_towers(
    config: &DsmConfig,
    range_m: (f64, f64),
    views: &[sweep::SweepView],
    (sources, geometry): (&[Vec<usize>], &Geometry),
    gsd_m: f64,
    tuning: &Tuning,
    choices: &mut Choices<'_>,
) -> Result<(f64, f64), PipelineError> {
    if config.height_range_m.is_some() {
        return Ok(range_m);
    }
    let step_m = height_step(sources, geometry, tuning);
    let plan = SweepPlan {
        range_m,
        step_m,
        top_level: 0,
        bottom_level: 0,
        sources: sources.to_vec(),
        reach: tuning.reach,
        level: tuning.level,
        priors: Vec::new(),
    };
    let Some(found) = crate::dsm::probe::extended_range(views, &plan, gsd_m, &smallest_sides(views))? else {
        return Ok(range_m);
    };
    let reason = format!("{} pixels of a coarse sweep show what no tie point does", found.pixels);
    choices.tell("height range", format!("{:.1} to {:.1} m", found.range_m.0, found.range_m.1), reason);
    Ok(found.range_m)
}

/// Metres between hypotheses at full resolution.
pub(crate) fn height_step(sources: &[Vec<usize>], geometry: &Geometry, tuning: &Tuning) -> f64 {
    tuning.step_px / widest_parallax(sources, geometry).max(f64::MIN_POSITIVE)
}

/// Tells the choice of [`height_step`].
pub(crate) fn tell_step(sources: &[Vec<usize>], geometry: &Geometry, tuning: &Tuning, choices: &mut Choices<'_>) {
    let widest = widest_parallax(sources, geometry);
    choices.tell(
        "height step",
        format!("{:.3} m", height_step(sources, geometry, tuning)),
        format!("{} px of parallax in the pair that sees most of it ({widest:.3} px/m)", tuning.step_px),
    );
}

/// Levels of the sweep of views whose shortest sides are `smallest_sides`.
pub(crate) fn plan_sweep(
    range_m: (f64, f64),
    step_m: f64,
    sources: Vec<Vec<usize>>,
    smallest_sides: &[usize],
    tuning: &Tuning,
) -> SweepPlan {
    let deepest = smallest_sides.iter().filter(|s| **s >= TOP_SIDE_MIN).count().saturating_sub(1);
    let too_many = |level: &usize| (range_m.1 - range_m.0) / (step_m * f64::from(1u32 << *level)) > TOP_HYPOTHESES;
    let bottom_level = tuning.finest_level.min(deepest);
    let top_level = (0..deepest).take_while(too_many).count().max(bottom_level);
    SweepPlan {
        range_m,
        step_m,
        top_level,
        bottom_level,
        sources,
        reach: tuning.reach,
        level: tuning.level,
        priors: Vec::new(),
    }
}

/// Tells the choice of [`plan_sweep`].
pub(crate) fn tell_levels(plan: &SweepPlan, choices: &mut Choices<'_>) {
    choices.tell(
        "pyramid",
        format!("{} levels", plan.top_level - plan.bottom_level + 1),
        format!(
            "{:.0} hypotheses over the whole range on the coarsest",
            (plan.range_m.1 - plan.range_m.0) / (plan.step_m * f64::from(1u32 << plan.top_level))
        ),
    );
}

/// The output grid.
#[derive(Debug)]
pub(crate) struct OutputGrid {
    pub(crate) epsg: u32,
    pub(crate) projection: MapProjection,
    pub(crate) geotransform: GeoTransform,
    /// Columns and rows.
    pub(crate) size: (usize, usize),
    pub(crate) gsd_m: f64,
}

impl OutputGrid {
    /// The grid of a window of this one's cells.
    pub(crate) fn part(&self, cells: Window) -> Result<Self, PipelineError> {
        Ok(Self {
            epsg: self.epsg,
            projection: MapProjection::from_epsg(self.epsg)?,
            geotransform: self.geotransform.shifted(cells.x as f64, cells.y as f64),
            size: (cells.width, cells.height),
            gsd_m: self.gsd_m,
        })
    }

    /// x_min, y_min, x_max, y_max.
    pub(crate) fn bounds(&self) -> Bounds {
        let (x0, y1) = self.geotransform.map_from_cell(-0.5, -0.5);
        let (x1, y0) = self.geotransform.map_from_cell(self.size.0 as f64 - 0.5, self.size.1 as f64 - 0.5);
        [x0, y0, x1, y1]
    }
}

/// Grids of more cells than this are a mistake in the units of `--gsd` or `--bounds`.
const CELLS_MAX: f64 = 4e9;

/// CRS, cell size and extent of the DSM.
pub(crate) fn choose_grid(
    config: &DsmConfig,
    geometry: &Geometry,
    coarsest_gsd_m: f64,
) -> Result<OutputGrid, PipelineError> {
    let centre = geometry.centre;
    let epsg = match config.crs_epsg {
        Some(code) => code,
        None => utm_epsg(centre.lon_deg, centre.lat_deg).map_err(CrsError::from)?,
    };
    let projection = MapProjection::from_epsg(epsg)?;
    if projection.metres_per_unit() != Some(1.0) {
        return Err(PipelineError::Value {
            name: "--crs",
            found: format!("EPSG:{epsg}, whose units are not metres"),
            expected: "a projected CRS in metres; a cell has one size".to_owned(),
        });
    }
    let gsd_m = config.gsd_m.unwrap_or_else(|| rounded_gsd(coarsest_gsd_m * config.preset.pixels_per_cell()));
    let covered = covered_bounds(geometry, &projection)?;
    let asked = config.bounds.unwrap_or(covered);
    let meets = asked[0] < covered[2] && asked[2] > covered[0] && asked[1] < covered[3] && asked[3] > covered[1];
    if !meets {
        return Err(PipelineError::BoundsMissScene { bounds: asked, covered, epsg });
    }
    let (geotransform, size) = snapped(asked, gsd_m)?;
    Ok(OutputGrid { epsg, projection, geotransform, size, gsd_m })
}

/// Tells the choices of [`choose_grid`].
pub(crate) fn tell_grid(config: &DsmConfig, grid: &OutputGrid, coarsest_gsd_m: f64, choices: &mut Choices<'_>) {
    let given = |is_given: bool, else_why: String| if is_given { "given".to_owned() } else { else_why };
    let zone = given(config.crs_epsg.is_some(), "the UTM (or polar) zone of the scene's centre".to_owned());
    choices.tell("crs", format!("EPSG:{}, heights above {}", grid.epsg, config.vertical), zone);
    let matched = match config.preset {
        Preset::Fast => "twice the coarsest image's",
        Preset::Balanced | Preset::Accurate => "the coarsest image's",
    };
    let coarsest = format!("{matched} {coarsest_gsd_m:.3} m, rounded to 5 cm");
    choices.tell("gsd", format!("{} m", grid.gsd_m), given(config.gsd_m.is_some(), coarsest));
    let seen = given(config.bounds.is_some(), "the ground that at least two images see".to_owned());
    choices.tell("bounds", format!("{:.1?}, {} × {} cells", grid.bounds(), grid.size.0, grid.size.1), seen);
}

/// To whole multiples of 5 cm: a tidy number costs no detail.
fn rounded_gsd(gsd_m: f64) -> f64 {
    ((gsd_m * 20.0).round() / 20.0).max(0.05)
}

/// The map rectangle of the ground that at least two images see.
fn covered_bounds(geometry: &Geometry, projection: &MapProjection) -> Result<Bounds, PipelineError> {
    let hull = shared_ground(&geometry.outlines).ok_or(PipelineError::NoOverlap { share_percent: 0.0 })?;
    let mut b = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for p in hull.exterior().points() {
        let g = geometry.frame.ground_from_enu(geodesy::EnuPoint { east: p.x(), north: p.y(), up: 0.0 });
        let m = projection.map_from_lonlat(g.lon_deg, g.lat_deg)?;
        b = [b[0].min(m.x), b[1].min(m.y), b[2].max(m.x), b[3].max(m.y)];
    }
    Ok(b)
}

/// A north-up grid on whole multiples of the cell size that holds the bounds.
fn snapped(b: Bounds, gsd_m: f64) -> Result<(GeoTransform, (usize, usize)), PipelineError> {
    let down = |v: f64| (v / gsd_m).floor() * gsd_m;
    // A hair inside, so that bounds on the lattice do not gain a cell by rounding.
    let up = |v: f64| ((v / gsd_m) - 1e-6).ceil() * gsd_m;
    let (x0, y1) = (down(b[0] + 1e-6 * gsd_m), up(b[3]));
    let (columns, rows) = (((up(b[2]) - x0) / gsd_m).round(), ((y1 - down(b[1] + 1e-6 * gsd_m)) / gsd_m).round());
    if !(columns >= 1.0 && rows >= 1.0 && columns * rows <= CELLS_MAX) {
        return Err(PipelineError::Value {
            name: "--bounds or --gsd",
            found: format!("a grid of {columns:.0} × {rows:.0} cells"),
            expected: format!("1 to {CELLS_MAX:.0} cells; bounds are x_min y_min x_max y_max in the DSM's CRS"),
        });
    }
    Ok((GeoTransform::north_up(x0, y1, gsd_m), (columns as usize, rows as usize)))
}

/// Side of a pixel on the ground at the scene's centre, metres; `None` where the image's model has no ground there.
pub(crate) fn ground_sampling(image: &Opened, centre: LonLatHeight) -> Option<f64> {
    image.camera.gsd(centre).ok().map(|g| g.mean_m())
}

/// No image reaches further than this, pixels; cameras may say anything far outside their images.
const FARTHEST_PX: f64 = 1e9;

/// The pixels that show the grid at some height of the range, grown by `margin`; they may lie outside the image.
pub(crate) fn image_span(
    image: &Opened,
    grid: &OutputGrid,
    range_m: (f64, f64),
    margin: usize,
) -> Result<Window, PipelineError> {
    let (columns, rows) = (grid.size.0 as f64, grid.size.1 as f64);
    let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (c, r) in [(0.0, 0.0), (columns, 0.0), (0.0, rows), (columns, rows)] {
        let (x, y) = grid.geotransform.map_from_cell(c - 0.5, r - 0.5);
        let (lon, lat) = grid.projection.lonlat_from_map(x, y)?;
        for h in [range_m.0, range_m.1] {
            let failed = |source| PipelineError::Camera { path: image.path.clone(), source };
            let p = image.camera.project(LonLatHeight::new(lon, lat, h)).map_err(failed)?;
            let at = [p.sample, p.line].map(|v| v.clamp(-FARTHEST_PX, FARTHEST_PX));
            lo = [lo[0].min(at[0]), lo[1].min(at[1])];
            hi = [hi[0].max(at[0]), hi[1].max(at[1])];
        }
    }
    let wanted = Window {
        x: lo[0].floor() as i64,
        y: lo[1].floor() as i64,
        width: (hi[0] - lo[0]).ceil() as usize + 1,
        height: (hi[1] - lo[1]).ceil() as usize + 1,
    };
    Ok(wanted.grown(margin))
}

/// The part of [`image_span`] that the image has.
pub(crate) fn image_window(
    image: &Opened,
    grid: &OutputGrid,
    range_m: (f64, f64),
    margin: usize,
) -> Result<Option<Window>, PipelineError> {
    Ok(image_span(image, grid, range_m, margin)?.intersection(&Window::whole(image.size.0, image.size.1)))
}

/// The height at which footprints and angles are taken: the middle of what the ties saw, else of the range.
pub(crate) fn middle_height(adjustment: &Adjustment, range: (f64, f64)) -> f64 {
    let (lo, hi) = span_of(adjustment, TIES_MIN).unwrap_or(range);
    (0.5 * (lo + hi)).clamp(range.0, range.1)
}

/// For each pyramid level that all views have, the shortest side of any view on it, pixels; absent views do not count.
pub(crate) fn smallest_sides(views: &[sweep::SweepView]) -> Vec<usize> {
    let is_there = |v: &&sweep::SweepView| v.levels.iter().any(|l| !l.data().is_empty());
    let there: Vec<&sweep::SweepView> = views.iter().filter(is_there).collect();
    let levels = there.iter().map(|v| v.levels.len()).min().unwrap_or(0);
    let side = |level: usize| there.iter().map(|v| v.levels[level].width().min(v.levels[level].height())).min();
    (0..levels).filter_map(side).collect()
}
