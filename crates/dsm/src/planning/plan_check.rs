//! Checks of a plan that was read: it may come from elsewhere, be damaged, or be made to harm.
//!
//! A stage trusts the plan that it is given: positions are taken as such, windows are read, and
//! memory is taken for them. So every number of a plan is compared with what it follows from or
//! must fit: windows with the images, cores with the grid, positions with the number of images,
//! levels and memory with the windows, steps with the cameras. What remains are measurements that
//! nothing else in the plan tells, such as noise. They are bounded.

use std::collections::{BTreeMap, BTreeSet};

use camera::{ImageCorrection, RpcCamera};
use crs::MapProjection;
use formats::raster::iso_time;
use geodesy::LonLatHeight;
use raster::Window;
use reconstruct::{
    CELLS_MAX, DsmGrid, HeightRange, ImagePair, PYRAMID_LEVELS_MAX, choose_levels, pair_geometry, smallest_sides,
    snapped,
};

use crate::error::DsmError;
use crate::images::image_windows::GroundBox;
use crate::images::open::Opened;
use crate::images::order::sort_by_content;
use crate::images::radiometry::ImageRadiometry;
use crate::images::scene_image::SceneImage;
use crate::memory;
use crate::planning::chunk_plan::{ChunkSweep, ChunkWork};
use crate::planning::chunk_side::{MARGIN_PX, aligned, with_rim};
use crate::planning::grid::asked_bounds;
use crate::planning::plan::{Plan, PlanReport};
use crate::report::{PointingReport, ReferenceReport};

/// Heights that no plan searches, metres: twice the lowest and the highest ground, for the ranges
/// of chunks are widened by half a span and by towers.
const HEIGHTS: HeightRange = HeightRange::new(-20_000.0, 20_000.0);
/// Largest grey value, noise or contrast that an image has, grey values: sums of squares of 16 bits
/// stay below it, and float images are brought to numbers like those of sensors.
const GREY_MAX: f32 = 1e9;
/// Largest residual, pixels: no sensor's pointing is off by the length of its strip.
const RESIDUAL_MAX_PX: f64 = 1e6;
/// Largest shift of a correction, pixels, and of its linear part, pixels per pixel. Beyond them the
/// camera is of another image.
const SHIFT_MAX_PX: f64 = 1e5;
const LINEAR_MAX: f64 = 0.5;
/// No image reaches further than this, pixels: the longest strips have a million lines.
const REACH_MAX_PX: f64 = 1e7;
/// Share by which a cell may differ from the width that is said of it: rounding, and on a map of
/// degrees, where the latitude of the middle of a scene counts, the length of degrees elsewhere.
const CELL_TOLERANCE: f64 = 1e-6;
const CELL_TOLERANCE_DEGREES: f64 = 0.1;
/// Share of a cell by which the corner of a grid may miss the lattice: rounding.
const LATTICE_TOLERANCE: f64 = 1e-3;
/// Height step of a plan over what the pairs used need. The widest pair of the scene, which counts,
/// may be used by no chunk, and has up to a hundred times the parallax of the narrowest. The other
/// way it is the same pair at another place.
const STEP_SHARES: [f64; 2] = [0.002, 4.0];
/// Pixel of the coarsest image over the coarsest one that a chunk uses. The coarsest of the scene
/// may be used by none.
const PIXEL_SHARES: [f64; 2] = [0.25, 100.0];

/// Text: what was found and what was expected.
type Checked = Result<(), String>;

/// Returns an error unless a condition holds.
fn ensure(holds: bool, text: impl FnOnce() -> String) -> Checked {
    if holds { Ok(()) } else { Err(text()) }
}

fn ensure_between(name: &str, value: f64, [low, high]: [f64; 2]) -> Checked {
    ensure((low..=high).contains(&value), || format!("{name} is {value}, expected {low} to {high}"))
}

fn ensure_count(name: &str, found: usize, expected: usize) -> Checked {
    ensure(found == expected, || format!("it has {found} {name}, expected {expected}"))
}

impl Plan {
    /// Checks that all parts of a plan fit each other, so that chunks can be computed and merged.
    ///
    /// # Errors
    /// A text with what was found and what was expected.
    pub(crate) fn check(&self) -> Checked {
        self.config.validate().map_err(|e| format!("its configuration is wrong: {e}"))?;
        self.check_images()?;
        let projection = check_grid(&self.grid)?;
        self.check_grid_choice()?;
        check_range("the height range", self.height_range)?;
        ensure(self.tuning == self.config.preset.tuning(), || {
            "its tuning is not that of the preset in its configuration".to_owned()
        })?;
        ensure(self.step_m.is_finite() && self.step_m > 0.0, || format!("the height step is {} m", self.step_m))?;
        ensure(self.pixel_m.is_finite() && self.pixel_m > 0.0, || format!("the pixel is {} m wide", self.pixel_m))?;
        self.check_division()?;
        for (index, chunk) in self.chunks.iter().enumerate() {
            if let ChunkWork::Sweep(sweep) = &chunk.work {
                sweep
                    .check(self, chunk.core)
                    .and_then(|()| sweep.check_windows(self, &projection))
                    .map_err(|text| format!("chunk {index}: {text}"))?;
            }
        }
        self.check_steps(&projection)?;
        self.report.check(self)
    }

    /// Checks that the images of the plan are those of its files, as the first stage finds
    /// them, but for the corrections of their cameras.
    ///
    /// # Errors
    /// A text with the image.
    pub(crate) fn check_opened(&self, opened: &Opened) -> Checked {
        let plain =
            |image: &SceneImage| SceneImage { camera: RpcCamera::new(image.camera.rpc.clone()), ..image.clone() };
        for image in &self.images {
            let is_same = opened.images.iter().any(|other| *other == plain(image));
            ensure(is_same, || {
                format!("size, RPC, band or masks are not those of the file: {}", image.path.display())
            })?;
        }
        Ok(())
    }

    fn check_images(&self) -> Checked {
        let n = self.images.len();
        ensure_count("images", n, self.config.images.len())?;
        ensure_count("images with noise and contrast", self.radiometry.len(), n)?;
        let mut given = vec![false; n];
        for image in &self.images {
            let is_first = given.get_mut(image.number).is_some_and(|given| !std::mem::replace(given, true));
            ensure(is_first, || {
                format!("the number {} of an image is none of 0 to {}, each once", image.number, n - 1)
            })?;
            ensure(image.path == self.config.images[image.number], || {
                format!("the image is not that of the configuration: {}", image.path.display())
            })?;
            image.check().map_err(|text| format!("{text}: {}", image.path.display()))?;
        }
        let mut sorted = self.images.clone();
        sort_by_content(&mut sorted);
        ensure(sorted == self.images, || "its images are not in the order of their content".to_owned())?;
        self.radiometry.iter().try_for_each(ImageRadiometry::check)?;
        let different: BTreeSet<&ImagePair> = self.useful.iter().collect();
        ensure_count("useful pairs", self.useful.len(), different.len())?;
        self.useful.iter().try_for_each(|pair| {
            ensure(pair.first < pair.second && pair.second < n, || format!("the pair {pair} is none of {n} images"))
        })
    }

    /// Compares the grid with what the configuration asks for.
    fn check_grid_choice(&self) -> Checked {
        let (grid, config) = (&self.grid, &self.config);
        ensure(config.gsd_m.is_none_or(|gsd_m| gsd_m == grid.gsd_m), || {
            format!("cells are {} m wide, asked for are {:?} m", grid.gsd_m, config.gsd_m)
        })?;
        let [x, width, _, y, _, height] = grid.geotransform.0;
        let is_whole = |at: f64, side: f64| ((at / side).round() * side - at).abs() <= LATTICE_TOLERANCE * side.abs();
        ensure(is_whole(x, width) && is_whole(y, height), || {
            format!("the corner {x}, {y} of the grid is no whole multiple of its cells")
        })?;
        let asked = grid.projection().map_err(DsmError::from).and_then(|map| asked_bounds(config, &map));
        let asked = asked.and_then(|asked| asked.map(|bounds| Ok(snapped(bounds, (width, -height))?)).transpose());
        ensure(asked.is_ok_and(|asked| asked.is_none_or(|asked| asked == (grid.geotransform, grid.size))), || {
            format!("the grid {:?} is not that of the bounds in the configuration", grid.bounds().to_array())
        })?;
        ensure(config.crs_epsg.is_none_or(|code| code == grid.epsg), || {
            format!("the grid has EPSG:{}, asked for is {:?}", grid.epsg, config.crs_epsg)
        })
    }

    /// Checks that the cores of the chunks cover the grid once.
    fn check_division(&self) -> Checked {
        let whole = self.grid.whole();
        let side = self.chunk_side.unwrap_or(usize::MAX);
        if self.chunk_side.is_none() {
            ensure_count("chunks for a scene that is computed at once", self.chunks.len(), 1)?;
        }
        for (index, chunk) in self.chunks.iter().enumerate() {
            let core = chunk.core;
            let is_inside = core.width > 0 && core.height > 0 && core.intersection(&whole) == Some(core);
            ensure(is_inside && core.width.max(core.height) <= side, || {
                let (columns, rows) = self.grid.size;
                format!("chunk {index} has the cells {core:?} of a grid of {columns} × {rows} and sides up to {side}")
            })?;
        }
        let covered: u64 = self.chunks.iter().map(|chunk| memory::area(&chunk.core)).fold(0, u64::saturating_add);
        ensure(covered == memory::area(&whole), || {
            format!("its chunks have {covered} cells, the grid has {}", memory::area(&whole))
        })?;
        let cores: Vec<Window> = self.chunks.iter().map(|chunk| chunk.core).collect();
        match overlapping(&cores) {
            None => Ok(()),
            Some((a, b)) => Err(format!("two chunks have cells in common: {a:?} and {b:?}")),
        }
    }

    /// Compares height step and pixel with the cameras, in the middle of every chunk.
    fn check_steps(&self, projection: &MapProjection) -> Checked {
        let (mut widest, mut coarsest_m) = (0f64, 0f64);
        for chunk in &self.chunks {
            let ChunkWork::Sweep(sweep) = &chunk.work else { continue };
            let Window { x, y, width, height } = chunk.core;
            let cell = (x as f64 + 0.5 * width as f64, y as f64 + 0.5 * height as f64);
            let at = self.grid.geotransform.map_from_cell(cell.0, cell.1);
            let Ok((lon_deg, lat_deg)) = projection.lonlat_from_map(at.0, at.1) else { continue };
            let ground = LonLatHeight::new(lon_deg, lat_deg, sweep.height_range.middle_m());
            for (i, sources) in sweep.sources.iter().enumerate().filter(|(_, sources)| !sources.is_empty()) {
                let camera = &self.images[i].camera;
                coarsest_m = camera.gsd(ground).map_or(coarsest_m, |gsd| coarsest_m.max(gsd.mean_m()));
                for source in sources {
                    let pair = pair_geometry(camera, &self.images[*source].camera, ground, 1.0);
                    widest = pair.map_or(widest, |pair| widest.max(pair.parallax_px_per_m));
                }
            }
        }
        if widest > 0.0 {
            let needed_m = self.tuning.step_px / widest;
            ensure_between("the height step", self.step_m, STEP_SHARES.map(|share| share * needed_m))?;
        }
        if coarsest_m > 0.0 {
            ensure_between("the pixel", self.pixel_m, PIXEL_SHARES.map(|share| share * coarsest_m))?;
        }
        Ok(())
    }
}

impl SceneImage {
    fn check(&self) -> Checked {
        let (width, height) = self.size;
        ensure(width > 0 && height > 0, || format!("the image has {width} × {height} pixels"))?;
        self.camera.rpc.validate().map_err(|e| e.to_string())?;
        check_correction(&self.camera.correction)?;
        ensure(self.gain.is_finite() && self.gain > 0.0, || format!("the gain of the image is {}", self.gain))
    }
}

fn check_correction(correction: &ImageCorrection) -> Checked {
    let ImageCorrection { translation_px, linear, centre } = correction;
    let is_small = translation_px.iter().all(|shift| shift.abs() <= SHIFT_MAX_PX)
        && linear.iter().flatten().all(|part| part.abs() <= LINEAR_MAX)
        && [centre.sample, centre.line].iter().all(|at| at.abs() <= REACH_MAX_PX);
    ensure(is_small, || format!("the correction of the pointing is that of another image ({correction:?})"))
}

impl ImageRadiometry {
    fn check(&self) -> Checked {
        let levels = self.contrast.len();
        ensure(levels <= PYRAMID_LEVELS_MAX, || {
            format!("an image has the contrast of {levels} levels, expected at most {PYRAMID_LEVELS_MAX}")
        })?;
        let mut all = self.noise.iter().chain(self.contrast.iter().flatten());
        match all.find(|value| !(0.0..=GREY_MAX).contains(*value)) {
            None => Ok(()),
            Some(value) => Err(format!("the noise or contrast of an image is {value} grey values")),
        }
    }
}

/// Returns the projection of the grid, whose cells are as wide as said and lie on the map.
fn check_grid(grid: &DsmGrid) -> Result<MapProjection, String> {
    let projection = grid.projection().map_err(|e| e.to_string())?;
    let (columns, rows) = grid.size;
    let cells = columns as f64 * rows as f64;
    ensure((1.0..=CELLS_MAX).contains(&cells), || {
        format!("the grid has {columns} × {rows} cells, expected 1 to {CELLS_MAX:.0}")
    })?;
    let [x, width, turn_x, y, turn_y, height] = grid.geotransform.0;
    let is_north_up = width > 0.0 && height < 0.0 && turn_x == 0.0 && turn_y == 0.0;
    ensure(is_north_up && [x, y, width, height].iter().all(|v| v.is_finite()), || {
        format!("the grid is not north up: its geotransform is {:?}", grid.geotransform.0)
    })?;
    let bounds = grid.bounds();
    let corners = [(bounds.x_min, bounds.y_min), (bounds.x_max, bounds.y_max)];
    let [low, high] = corners.map(|(x, y)| projection.lonlat_from_map(x, y));
    let (low, high) = (low.map_err(|e| e.to_string())?, high.map_err(|e| e.to_string())?);
    let is_in_degrees = projection.metres_per_unit().is_none();
    let tolerance = if is_in_degrees { CELL_TOLERANCE_DEGREES } else { CELL_TOLERANCE };
    let (across_m, along_m) = projection.metres_per_unit_at(0.5 * (low.1 + high.1));
    for (side, metres) in [(width, across_m), (-height, along_m)] {
        let share = side * metres / grid.gsd_m;
        ensure((share - 1.0).abs() <= tolerance, || {
            format!("cells are {} m wide by the map, and {} m as said", side * metres, grid.gsd_m)
        })?;
    }
    Ok(projection)
}

fn check_range(name: &str, range: HeightRange) -> Checked {
    let HeightRange { low_m, high_m } = range;
    ensure(HEIGHTS.contains(low_m) && HEIGHTS.contains(high_m) && low_m < high_m, || {
        format!("{name} is {low_m} to {high_m} m, expected two heights of the Earth, the lower first")
    })
}

impl ChunkSweep {
    fn check(&self, plan: &Plan, core: Window) -> Checked {
        let extent = with_rim(&plan.grid, core);
        ensure(self.extent == extent, || format!("computes the cells {:?}, expected {extent:?}", self.extent))?;
        self.check_sources(plan)?;
        check_range("the height range", self.height_range)?;
        if plan.chunk_side.is_none() {
            ensure(self.height_range == plan.height_range, || "its heights are not those of the scene".to_owned())?;
        }
        let levels =
            choose_levels(self.height_range, plan.step_m, &smallest_sides(self.windows.iter().flatten()), &plan.tuning);
        ensure(self.levels == levels, || format!("has the pyramid {:?}, expected {levels:?}", self.levels))?;
        let pixels: Vec<u64> = self.windows.iter().flatten().map(memory::area).collect();
        let least_mb = memory::least_mb(&pixels, memory::area(&self.extent), plan.tuning.lattices);
        let limit_mb = memory::limit_mb(&plan.config);
        ensure(least_mb <= limit_mb, || format!("takes at least {least_mb} MB, allowed are {limit_mb} MB"))
    }

    /// Compares the windows with the pixels that show the cells. The last digit of a projection may
    /// differ between machines, and with it the pixel at which a window ends.
    fn check_windows(&self, plan: &Plan, projection: &MapProjection) -> Checked {
        let ground = GroundBox::new(&plan.grid.part(self.extent), projection, self.height_range);
        let ground = ground.map_err(|e| e.to_string())?;
        for (i, (image, window)) in plan.images.iter().zip(&self.windows).enumerate() {
            let is_used = !self.sources[i].is_empty() || self.sources.iter().any(|sources| sources.contains(&i));
            let is_whole = plan.chunk_side.is_none() && *window == Some(image.whole());
            if is_whole || (!is_used && window.is_none()) {
                continue;
            }
            let mut is_expected = false;
            for margin in [MARGIN_PX, MARGIN_PX - 1, MARGIN_PX + 1] {
                let span = ground.span_in(image, margin).map_err(|e| e.to_string())?;
                is_expected |= aligned(span).intersection(&image.whole()) == *window;
            }
            ensure(is_expected, || format!("reads {window:?} of image {i}, which is not what shows its cells"))?;
        }
        Ok(())
    }

    fn check_sources(&self, plan: &Plan) -> Checked {
        let n = plan.images.len();
        ensure_count("windows", self.windows.len(), n)?;
        ensure_count("lists of sources", self.sources.len(), n)?;
        for (image, window) in plan.images.iter().zip(&self.windows) {
            let whole = image.whole();
            let is_inside = window.is_none_or(|w| w.width > 0 && w.height > 0 && w.intersection(&whole) == Some(w));
            ensure(is_inside, || format!("reads {window:?} of an image of {} × {} pixels", whole.width, whole.height))?;
        }
        ensure(self.sources.iter().any(|sources| !sources.is_empty()), || "no image has a source".to_owned())?;
        for (i, sources) in self.sources.iter().enumerate() {
            for (k, &source) in sources.iter().enumerate() {
                ensure(source < n && source != i && !sources[..k].contains(&source), || {
                    format!("image {i} has the source {source}, expected each other image of {n} at most once")
                })?;
                let pair = ImagePair::new(i, source).ordered();
                ensure(plan.useful.contains(&pair), || {
                    format!("the pair {pair} is compared and not among the useful")
                })?;
            }
        }
        Ok(())
    }
}

impl PlanReport {
    fn check(&self, plan: &Plan) -> Checked {
        let n = plan.images.len();
        ensure_count("images in its report", self.images.len(), n)?;
        for image in &plan.images {
            let told = &self.images[image.number];
            let is_same = told.path == image.path && told.size == image.size;
            let is_dated = told.acquired == image.acquired_s.and_then(iso_time)
                && told.sun == image.sun
                && told.satellite == image.satellite;
            ensure(is_same && is_dated && told.applied_correction == image.camera.correction, || {
                format!("the report names another image, date or correction than the plan: {}", told.path.display())
            })?;
        }
        for pair in &self.pairs {
            let (first, second) = pair.images;
            ensure((1..=n).contains(&first) && (1..=n).contains(&second), || {
                format!("the report names the pair {first}-{second} of {n} images")
            })?;
        }
        self.pointing.check(n)
    }
}

impl PointingReport {
    fn check(&self, images: usize) -> Checked {
        ensure_count("images in the report of its pointing", self.images.len(), images)?;
        let residuals = [self.residual_before_px, self.residual_after_px, self.rms_px];
        let of_images = self.images.iter().map(|image| image.residual_px);
        let of_ties = self.images.iter().flat_map(|image| image.tie_residuals_px.iter().flat_map(|tie| &tie[2..]));
        let is_residual = |px: f64| px.is_nan() || px.abs() <= RESIDUAL_MAX_PX;
        match residuals.into_iter().chain(of_images).chain(of_ties.copied()).find(|px| !is_residual(*px)) {
            Some(px) => Err(format!("a residual of its pointing is {px} px")),
            None => self.reference.as_ref().map_or(Ok(()), ReferenceReport::check),
        }
    }
}

impl ReferenceReport {
    fn check(&self) -> Checked {
        let mut shifts = self.shift_m.iter().chain(self.plane_m_per_km.iter().flatten());
        match shifts.find(|shift| shift.abs() > HEIGHTS.high_m) {
            Some(shift) => Err(format!("its reference moved the scene by {shift} m")),
            None => Ok(()),
        }
    }
}

/// Returns two windows that have cells in common, if there are any. Windows are passed from the
/// first row to the last, and those on a row are known by their first column.
fn overlapping(windows: &[Window]) -> Option<(Window, Window)> {
    let mut begins: Vec<&Window> = windows.iter().collect();
    begins.sort_by_key(|window| window.y);
    let mut ends = begins.clone();
    ends.sort_by_key(|window| window.y + window.height as i64);
    let mut ended = ends.into_iter().peekable();
    let mut on_row: BTreeMap<i64, &Window> = BTreeMap::new();
    for window in begins {
        while let Some(last) = ended.next_if(|last| last.y + last.height as i64 <= window.y) {
            on_row.remove(&last.x);
        }
        let before = on_row.range(..=window.x).next_back().filter(|(x, other)| **x + other.width as i64 > window.x);
        let after = on_row.range(window.x..window.x + window.width as i64).next();
        if let Some((_, other)) = before.or(after) {
            return Some((**other, *window));
        }
        on_row.insert(window.x, window);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planning::chunk_side::{cores, quarters};

    #[test]
    fn cells_in_common_are_found_in_any_order() {
        let mut all: Vec<Window> = cores((1000, 700), 300).into_iter().flat_map(quarters).collect();
        all.reverse();
        assert_eq!(overlapping(&all), None);
        all.rotate_left(7);
        assert_eq!(overlapping(&all), None);
        for i in 0..all.len() {
            for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
                let mut moved = all.clone();
                moved[i].x += dx;
                moved[i].y += dy;
                // A move out of the grid meets no other window on that side.
                let meets = (0..all.len()).any(|j| j != i && moved[i].intersection(&all[j]).is_some());
                assert_eq!(overlapping(&moved).is_some(), meets, "{:?}", moved[i]);
            }
        }
    }
}
