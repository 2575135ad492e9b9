//! Filling of voids, each by its reason.
//!
//! Every void has a bound: the height above which two views see past the known surface (see
//! `envelope`). The surface around a cell is the lower one of the nearest known heights in eight
//! directions. Each void cell is judged by both:
//!
//! - Where the images are blank in or beside the cell, they are the reason for the void: it is not
//!   taken for hidden ground.
//! - If the surface around lies under the bound, the cell is *hidden* from all but one view, and
//!   gets this surface. If it lies above, two views would have seen it. A wide void then gets the
//!   nearest surface under the bound: a street between towers is not filled with a roof.
//! - Otherwise two views see the cell and their pictures do not match. A *narrow* void is closed. A
//!   wider one is completed where the known heights around it fit one plane, and where it lies
//!   between two opposite heights. If the border near the cell has ground lower by a storey, the
//!   cell gets the ground.
//!   It stays open where heights are known on one side only (water), and where the images are
//!   blank, unless the views agree there on a roof whose rim was seen.
//! - Where the ground is known, it takes the place of what lies near it or below it, of what is
//!   hidden under a surface a storey higher, and of a surface that two views would have seen.
//!   Narrow gaps between two such surfaces keep theirs.
//! - What fewer than two views image is outside and stays open, unless it is narrow.
//!
//! Small islands of heights may be chance, so that nothing is filled from them.
//!
//! The standard deviation of a filled height holds the spread of all heights that it could have
//! been filled from, and grows with the distance to the nearest of them.

use raster::Grid;
use rayon::prelude::*;

use super::border::{Border, Wanted, number_voids};
use super::directions::{Around, Known, around};
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
    /// Void: under a mask, or outside the area that was asked for.
    Masked = 13,
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
    /// Distance in a void over which blind cells are the reason for it, cells.
    pub blind_reach_cells: usize,
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

/// Number of the eight directions that must have a known height: more than outside a straight edge.
const KNOWN_MIN: usize = 4;
/// A surface that is lower by a storey is another one, metres.
const STOREY_M: f32 = 3.0;
/// What is filled lower than this above the ground is ground, metres: half a storey.
const ON_GROUND_M: f32 = 0.5 * STOREY_M;
/// Number of heights among which a lower surface is looked for: those at the far end of a street.
const CANDIDATES: usize = 64;
/// Part of the border of a void that continues a roof in it. A blank patch over a roof and the
/// ground beside it is matched as a whole, at a height between them, and has less.
const RIM_PART: f32 = 0.75;
/// Number of heights that are all around a cell at the border of its void, and the part of them
/// that a surface must have: fewer may be outliers.
const AROUND: usize = 256;
const LEAST_PART: usize = 10;
/// The lowest surface is the one with this many candidates under it: a few may be wrong.
const LOWEST: usize = 5;
/// Least part of the candidates of which the lowest is taken where there are few.
const LOWEST_SHARE: usize = 4;

/// What is known about a surface and its voids.
#[derive(Debug, Clone, Copy)]
pub struct KnownVoids<'a> {
    /// Whether a height may hide the ground behind it.
    pub trusted: &'a Grid<bool>,
    /// Whether the images could not show what stands in a cell.
    pub blind: &'a Grid<bool>,
    /// Heights that continue what is around them in the images, and on which the views agree,
    /// where the images are blank; NaN elsewhere. Metres.
    pub completed_m: &'a Grid<f32>,
    /// The ground, metres; NaN where it is not known.
    pub ground_m: &'a Grid<f32>,
}

/// Fills voids of `height_m` in place. `bound_m` returns the greatest height at which each void
/// cell may be hidden from all but one view by the given surface: −∞ where two views see
/// everything, +∞ where fewer image it.
pub fn fill_voids(
    height_m: &mut Grid<f32>,
    known: KnownVoids<'_>,
    bound_m: impl Fn(&Grid<f32>, &[usize]) -> Vec<f32>,
    config: &FillConfig,
) -> FilledVoids {
    let KnownVoids { trusted, blind, completed_m, ground_m } = known;
    let (width, height) = (height_m.width(), height_m.height());
    let voids: Vec<usize> = (0..height_m.data().len()).filter(|&i| height_m.data()[i].is_nan()).collect();
    let mut source = Grid::filled(width, height, CellSource::Observed);
    let mut sigma_m = Grid::filled(width, height, f32::NAN);
    let keep_trusted = |heights: &mut Grid<f32>| {
        let cells = heights.data_mut().iter_mut().zip(trusted.data());
        cells.filter(|(_, is_trusted)| !**is_trusted).for_each(|(height, _)| *height = f32::NAN);
    };
    let mut solid = height_m.clone();
    keep_trusted(&mut solid);
    let bounds = bound_m(&solid, &voids);
    let mut sources = height_m.clone();
    remove_speckle(&mut sources, f32::INFINITY, config.island_cells);
    let around = around(&sources, blind, &voids, config.reach_cells as f32);
    let (numbers, count) = number_voids(height_m);
    keep_trusted(&mut sources);
    let border = Border::new(&sources, &numbers);
    let planes = border_planes(border.cells(), count, config.same_surface_m);
    let beside_blind = beside(blind, &numbers, config.blind_reach_cells);
    let filling = Filling {
        numbers: &numbers,
        border: &border,
        planes: &planes,
        blind,
        beside_blind,
        completed_m,
        ground_m,
        config,
    };
    let cells = voids.par_iter().zip(bounds.par_iter().zip(&around));
    let judged: Vec<Judged> = cells.map(|(&index, (&bound_m, around))| filling.judge(index, bound_m, around)).collect();
    for (&index, judged) in voids.iter().zip(judged) {
        source.data_mut()[index] = judged.source;
        if let Some(estimate) = judged.estimate {
            height_m.data_mut()[index] = estimate.height_m;
            sigma_m.data_mut()[index] = estimate.sigma_m;
        }
    }
    FilledVoids { source, sigma_m }
}

/// Marks the void cells that a way of at most `reach` cells through their void joins with blind
/// ones. `numbers` are those of the voids, 0 where there are heights.
fn beside(blind: &Grid<bool>, numbers: &Grid<u32>, reach: usize) -> Grid<bool> {
    let (width, height) = (blind.width(), blind.height());
    let mut out = blind.clone();
    let is_blind = |i: &usize| blind.data()[*i] && numbers.data()[*i] != 0;
    let mut last: Vec<usize> = (0..blind.data().len()).filter(is_blind).collect();
    for _ in 0..reach {
        let mut next = Vec::new();
        for i in last {
            let (x, y) = (i % width, i / width);
            let around = [(x > 0, i.wrapping_sub(1)), (x + 1 < width, i + 1)];
            let across = [(y > 0, i.wrapping_sub(width)), (y + 1 < height, i + width)];
            for (_, j) in around.into_iter().chain(across).filter(|(is_inside, _)| *is_inside) {
                if !out.data()[j] && numbers.data()[j] != 0 {
                    out.data_mut()[j] = true;
                    next.push(j);
                }
            }
        }
        last = next;
    }
    out
}

/// A height found from known ones.
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

/// Everything that decides about a void cell.
struct Filling<'a> {
    numbers: &'a Grid<u32>,
    border: &'a Border,
    /// Planes of the voids, by their numbers from 1.
    planes: &'a [Option<Plane>],
    blind: &'a Grid<bool>,
    /// Void cells in and beside blind ones.
    beside_blind: Grid<bool>,
    completed_m: &'a Grid<f32>,
    ground_m: &'a Grid<f32>,
    config: &'a FillConfig,
}

impl Filling<'_> {
    fn judge(&self, index: usize, bound_m: f32, around: &Around) -> Judged {
        let config = self.config;
        let known = around.known();
        let width_cells = around.width_cells();
        let is_narrow = width_cells <= config.narrow_cells;
        let is_outside = bound_m == f32::INFINITY;
        let is_blind = self.blind.data()[index];
        let void = self.numbers.data()[index];
        let plane = self.planes[void as usize - 1];
        let lower = self.lower_level(&known);
        // Where the images cannot show anything, nothing tells whether the ground is hidden.
        let may_be_hidden = !is_outside && !self.beside_blind.data()[index];
        let is_under = may_be_hidden && lower.is_some_and(|lower| lower.base_m <= bound_m);
        // A narrow void, or one inside a plane, is a gap in what surrounds it. In another the
        // ground may be further away than the walls.
        let may_be_far = may_be_hidden && !is_under && !is_narrow && plane.is_none() && bound_m > f32::NEG_INFINITY;
        let ground_m = self.ground_m.data()[index];
        // Between two surfaces above the ground, a narrow void is a gap in one of them.
        let is_gap = is_narrow && around.is_enclosed_by(|k| k.height_m > ground_m + STOREY_M);
        let lowered = |surface: Estimate| match !is_gap && surface.height_m > ground_m + STOREY_M {
            true => Estimate { height_m: ground_m, ..surface },
            false => surface,
        };
        let hidden = match lower {
            Some(lower) if is_under => Some(lowered(lower.estimate)),
            _ if may_be_far => self.surface_under(index, bound_m).map(lowered),
            _ => None,
        };
        // With no height around that would have been seen.
        let is_hidden = hidden.is_some() || (may_be_far && known.is_empty());
        let open = match (is_outside, is_hidden, is_blind) {
            (true, ..) => CellSource::Outside,
            (_, true, _) => CellSource::Hidden,
            (_, _, true) => CellSource::Blank,
            _ => CellSource::Unmatched,
        };
        let is_wanted = match config.rule {
            FillRule::Nothing => false,
            FillRule::Justified => {
                is_narrow || (!is_outside && (around.is_between() || (plane.is_some() && !is_blind)))
            }
            FillRule::Everything => is_narrow || plane.is_some() || width_cells.is_finite(),
        };
        let seen = || {
            let lower = lower.filter(|_| known.len() >= KNOWN_MIN && is_wanted)?;
            // What is farther from a narrow void than the ends of its street has no part in it.
            let count = if is_narrow { CANDIDATES } else { AROUND };
            let below = || self.surface_below(index, lower.base_m - STOREY_M, void, count);
            Some(match plane.filter(|_| !is_blind) {
                Some(plane) => self.on_plane(self.place(index), plane, &known),
                // Two views would have seen the surface around.
                None if bound_m > f32::NEG_INFINITY && lower.base_m > bound_m => {
                    lowered(below().unwrap_or(lower.estimate))
                }
                None => below().unwrap_or(lower.estimate),
            })
        };
        let height_m = self.completed_m.data()[index];
        let is_completed = config.rule != FillRule::Nothing && self.is_raised_roof(index, height_m, &known);
        let completed = is_completed.then(|| {
            let nearest = known.iter().map(|k| k.apart).fold(config.reach_cells as f32, f32::min);
            Estimate { height_m, sigma_m: self.sigma_m(0.0, nearest) }
        });
        let (source, estimate) = match (completed, hidden.filter(|_| config.rule != FillRule::Nothing)) {
            (Some(estimate), _) => (CellSource::FilledSurface, Some(estimate)),
            (_, Some(estimate)) => (CellSource::FilledHidden, Some(estimate)),
            _ => (if is_narrow { CellSource::FilledNarrow } else { CellSource::FilledSurface }, seen()),
        };
        let estimate = estimate.map(|filled| match filled.height_m < ground_m + ON_GROUND_M {
            true => Estimate { height_m: ground_m, ..filled },
            false => filled,
        });
        Judged { source: if estimate.is_some() { source } else { open }, estimate }
    }

    /// Returns the lower of the surfaces around a cell and the height that continues it into the
    /// cell; `None` with fewer than two heights. `known` has the lowest height first.
    fn lower_level(&self, known: &[Known]) -> Option<Level> {
        // The lowest may be a pit.
        Some(self.level(known, *known.get(1)?))
    }

    /// Returns the surface through `base`. Weights are inverse distances: two opposite heights give
    /// the straight line between them, so that slopes continue.
    fn level(&self, known: &[Known], base: Known) -> Level {
        let config = self.config;
        let on_level = |k: &&Known| {
            let off_m = (k.height_m - base.height_m).abs();
            off_m <= config.same_surface_m + config.slope_m * (k.apart + base.apart)
        };
        let of_base = || known.iter().filter(on_level);
        let mean = |of: &mut dyn Iterator<Item = [f32; 2]>| {
            let (sum, weight) = of.fold((0.0, 0.0), |(s, w), [value, apart]| (s + value / apart, w + 1.0 / apart));
            sum / weight
        };
        let height_m = base.height_m + mean(&mut of_base().map(|k| [k.height_m - base.height_m, k.apart]));
        let variance = mean(&mut known.iter().map(|k| [(k.height_m - height_m).powi(2), k.apart]));
        let nearest = of_base().map(|k| k.apart).fold(f32::INFINITY, f32::min);
        let estimate = Estimate { height_m, sigma_m: self.sigma_m(variance.sqrt(), nearest) };
        Level { base_m: base.height_m, estimate }
    }

    /// Returns the lowest surface under a bound around a cell; `None` if none is known.
    fn surface_under(&self, index: usize, bound_m: f32) -> Option<Estimate> {
        let wanted = Wanted { void: None, height_max_m: bound_m, count: CANDIDATES, reach: self.far() };
        self.lowest(&self.border.nearest(self.place(index), wanted))
    }

    /// Returns the surface below a height at the border of a void; `None` if it is a small part of
    /// the `count` heights at the border near a cell, which may be outliers.
    fn surface_below(&self, index: usize, height_m: f32, void: u32, count: usize) -> Option<Estimate> {
        let all = self.border_around(index, Some(void), count);
        let below: Vec<Known> = all.iter().copied().filter(|k| k.height_m <= height_m).collect();
        if below.len() * LEAST_PART < all.len() { None } else { self.lowest(&below) }
    }

    /// Returns whether a height continues what is known on most sides and at most of the border
    /// of its void, a storey above other surfaces around: a saturated roof whose rim was seen. In
    /// a blank area that holds ground anything may stand. `known` are the nearest heights in eight
    /// directions.
    fn is_raised_roof(&self, index: usize, height_m: f32, known: &[Known]) -> bool {
        let config = self.config;
        let continues = |k: &&Known| (k.height_m - height_m).abs() <= config.same_surface_m + config.slope_m * k.apart;
        if height_m.is_nan() || known.iter().filter(continues).count() < KNOWN_MIN {
            return false;
        }
        let own = self.border_around(index, Some(self.numbers.data()[index]), AROUND);
        if (own.iter().filter(continues).count() as f32) < RIM_PART * own.len() as f32 {
            return false;
        }
        let all = self.border_around(index, None, AROUND);
        let lower = all.iter().filter(|k| k.height_m <= height_m - STOREY_M).count();
        lower > 0 && lower * LEAST_PART >= all.len()
    }

    /// Returns the known heights all around a cell at the border of a void, or of any.
    fn border_around(&self, index: usize, void: Option<u32>, count: usize) -> Vec<Known> {
        let wanted = Wanted { void, height_max_m: f32::INFINITY, count, reach: self.far() };
        self.border.nearest(self.place(index), wanted)
    }

    fn far(&self) -> f32 {
        self.config.hidden_reach_cells as f32
    }

    fn place(&self, index: usize) -> [f32; 2] {
        [index % self.numbers.width(), index / self.numbers.width()].map(|v| v as f32)
    }

    /// Returns the lowest surface among known heights.
    ///
    /// Distance counts like height here, at the slope of one surface: a pit far away is not lower
    /// than the ground beside the cell.
    fn lowest(&self, known: &[Known]) -> Option<Estimate> {
        let config = self.config;
        let reduced = |k: &Known| k.height_m + config.slope_m * k.apart;
        let mut by_height = known.to_vec();
        let rank = known.len().div_ceil(LOWEST_SHARE).min(LOWEST).checked_sub(1)?;
        let (_, base, _) = by_height.select_nth_unstable_by(rank, |a, b| reduced(a).total_cmp(&reduced(b)));
        Some(self.level(known, *base).estimate)
    }

    fn on_plane(&self, at: [f32; 2], plane: Plane, known: &[Known]) -> Estimate {
        let nearest = known.iter().map(|k| k.apart).fold(f32::INFINITY, f32::min);
        Estimate { height_m: plane.at(at), sigma_m: self.sigma_m(plane.deviation_m, nearest) }
    }

    /// Returns the deviation of a filled height from the spread of the heights that it could have
    /// been filled from and the distance of the nearest, cells.
    fn sigma_m(&self, spread_m: f32, nearest: f32) -> f32 {
        let grown = 0.5 * self.config.same_surface_m + self.config.sigma_slope_m * nearest;
        spread_m.hypot(grown)
    }
}

/// A surface beside a void cell.
#[derive(Debug, Clone, Copy)]
struct Level {
    /// Height that tells the surface from others, metres.
    base_m: f32,
    /// The surface in the cell.
    estimate: Estimate,
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: FillConfig = FillConfig {
        rule: FillRule::Justified,
        reach_cells: 8,
        hidden_reach_cells: 50,
        narrow_cells: 6.0,
        blind_reach_cells: 4,
        island_cells: 36,
        same_surface_m: 1.0,
        slope_m: 0.05,
        sigma_slope_m: 0.1,
    };

    fn fill_with(height_m: &mut Grid<f32>, bound_m: f32, config: &FillConfig) -> FilledVoids {
        let blind = Grid::filled(height_m.width(), height_m.height(), false);
        let (trusted, completed_m) = (blind.map(|_| true), blind.map(|_| f32::NAN));
        let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &completed_m, ground_m: &completed_m };
        fill_voids(height_m, known, |_, voids| vec![bound_m; voids.len()], config)
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
    fn a_narrow_street_gets_the_ground_at_its_end() {
        // Roofs at 20 m on three sides of a street of 4 cells, which opens to a plain.
        let mut g = Grid::filled(40, 60, 20.0f32);
        (40..60).for_each(|y| g.row_mut(y).fill(0.0));
        (30..40).for_each(|y| g.row_mut(y)[18..22].fill(f32::NAN));
        let found = fill(&mut g);
        assert!((18..22).all(|x| (30..40).all(|y| g[(x, y)] == 0.0)), "{:?}", g.row(30));
        assert_eq!(found.source[(19, 30)], CellSource::FilledNarrow);
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
        let mut blind = Grid::filled(40, 40, false);
        (12..20).for_each(|x| (0..40).for_each(|y| blind[(x, y)] = true));
        let (mut seen, mut unseen) = (void_in_a_plain(), void_in_a_plain());
        fill(&mut seen);
        assert!((10..20).all(|x| (10..20).all(|y| seen[(x, y)] == 1.0)), "{:?}", seen.row(15));
        let visible = |_: &Grid<f32>, voids: &[usize]| vec![f32::NEG_INFINITY; voids.len()];
        let (trusted, completed_m) = (blind.map(|_| true), blind.map(|_| f32::NAN));
        let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &completed_m, ground_m: &completed_m };
        let found = fill_voids(&mut unseen, known, visible, &CONFIG);
        assert!((12..20).all(|x| unseen[(x, 15)].is_nan()) && unseen[(10, 15)] == 1.0, "{:?}", unseen.row(15));
        assert_eq!(found.source[(15, 15)], CellSource::Blank);
        let everything = FillConfig { rule: FillRule::Everything, ..CONFIG };
        fill_voids(&mut unseen, known, visible, &everything);
        assert!((10..20).all(|x| (10..20).all(|y| unseen[(x, y)] == 1.0)), "{:?}", unseen.row(15));
    }

    #[test]
    fn a_blank_roof_is_completed_where_its_rim_was_seen_and_blank_ground_is_not() {
        // A roof at 6 m with a blank middle, and a void in the ground at 1 m.
        let mut roof = Grid::filled(40, 40, 1.0f32);
        (5..25).for_each(|x| (5..25).for_each(|y| roof[(x, y)] = 6.0));
        (10..20).for_each(|x| (10..20).for_each(|y| roof[(x, y)] = f32::NAN));
        (30..36).for_each(|x| (30..36).for_each(|y| roof[(x, y)] = f32::NAN));
        let (blind, trusted) = (roof.map(|h| h.is_nan()), roof.map(|_| true));
        let nowhere = roof.map(|_| f32::NAN);
        for (at, height_m, is_completed) in [((15, 15), 6.4, true), ((15, 15), 16.0, false), ((33, 33), 1.0, false)] {
            let mut completed_m = roof.map(|_| f32::NAN);
            completed_m[at] = height_m;
            let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &completed_m, ground_m: &nowhere };
            let mut filled = roof.clone();
            let config = FillConfig { narrow_cells: 3.0, ..CONFIG };
            let found = fill_voids(&mut filled, known, |_, voids| vec![f32::NEG_INFINITY; voids.len()], &config);
            assert_eq!(filled[at] == height_m, is_completed, "{height_m}");
            assert_eq!(found.source[at] == CellSource::FilledSurface, is_completed, "{height_m}");
        }
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
    fn a_void_of_a_blank_roof_is_not_taken_for_hidden_ground() {
        // A roof at 16 m whose blank inside is open to one side, beside ground at −20 m.
        let mut g = Grid::filled(60, 60, -20.0f32);
        (10..50).for_each(|x| (10..50).for_each(|y| g[(x, y)] = 16.0));
        (14..46).for_each(|x| (14..60).for_each(|y| g[(x, y)] = if y < 50 { f32::NAN } else { -20.0 }));
        let trusted = g.map(|_| true);
        let completed_m = g.map(|_| f32::NAN);
        let filled = |blind: Grid<bool>| {
            let known =
                KnownVoids { trusted: &trusted, blind: &blind, completed_m: &completed_m, ground_m: &completed_m };
            let mut filled = g.clone();
            let source = fill_voids(&mut filled, known, |_, voids| vec![10.0; voids.len()], &CONFIG).source;
            let is_hidden = |i: usize| source.data()[i] == CellSource::FilledHidden;
            let inside = (14..46).flat_map(|x| (14..46).map(move |y| y * 60 + x));
            (inside.filter(|i| is_hidden(*i)).count(), source[(30, 30)])
        };
        // With texture it is hidden ground; the images could not show it where they are blank.
        assert!(filled(g.map(|_| false)).0 > 900);
        assert_eq!(filled(g.map(|h| h.is_nan())), (0, CellSource::Blank));
        // Blind cells in the middle are the reason for the void beside them.
        let mut middle = g.map(|_| false);
        (17..43).for_each(|x| (17..46).for_each(|y| middle[(x, y)] = true));
        assert_eq!(filled(middle).0, 0);
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

    /// A void between the roofs of two rows of houses, every other one of which is 6 m higher, and
    /// the ground under it.
    #[test]
    fn ground_fills_a_street_that_two_views_would_have_seen_and_no_narrow_gap_of_a_roof() {
        let filled = |width: usize, roofs_m: [f32; 2], ground_m: f32, bound_m: f32| {
            let mut height_m = Grid::filled(60, 40, 0.0);
            for y in 0..40 {
                let higher_m = if y / 10 % 2 == 0 { 0.0 } else { 6.0 };
                let row = height_m.row_mut(y);
                row[..20].fill(roofs_m[0] + higher_m);
                row[20 + width..].fill(roofs_m[1] - higher_m);
                row[20..20 + width].fill(f32::NAN);
            }
            let blind = height_m.map(|_| false);
            let (trusted, completed_m) = (blind.map(|_| true), blind.map(|_| f32::NAN));
            let ground_m = blind.map(|_| ground_m);
            let known = KnownVoids { trusted: &trusted, blind: &blind, completed_m: &completed_m, ground_m: &ground_m };
            let config = FillConfig { reach_cells: 20, ..CONFIG };
            let found = fill_voids(&mut height_m, known, |_, voids| vec![bound_m; voids.len()], &config);
            (height_m[(20 + width / 2, 20)], found.source[(20 + width / 2, 20)])
        };
        let unknown = f32::NAN;
        assert_eq!(filled(14, [20.0, 27.0], 2.0, 10.0), (2.0, CellSource::FilledSurface));
        assert!(filled(14, [20.0, 27.0], unknown, 10.0).0 >= 14.0);
        assert_eq!(filled(14, [20.0, 27.0], 2.0, 30.0), (2.0, CellSource::FilledHidden));
        assert!(filled(4, [20.0, 26.0], 2.0, 10.0).0 >= 20.0);
        assert_eq!(filled(4, [-9.0, 1.0], 2.0, f32::NEG_INFINITY).0, 2.0);
    }
}
