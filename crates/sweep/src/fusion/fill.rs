//! Filling of voids, each by its reason.
//!
//! Every void has a bound: the height above which two views see past the known surface (see
//! `envelope`). Each void cell is judged by it:
//!
//! - If the lowest surface around lies under the bound, the cell is *hidden* from all but one view.
//!   It gets this surface: the heights not above the bound, near the lowest of them, weighted by
//!   inverse squared distances. A street between towers is never filled with a roof, as two views
//!   would have seen it.
//! - Otherwise two views see the cell and their pictures do not match. A *narrow* void is closed. A
//!   wider one is completed where the known heights around it fit one plane, and where it lies
//!   between two opposite heights. It stays open where the images are blank (a saturated roof), and
//!   where heights are known on one side only (water).
//! - What fewer than two views image is outside and stays open, unless it is narrow.
//!
//! Small islands of heights may be chance, so that nothing is filled from them.
//!
//! The standard deviation of a filled height holds the spread of all heights that it could have
//! been filled from, and grows with the distance to the nearest of them.

use raster::Grid;
use rayon::prelude::*;

use super::border::{Border, BorderCell, Wanted, number_voids};
use super::directions::{Setting, settings};
use super::plane::{Plane, border_planes};
use super::speckle::remove_speckle;

/// Where the height of a cell comes from, or why it has none: the codes of `dsm/source.tif`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum CellSource {
    /// Void: fewer than two views image the cell.
    Outside = 0,
    /// The height was observed.
    Observed = 1,
    /// Filled: hidden from all but one view. The ground under what hides it.
    FilledHidden = 2,
    /// Filled: two views see it and do not match. Completed from its surroundings.
    FilledSurface = 3,
    /// Filled: a narrow gap that two views see.
    FilledNarrow = 4,
    /// Void: two views see it and do not match: change, water, too little texture.
    Unmatched = 10,
    /// Void: the images have a single grey value there.
    Blank = 11,
    /// Void: hidden from all but one view. No ground is known near, or nothing was to be filled.
    Hidden = 12,
}

impl CellSource {
    /// Returns the code in `dsm/source.tif`.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Returns whether the cell was filled.
    #[must_use]
    pub const fn is_filled(self) -> bool {
        matches!(self, Self::FilledHidden | Self::FilledSurface | Self::FilledNarrow)
    }
}

/// Which voids are filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FillRule {
    /// None: only the reasons are found.
    Nothing,
    /// Those for which a reason says how.
    Justified,
    /// All that known heights enclose.
    Everything,
}

/// Parameters of the filling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillConfig {
    /// Which voids are filled.
    pub rule: FillRule,
    /// Largest distance of known heights between which a void is filled, cells.
    pub reach_cells: usize,
    /// Largest distance of the ground with which a hidden void is filled, cells.
    pub hidden_reach_cells: usize,
    /// Largest distance of two opposite known heights between which a void is filled in any case,
    /// cells.
    pub narrow_cells: f32,
    /// Smallest number of connected cells with heights from which voids are filled.
    pub island_cells: usize,
    /// Largest difference of neighbouring heights on one level, metres.
    pub same_surface_m: f32,
    /// Increase of that difference for every cell between the heights, metres.
    pub slope_m: f32,
    /// Increase of the standard deviation for every cell to the nearest known height, metres.
    pub sigma_slope_m: f32,
}

/// What was filled, and why.
#[derive(Debug, Clone)]
pub struct FilledVoids {
    /// Source of each cell.
    pub source: Grid<CellSource>,
    /// Standard deviations of the filled heights, metres; NaN elsewhere.
    pub sigma_m: Grid<f32>,
}

/// Void cells are filled in blocks of this side, which share their candidates.
const BLOCK: usize = 4;
/// Number of candidates of a void cell: those all around a gap of a street's width.
const CANDIDATES: usize = 256;
/// The lowest surface is the one with this many candidates under it: a few may be wrong.
const LOWEST: usize = 5;
/// Least part of the candidates of which the lowest is taken where there are few.
const LOWEST_SHARE: usize = 4;

/// Fills voids of `height_m` in place. Only heights that are `trusted` hide the ground. `blind`
/// marks cells where the images could not show what stands there. `bound_m` holds the greatest
/// height at which a void cell may be hidden from all but one view: −∞ where two views see
/// everything, +∞ where fewer image it.
pub fn fill_voids(
    height_m: &mut Grid<f32>,
    trusted: &Grid<bool>,
    blind: &Grid<bool>,
    bound_m: impl Fn(&Grid<f32>, &[usize]) -> Vec<f32>,
    config: &FillConfig,
) -> FilledVoids {
    let (width, height) = (height_m.width(), height_m.height());
    let voids: Vec<usize> = (0..height_m.data().len()).filter(|&i| height_m.data()[i].is_nan()).collect();
    let mut source = Grid::filled(width, height, CellSource::Observed);
    let mut sigma_m = Grid::filled(width, height, f32::NAN);
    let mut solid = height_m.clone();
    solid.data_mut().iter_mut().zip(trusted.data()).filter(|(_, t)| !**t).for_each(|(h, _)| *h = f32::NAN);
    let bounds = bound_m(&solid, &voids);
    let mut sources = height_m.clone();
    remove_speckle(&mut sources, f32::INFINITY, config.island_cells);
    let settings = settings(&sources, blind, &voids, config.reach_cells as f32);
    let (numbers, count) = number_voids(height_m);
    let border = Border::new(&sources, &numbers);
    let planes = border_planes(border.cells(), count, config.same_surface_m);
    let filling = Filling { numbers: &numbers, border: &border, planes: &planes, blind, config };
    let cells = voids.iter().zip(bounds).zip(settings);
    let mut cells: Vec<VoidCell> = cells.map(|((&i, b), setting)| VoidCell::new(i, width, b, setting)).collect();
    // Stable, so that the cells of a block stay in the order of the rows.
    cells.sort_by_key(|cell| (cell.block(), numbers.data()[cell.index]));
    let is_same =
        |a: &VoidCell, b: &VoidCell| a.block() == b.block() && numbers.data()[a.index] == numbers.data()[b.index];
    let blocks: Vec<&[VoidCell]> = cells.chunk_by(is_same).collect();
    let found: Vec<Vec<Judged>> = blocks.par_iter().map(|block| filling.judge_block(block)).collect();
    for (cell, judged) in cells.iter().zip(found.iter().flatten()) {
        source.data_mut()[cell.index] = judged.source;
        if let Some(estimate) = judged.estimate {
            height_m.data_mut()[cell.index] = estimate.height_m;
            sigma_m.data_mut()[cell.index] = estimate.sigma_m;
        }
    }
    FilledVoids { source, sigma_m }
}

/// A cell without a height.
#[derive(Debug, Clone, Copy)]
struct VoidCell {
    index: usize,
    x: usize,
    y: usize,
    bound_m: f32,
    setting: Setting,
}

impl VoidCell {
    fn new(index: usize, width: usize, bound_m: f32, setting: Setting) -> Self {
        Self { index, x: index % width, y: index / width, bound_m, setting }
    }

    fn block(&self) -> (usize, usize) {
        (self.y / BLOCK, self.x / BLOCK)
    }

    fn at(&self) -> [f32; 2] {
        [self.x as f32, self.y as f32]
    }
}

/// A height found from candidates.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    height_m: f32,
    sigma_m: f32,
}

/// What became of a void cell.
#[derive(Debug, Clone, Copy)]
struct Judged {
    source: CellSource,
    estimate: Option<Estimate>,
}

/// Known heights from which a void cell may be filled.
#[derive(Clone, Copy)]
struct Candidates<'a> {
    /// Nearest heights at the border of the cell's void.
    own: &'a [BorderCell],
    /// Heights among which ground under the cell's bound is looked for.
    under: &'a [BorderCell],
    /// Heights among which the lower of the surfaces around the cell is looked for.
    beside: &'a [BorderCell],
}

/// Everything that decides about a void cell.
struct Filling<'a> {
    numbers: &'a Grid<u32>,
    border: &'a Border,
    /// Planes of the voids, by their numbers from 1.
    planes: &'a [Option<Plane>],
    blind: &'a Grid<bool>,
    config: &'a FillConfig,
}

impl Filling<'_> {
    /// Judges the cells of one block, which belong to one void.
    fn judge_block(&self, cells: &[VoidCell]) -> Vec<Judged> {
        let void = self.numbers.data()[cells[0].index];
        let corner = |at: usize| (at * BLOCK) as f32 + 0.5 * (BLOCK - 1) as f32;
        let (row, column) = cells[0].block();
        let centre = [corner(column), corner(row)];
        let reach = self.config.hidden_reach_cells as f32;
        let (mut own, mut low, mut sides) = (Vec::new(), Vec::new(), Vec::new());
        let wanted = Wanted { void: Some(void), height_max_m: f32::INFINITY, count: CANDIDATES, reach };
        self.border.nearest(centre, wanted, &mut own);
        // In a wide void the ground may be further away than the walls around it. A narrow one that
        // the heights around it enclose is a gap in their surface.
        let is_wide = self.planes[void as usize - 1].is_none();
        let is_wide = |cell: &VoidCell| is_wide && cell.setting.width_cells > self.config.narrow_cells;
        let seeks = |cell: &VoidCell| is_wide(cell) && cell.bound_m < f32::INFINITY;
        let tolerance_m = self.config.same_surface_m;
        let lacks = |cell: &VoidCell, height_m: f32| seeks(cell) && !is_enough(&own, height_m + tolerance_m);
        // One list for each limit: the nearest roofs would displace the ground from a shared one.
        let further = |limit_m: fn(&VoidCell) -> f32, out: &mut Vec<BorderCell>| {
            let lacking = cells.iter().filter(|c| lacks(c, limit_m(c))).map(limit_m);
            let height_max_m = lacking.fold(f32::NEG_INFINITY, f32::max) + tolerance_m;
            if height_max_m.is_finite() {
                self.border.nearest(centre, Wanted { void: None, height_max_m, ..wanted }, out);
            }
        };
        further(|cell| cell.bound_m, &mut low);
        further(|cell| cell.setting.low_m, &mut sides);
        let judge = |cell: &VoidCell| {
            let under = if lacks(cell, cell.bound_m) { &low } else { &own };
            let beside = if lacks(cell, cell.setting.low_m) { &sides } else { &own };
            self.judge(cell, void, Candidates { own: &own, under, beside })
        };
        cells.iter().map(judge).collect()
    }

    fn judge(&self, cell: &VoidCell, void: u32, candidates: Candidates<'_>) -> Judged {
        let Candidates { own, under, beside } = candidates;
        let config = self.config;
        let is_outside = cell.bound_m == f32::INFINITY;
        let limit_m = cell.bound_m + config.same_surface_m;
        let ground = if is_outside { None } else { self.lowest_surface(cell, under, limit_m) };
        let is_hidden = match &ground {
            Some((base_m, _)) => *base_m <= cell.bound_m,
            // With no height under the bound, those above it would have been seen.
            None => !is_outside && own.is_empty() && cell.bound_m > f32::NEG_INFINITY,
        };
        let is_blind = self.blind.data()[cell.index];
        let open = match (is_outside, is_hidden, is_blind) {
            (true, ..) => CellSource::Outside,
            (_, true, _) => CellSource::Hidden,
            (_, _, true) => CellSource::Blank,
            _ => CellSource::Unmatched,
        };
        let nothing = Judged { source: open, estimate: None };
        if config.rule == FillRule::Nothing {
            return nothing;
        }
        if let (true, Some((_, estimate))) = (is_hidden, ground) {
            return Judged { source: CellSource::FilledHidden, estimate: Some(estimate) };
        }
        let Setting { is_enclosed, width_cells, is_between, low_m } = cell.setting;
        let is_narrow = width_cells <= config.narrow_cells;
        let plane = self.planes[void as usize - 1].filter(|_| !is_blind);
        let is_wanted = match config.rule {
            FillRule::Nothing => false,
            FillRule::Justified => is_narrow || (!is_outside && (is_between || plane.is_some())),
            FillRule::Everything => is_narrow || plane.is_some() || width_cells.is_finite(),
        };
        if !is_enclosed || !is_wanted {
            return nothing;
        }
        let estimate = match plane {
            Some(plane) => Some(self.on_plane(cell, own, plane)),
            None => {
                // Not above what opposite sides of a wide void have in common.
                let is_wide = !is_narrow && low_m.is_finite();
                let limit_m = if is_wide { low_m + config.same_surface_m } else { f32::INFINITY };
                let found = self.lowest_surface(cell, if is_wide { beside } else { own }, limit_m);
                found.or_else(|| self.lowest_surface(cell, own, f32::INFINITY)).map(|(_, estimate)| estimate)
            }
        };
        let source = if is_narrow { CellSource::FilledNarrow } else { CellSource::FilledSurface };
        if estimate.is_some() { Judged { source, estimate } } else { nothing }
    }

    fn on_plane(&self, cell: &VoidCell, own: &[BorderCell], plane: Plane) -> Estimate {
        let nearest = own.iter().map(|c| apart(cell, c)).fold(f32::INFINITY, f32::min);
        Estimate { height_m: plane.at(cell.at()), sigma_m: self.sigma_m(plane.deviation_m, nearest) }
    }

    /// Returns the base of the lowest surface among candidates that are not above `limit_m`, and
    /// the height that continues this surface into the cell; `None` without candidates.
    ///
    /// Distance counts like height here, at the slope of one surface: a pit far away is not lower
    /// than the ground beside the cell.
    fn lowest_surface(&self, cell: &VoidCell, all: &[BorderCell], limit_m: f32) -> Option<(f32, Estimate)> {
        let config = self.config;
        let usable = || all.iter().filter(|c| c.height_m <= limit_m);
        let count = usable().count();
        let rank = count.div_ceil(LOWEST_SHARE).min(LOWEST);
        // The lowest few, in order: reduced height, height, distance.
        let mut lowest = [[f32::INFINITY; 3]; LOWEST];
        for c in usable() {
            let d = apart(cell, c);
            let mut entry = [c.height_m + config.slope_m * d, c.height_m, d];
            if entry[0] < lowest[LOWEST - 1][0] {
                for kept in lowest.iter_mut().filter(|kept| entry[0] < kept[0]).collect::<Vec<_>>() {
                    std::mem::swap(kept, &mut entry);
                }
            }
        }
        let [_, base_m, base_apart] = lowest[rank.checked_sub(1)?];
        let (mut weight, mut sum, mut all_weight, mut squares) = (0.0, 0.0, 0.0, 0.0);
        let mut nearest = f32::INFINITY;
        for c in usable() {
            let d = apart(cell, c);
            let w = 1.0 / (d * d);
            let off = c.height_m - base_m;
            all_weight += w;
            squares += w * off * off;
            if off.abs() <= config.same_surface_m + config.slope_m * (d + base_apart) {
                weight += w;
                sum += w * off;
                nearest = nearest.min(d);
            }
        }
        let above_m = sum / weight;
        // The mean square around the result instead of around the base.
        let all_mean = usable().map(|c| (c.height_m - base_m) / apart(cell, c).powi(2)).sum::<f32>() / all_weight;
        let spread = (squares / all_weight - 2.0 * above_m * all_mean + above_m * above_m).max(0.0).sqrt();
        let estimate = Estimate { height_m: base_m + above_m, sigma_m: self.sigma_m(spread, nearest) };
        Some((base_m, estimate))
    }

    /// Returns the deviation of a filled height from the spread of its candidates and the distance
    /// of the nearest, cells.
    fn sigma_m(&self, spread_m: f32, nearest: f32) -> f32 {
        let grown = 0.5 * self.config.same_surface_m + self.config.sigma_slope_m * nearest;
        spread_m.hypot(grown)
    }
}

/// Returns whether candidates not above a height are enough to tell the ground.
fn is_enough(all: &[BorderCell], limit_m: f32) -> bool {
    let low = all.iter().filter(|c| c.height_m <= limit_m).count();
    low >= LOWEST || (low > 0 && low * LOWEST_SHARE >= all.len())
}

/// Returns the distance of a candidate, cells.
fn apart(cell: &VoidCell, c: &BorderCell) -> f32 {
    (c.x - cell.x as f32).hypot(c.y - cell.y as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: FillConfig = FillConfig {
        rule: FillRule::Justified,
        reach_cells: 8,
        hidden_reach_cells: 50,
        narrow_cells: 6.0,
        island_cells: 36,
        same_surface_m: 1.0,
        slope_m: 0.05,
        sigma_slope_m: 0.1,
    };

    fn fill_with(height_m: &mut Grid<f32>, bound_m: f32, config: &FillConfig) -> FilledVoids {
        let blind = Grid::filled(height_m.width(), height_m.height(), false);
        let trusted = Grid::filled(height_m.width(), height_m.height(), true);
        fill_voids(height_m, &trusted, &blind, |_, voids| vec![bound_m; voids.len()], config)
    }

    /// Fills with two views that see every void.
    fn fill(height_m: &mut Grid<f32>) -> FilledVoids {
        fill_with(height_m, f32::NEG_INFINITY, &CONFIG)
    }

    /// A plain at 1 m with a void of 10 × 10 cells.
    fn void_in_a_plain() -> Grid<f32> {
        let mut out = Grid::filled(40, 40, 1.0f32);
        (10..20).for_each(|x| (10..20).for_each(|y| out[(x, y)] = f32::NAN));
        out
    }

    #[test]
    fn a_void_in_a_slope_gets_the_slope_as_a_plane() {
        let mut g = Grid::from_vec(30, 30, (0..900).map(|i| 0.3 * (i % 30) as f32).collect()).unwrap();
        (8..18).for_each(|x| (8..18).for_each(|y| g[(x, y)] = f32::NAN));
        let found = fill(&mut g);
        assert!((8..18).all(|x| (8..18).all(|y| (g[(x, y)] - 0.3 * x as f32).abs() < 1e-3)), "{:?}", g.row(12));
        assert!((8..18).all(|y| found.source[(12, y)] == CellSource::FilledSurface));
        let sigma = &found.sigma_m;
        assert!(sigma[(13, 13)] > sigma[(9, 9)] && sigma[(9, 9)] >= 0.5 && sigma[(2, 2)].is_nan());
    }

    #[test]
    fn a_narrow_gap_beside_a_wall_gets_the_lower_surface() {
        let mut wall =
            Grid::from_vec(20, 20, (0..400).map(|i| if i % 20 < 10 { 30.0 } else { 2.0 }).collect()).unwrap();
        (0..20).for_each(|y| (10..13).for_each(|x| wall[(x, y)] = f32::NAN));
        let found = fill(&mut wall);
        assert!((10..13).all(|x| (1..19).all(|y| wall[(x, y)] == 2.0)), "{wall:?}");
        assert_eq!(found.source[(11, 10)], CellSource::FilledNarrow);
        // It could have been the wall.
        assert!(found.sigma_m[(11, 10)] > 10.0, "{}", found.sigma_m[(11, 10)]);
    }

    #[test]
    fn a_street_between_towers_is_not_filled_with_roof() {
        // Roofs at 40 m on both sides of a street of 10 cells, whose ground is known at its end
        // only.
        let mut g = Grid::filled(40, 60, 40.0f32);
        (15..25).for_each(|x| (0..60).for_each(|y| g[(x, y)] = if y < 45 { f32::NAN } else { 0.0 }));
        let street = g.clone();
        let found = fill_with(&mut g, 25.0, &CONFIG);
        assert!(
            (15..25).all(|x| (36..45).all(|y| g[(x, y)] == 0.0 && found.source[(x, y)] == CellSource::FilledHidden))
        );
        assert!((15..25).all(|x| (0..36).all(|y| g[(x, y)].is_nan() || g[(x, y)] == 0.0)), "{:?}", g.row(10));
        let mut open = street.clone();
        let reasons = fill_with(&mut open, 25.0, &FillConfig { rule: FillRule::Nothing, ..CONFIG });
        assert_eq!((open[(20, 40)].is_nan(), reasons.source[(20, 40)]), (true, CellSource::Hidden));
    }

    #[test]
    fn blank_images_leave_a_wide_void_open_and_say_so() {
        let (mut blind, trusted) = (Grid::filled(40, 40, false), Grid::filled(40, 40, true));
        (12..20).for_each(|x| (0..40).for_each(|y| blind[(x, y)] = true));
        let (mut seen, mut unseen) = (void_in_a_plain(), void_in_a_plain());
        fill(&mut seen);
        assert!((10..20).all(|x| (10..20).all(|y| seen[(x, y)] == 1.0)), "{:?}", seen.row(15));
        let visible = |_: &Grid<f32>, voids: &[usize]| vec![f32::NEG_INFINITY; voids.len()];
        let found = fill_voids(&mut unseen, &trusted, &blind, visible, &CONFIG);
        assert!((12..20).all(|x| unseen[(x, 15)].is_nan()) && unseen[(10, 15)] == 1.0, "{:?}", unseen.row(15));
        assert_eq!(found.source[(15, 15)], CellSource::Blank);
        let everything = FillConfig { rule: FillRule::Everything, ..CONFIG };
        fill_voids(&mut unseen, &trusted, &blind, visible, &everything);
        assert!((10..20).all(|x| (10..20).all(|y| unseen[(x, y)] == 1.0)), "{:?}", unseen.row(15));
    }

    #[test]
    fn a_void_with_heights_on_one_side_stays_open_and_says_why() {
        let mut g = Grid::filled(60, 60, f32::NAN);
        (10..50).for_each(|x| (10..50).for_each(|y| g[(x, y)] = if x > 40 { 30.0 } else { 1.0 }));
        let void = g.clone();
        let reason = |bound_m: f32| {
            let mut g = void.clone();
            let found = fill_with(&mut g, bound_m, &CONFIG);
            assert!(bound_m.is_finite() || (0..60).all(|k| g[(k, 9)].is_nan() && g[(50, k)].is_nan()));
            found.source[(30, 9)]
        };
        assert_eq!(reason(f32::NEG_INFINITY), CellSource::Unmatched);
        assert_eq!(reason(f32::INFINITY), CellSource::Outside);
        assert_eq!(reason(20.0), CellSource::FilledHidden);
        // Hidden, and no known height within reach.
        let mut g = void.clone();
        (0..60).for_each(|y| (10..50).for_each(|x| g[(x, y)] = if y < 20 { g[(x, y)] } else { f32::NAN }));
        let found = fill_with(&mut g, 20.0, &FillConfig { hidden_reach_cells: 12, ..CONFIG });
        assert_eq!((found.source[(30, 50)], g[(30, 50)].is_nan()), (CellSource::Hidden, true));
    }

    #[test]
    fn a_small_island_in_a_void_is_kept_and_not_spread() {
        let mut g = Grid::filled(40, 40, 1.0f32);
        (5..35).for_each(|x| (5..35).for_each(|y| g[(x, y)] = f32::NAN));
        (18..22).for_each(|x| (18..22).for_each(|y| g[(x, y)] = 9.0));
        let found = fill(&mut g);
        assert!((18..22).all(|x| g[(x, 20)] == 9.0) && g[(17, 20)].is_nan(), "{:?}", g.row(20));
        assert!((14..26).all(|x| (14..26).all(|y| !found.source[(x, y)].is_filled())));
    }
}
