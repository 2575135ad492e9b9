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
//! - Otherwise two views see the cell and their images do not match. A *narrow* void is closed. A
//!   wider one is completed where the known heights around it fit one plane, and where it lies
//!   between two opposite heights. If the border near the cell has ground lower by a storey, the
//!   cell gets the ground.
//!   It stays open where heights are known on one side only (water), and where the images are
//!   blank, unless the views agree there on a roof whose rim was seen.
//! - Where the ground is known, it takes the place of what lies near it or below it, of what is
//!   hidden under a surface a storey higher, and of a surface that two views would have seen.
//!   Narrow gaps between two such surfaces keep theirs, unless two views see past them down to the
//!   ground and heights around lie at it, too. In a dense quarter of which hardly any ground is
//!   known, they are streets where two views see down to the ground, or where hardly anything but
//!   voids is around.
//! - What fewer than two views image is outside and stays open, unless it is narrow.
//!
//! Small islands of heights may be chance, so that nothing is filled from them. Trusted ones are
//! chance only where they are very small.
//!
//! The standard deviation of a filled height holds the spread of all heights that it could have
//! been filled from, and grows with the distance to the nearest of them.

use raster::Grid;
use rayon::prelude::*;

use super::border::{Border, Wanted, number_voids};
use super::directions::{Around, Known, around};
use super::plane::{Plane, border_planes};
use super::source::CellSource;
use super::speckle::remove_speckle;
use crate::window_sums::{window_means, window_sums};

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
    /// Distance to each side over which heights tell whether the ground around a cell is known,
    /// cells.
    pub ground_reach_cells: usize,
    /// Distance to each side over which the share of voids tells whether buildings may fill them,
    /// cells.
    pub quarter_reach_cells: usize,
    /// Smallest number of connected cells with heights from which voids are filled.
    pub island_cells: usize,
    /// The same where all of the heights are trusted.
    pub trusted_island_cells: usize,
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
/// Part of the known heights around a cell that lies at the ground where that goes on in a void, as
/// a divisor: in the middle of a roof, and among crowns, none does.
const GROUND_PART: u32 = 12;
/// Share of a quarter above which its voids are ground, also where none is seen: buildings hardly
/// cover more of it.
const MOSTLY: f64 = 2.0 / 3.0;
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
    /// Whether a cell lies in a dense quarter of which roofs are known and hardly any ground.
    pub only_roofs: &'a Grid<bool>,
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
    let KnownVoids { trusted, blind, completed_m, ground_m, only_roofs } = known;
    let (width, height) = (height_m.width(), height_m.height());
    let voids: Vec<usize> = (0..height_m.data().len()).filter(|&i| height_m.data()[i].is_nan()).collect();
    let mut source = Grid::filled(width, height, CellSource::Observed);
    let mut sigma_m = Grid::filled(width, height, f32::NAN);
    let is_doubted = |i: usize| !trusted.data()[i];
    let solid = height_m.without(is_doubted);
    let bounds = bound_m(&solid, &voids);
    let mut sources = height_m.clone();
    remove_speckle(&mut sources, f32::INFINITY, config.island_cells);
    let mut solid_islands = solid.clone();
    remove_speckle(&mut solid_islands, f32::INFINITY, config.trusted_island_cells);
    let islands = sources.data_mut().iter_mut().zip(solid_islands.data()).filter(|(source, _)| source.is_nan());
    islands.for_each(|(source, solid)| *source = *solid);
    let around = around(&sources, blind, &voids, config.reach_cells as f32);
    let (numbers, count) = number_voids(height_m);
    sources.void_where(is_doubted);
    let border = Border::new(&sources, &numbers);
    let planes = border_planes(border.cells(), count, config.same_surface_m);
    let is_ground_near = is_ground_near(height_m, ground_m, config.ground_reach_cells);
    let is_mostly_void = is_mostly_void(height_m, config.quarter_reach_cells);
    let beside_blind = beside(blind, &numbers, config.blind_reach_cells);
    let filling = Filling {
        numbers: &numbers,
        border: &border,
        planes: &planes,
        blind,
        beside_blind,
        completed_m,
        ground_m,
        is_ground_near: &is_ground_near,
        is_mostly_void: &is_mostly_void,
        only_roofs,
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

/// Marks the cells around which enough of the heights within `reach` cells lie at the ground.
fn is_ground_near(height_m: &Grid<f32>, ground_m: &Grid<f32>, reach: usize) -> Grid<bool> {
    let (heights, width) = (height_m.data(), height_m.width());
    let counts = |is: &dyn Fn(usize) -> bool| window_sums(heights.len(), width, reach, |i| u32::from(is(i)));
    let known = counts(&|i| !heights[i].is_nan());
    let at_ground = counts(&|i| (heights[i] - ground_m.data()[i]).abs() < ON_GROUND_M);
    let mut out = height_m.map(|_| false);
    let cells = out.data_mut().iter_mut().zip(known.into_iter().zip(at_ground));
    cells.for_each(|(is_near, (known, at_ground))| *is_near = known > 0 && GROUND_PART * at_ground >= known);
    out
}

/// Marks the cells around which most cells within `reach` are void.
fn is_mostly_void(height_m: &Grid<f32>, reach: usize) -> Grid<bool> {
    let heights = height_m.data();
    let voids = window_means(heights.len(), height_m.width(), reach, |i| f64::from(u8::from(heights[i].is_nan())));
    let mut out = height_m.map(|_| false);
    out.data_mut().iter_mut().zip(voids).for_each(|(is_mostly, share)| *is_mostly = share > MOSTLY);
    out
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

impl Estimate {
    /// Returns the estimate at another height, as uncertain as before.
    fn at(self, height_m: f32) -> Self {
        Self { height_m, ..self }
    }
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
    is_ground_near: &'a Grid<bool>,
    is_mostly_void: &'a Grid<bool>,
    only_roofs: &'a Grid<bool>,
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
        // Whether two views see past the known surface down to the ground. They match what stands
        // high rather than ground in a shadow.
        let is_ground_seen = bound_m <= ground_m;
        // Where all that is known are roofs, a void is the street between them.
        let may_be_street = self.only_roofs.data()[index] && (is_ground_seen || self.is_mostly_void.data()[index]);
        let may_be_ground = may_be_street || (is_ground_seen && self.is_ground_near.data()[index]);
        // Between two surfaces above the ground, another narrow void is a gap in one of them.
        let is_gap = is_narrow && !may_be_ground && around.is_enclosed_by(|k| k.height_m > ground_m + STOREY_M);
        let lowered = |surface: Estimate| {
            let is_above = !is_gap && surface.height_m > ground_m + STOREY_M;
            if is_above { surface.at(ground_m) } else { surface }
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
                None => {
                    let surface = below().unwrap_or(lower.estimate);
                    let would_be_seen = bound_m > f32::NEG_INFINITY && lower.base_m > bound_m;
                    if would_be_seen || may_be_ground { lowered(surface) } else { surface }
                }
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
        let on_ground = |filled: &Estimate| filled.height_m < ground_m + ON_GROUND_M;
        let estimate = estimate.map(|filled| if on_ground(&filled) { filled.at(ground_m) } else { filled });
        let source = match estimate {
            Some(filled) if may_be_street && filled.height_m == ground_m => CellSource::FilledStreet,
            Some(_) => source,
            None => open,
        };
        Judged { source, estimate }
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
mod tests;
