//! Filling of voids from the known heights around them.
//!
//! For each void cell the nearest known heights in eight directions are found. The cell is filled
//! if
//!
//! - the void is narrow,
//! - a surface beside it is high enough to hide it from the views, or
//! - it lies between two opposite heights: what changed between the dates, or has too little
//!   texture, mostly continues its surroundings.
//!
//! It stays open where the images could not show what stands there (a saturated roof), and where
//! heights are known on one side only (water, the scene's border). Small islands of heights may be
//! chance, so that nothing is filled from them.
//!
//! If the known heights are on two levels, the void is ground that a building hides. Only the lower
//! level counts then: the heights on one surface with the second lowest one, as the lowest may be a
//! pit. Weights are inverse distances: two opposite heights give the straight line between them, so
//! that slopes continue.

use raster::Grid;
use rayon::prelude::*;

use super::speckle::remove_speckle;

/// Parameters of the filling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillConfig {
    /// Largest distance of a known height, cells.
    pub reach_cells: usize,
    /// Largest distance of two opposite known heights between which a void is filled in any case,
    /// cells.
    pub narrow_cells: f32,
    /// Smallest number of connected cells with heights from which voids are filled.
    pub island_cells: usize,
    /// Distance up to which a surface hides the ground, cells per metre of its height above the
    /// ground.
    pub hidden_cells_per_m: f32,
    /// Largest difference of neighbouring heights on one level, metres.
    pub same_surface_m: f32,
    /// Increase of that difference for every cell between the heights, metres.
    pub slope_m: f32,
}

/// Number of the eight directions that must have a known height: more than outside a straight edge.
const KNOWN_MIN: usize = 4;

/// Four of the eight directions: towards cells that come earlier row by row. The other four are
/// their opposites.
const BEFORE: [(isize, isize); 4] = [(-1, 0), (-1, -1), (0, -1), (1, -1)];

/// Nearest known height in one direction.
#[derive(Debug, Clone, Copy)]
struct Known {
    /// Height above the origin, metres.
    height_m: f32,
    /// Distance, cells.
    apart: f32,
    /// Whether no blind cell lies between.
    in_sight: bool,
}

/// Nearest known heights in the four directions before a cell, or in the four behind it.
type Nearest = [Option<Known>; 4];

/// Fills voids of `height_m` in place and returns which cells were filled. `blind` marks cells
/// where the images could not show what stands there.
pub fn fill_voids(height_m: &mut Grid<f32>, blind: &Grid<bool>, config: &FillConfig) -> Grid<bool> {
    let voids: Vec<usize> = (0..height_m.data().len()).filter(|&i| height_m.data()[i].is_nan()).collect();
    let mut sources = height_m.clone();
    remove_speckle(&mut sources, f32::INFINITY, config.island_cells);
    let forward = known_before(&sources, blind, voids.iter().copied(), false, config);
    let mut backward = known_before(&sources, blind, voids.iter().rev().copied(), true, config);
    backward.reverse();
    let around = voids.par_iter().zip(forward.into_par_iter().zip(backward));
    let value = |(&i, (a, b)): (&usize, (Nearest, Nearest))| Some((i, interpolate(&a, &b, config)?));
    let found: Vec<(usize, f32)> = around.filter_map(value).collect();
    let mut filled = Grid::filled(height_m.width(), height_m.height(), false);
    for (i, value) in found {
        height_m.data_mut()[i] = value;
        filled.data_mut()[i] = true;
    }
    filled
}

/// Finds, for each of `voids`, the nearest known heights within reach in the four directions before
/// it. `voids` are in the order of the rows; with `reversed` everything runs backwards.
fn known_before(
    height_m: &Grid<f32>,
    blind: &Grid<bool>,
    voids: impl Iterator<Item = usize>,
    reversed: bool,
    config: &FillConfig,
) -> Vec<Nearest> {
    let (w, h) = (height_m.width() as isize, height_m.height() as isize);
    let sign = if reversed { -1 } else { 1 };
    let reach = config.reach_cells as f32;
    // Nearest known heights before each cell of the last two rows.
    let mut rows = [vec![Nearest::default(); w as usize], vec![Nearest::default(); w as usize]];
    let mut out = Vec::new();
    let mut voids = voids.peekable();
    for row in 0..h {
        rows.swap(0, 1);
        let y = if reversed { h - 1 - row } else { row };
        for column in 0..w {
            let x = if reversed { w - 1 - column } else { column };
            // A known cell ends the search of others and needs none itself.
            if !height_m[(x as usize, y as usize)].is_nan() {
                continue;
            }
            let nearest: Nearest = std::array::from_fn(|d| {
                let (dx, dy) = BEFORE[d];
                let (u, v) = (x + sign * dx, y + sign * dy);
                if !(0..w).contains(&u) || !(0..h).contains(&v) {
                    return None;
                }
                let length = if dx != 0 && dy != 0 { std::f32::consts::SQRT_2 } else { 1.0 };
                let at = (u as usize, v as usize);
                let height_m = height_m[at];
                if !height_m.is_nan() {
                    return Some(Known { height_m, apart: length, in_sight: true });
                }
                let next = rows[usize::from(dy == 0)][u as usize][d]?;
                let known = Known { apart: next.apart + length, in_sight: next.in_sight && !blind[at], ..next };
                (known.apart <= reach).then_some(known)
            });
            rows[1][x as usize] = nearest;
            if voids.next_if_eq(&((y * w + x) as usize)).is_some() {
                out.push(nearest);
            }
        }
    }
    out
}

/// Returns the height of a void cell from the nearest known heights before and behind it, or `None`
/// if it stays open.
fn interpolate(before: &Nearest, behind: &Nearest, config: &FillConfig) -> Option<f32> {
    let mut known: Vec<Known> = before.iter().chain(behind).copied().flatten().collect();
    if known.len() < KNOWN_MIN {
        return None;
    }
    known.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
    let base = known[1];
    let across = || before.iter().zip(behind).filter_map(|(a, b)| Some(((*a)?, (*b)?)));
    let is_narrow = across().any(|(a, b)| a.apart + b.apart <= config.narrow_cells);
    let hides = |k: &Known| k.apart <= (k.height_m - base.height_m) * config.hidden_cells_per_m;
    let is_hidden = known.iter().any(|k| k.in_sight && hides(k));
    let is_between = across().any(|(a, b)| a.in_sight && b.in_sight);
    if !is_narrow && !is_hidden && !is_between {
        return None;
    }
    let same = |k: &&Known| {
        (k.height_m - base.height_m).abs() <= config.same_surface_m + config.slope_m * (k.apart + base.apart)
    };
    let of_base = known.iter().filter(same);
    let (sum, weight) = of_base.fold((0.0, 0.0), |(s, w), k| (s + k.height_m / k.apart, w + 1.0 / k.apart));
    Some(sum / weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: FillConfig = FillConfig {
        reach_cells: 8,
        narrow_cells: 6.0,
        island_cells: 36,
        hidden_cells_per_m: 1.0,
        same_surface_m: 1.5,
        slope_m: 0.1,
    };

    /// Fills with no cell blind.
    fn fill(height_m: &mut Grid<f32>) -> Grid<bool> {
        let blind = Grid::filled(height_m.width(), height_m.height(), false);
        fill_voids(height_m, &blind, &CONFIG)
    }

    #[test]
    fn a_hole_in_a_slope_gets_the_slope_and_one_beside_a_wall_the_ground() {
        let mut g = Grid::from_vec(20, 20, (0..400).map(|i| 0.1 * (i % 20) as f32).collect()).unwrap();
        (6..9).for_each(|x| (6..9).for_each(|y| g[(x, y)] = f32::NAN));
        let filled = fill(&mut g);
        assert!((g[(7, 7)] - 0.7).abs() < 1e-5 && (g[(6, 7)] - 0.6).abs() < 0.02, "{} {}", g[(7, 7)], g[(6, 7)]);
        assert_eq!(filled.data().iter().filter(|f| **f).count(), 9);
        let mut wall =
            Grid::from_vec(20, 20, (0..400).map(|i| if i % 20 < 10 { 30.0 } else { 2.0 }).collect()).unwrap();
        (0..20).for_each(|y| (10..13).for_each(|x| wall[(x, y)] = f32::NAN));
        fill(&mut wall);
        assert!((10..13).all(|x| (1..19).all(|y| wall[(x, y)] == 2.0)), "{wall:?}");
    }

    #[test]
    fn a_wide_void_is_closed_between_known_heights_and_beside_what_hides_it_unless_the_images_are_blank_there() {
        let mut open = Grid::filled(40, 40, 1.0f32);
        (10..20).for_each(|x| (10..20).for_each(|y| open[(x, y)] = f32::NAN));
        let mut beside = open.clone();
        (20..30).for_each(|x| (10..20).for_each(|y| beside[(x, y)] = 9.0));
        let mut blind = Grid::filled(40, 40, false);
        (12..20).for_each(|x| (0..40).for_each(|y| blind[(x, y)] = true));
        for void in [open, beside] {
            let (mut seen, mut unseen) = (void.clone(), void);
            fill(&mut seen);
            assert!((10..20).all(|x| (10..20).all(|y| seen[(x, y)] == 1.0)), "{:?}", seen.row(15));
            fill_voids(&mut unseen, &blind, &CONFIG);
            assert!((12..19).all(|x| unseen[(x, 15)].is_nan()) && unseen[(10, 15)] == 1.0, "{:?}", unseen.row(15));
        }
    }

    #[test]
    fn a_small_island_in_a_void_is_kept_and_not_spread() {
        let mut g = Grid::filled(40, 40, 1.0f32);
        (5..35).for_each(|x| (5..35).for_each(|y| g[(x, y)] = f32::NAN));
        (18..22).for_each(|x| (18..22).for_each(|y| g[(x, y)] = 9.0));
        let filled = fill(&mut g);
        assert!((18..22).all(|x| g[(x, 20)] == 9.0) && g[(17, 20)].is_nan(), "{:?}", g.row(20));
        assert!((10..30).all(|x| (10..30).all(|y| !filled[(x, y)])));
    }

    #[test]
    fn what_lies_outside_the_scene_stays_open() {
        let mut g = Grid::filled(60, 60, f32::NAN);
        (10..50).for_each(|x| (10..50).for_each(|y| g[(x, y)] = if x > 40 { 30.0 } else { 1.0 }));
        let filled = fill(&mut g);
        assert!((0..60).all(|k| !filled[(k, 9)] && !filled[(50, k)] && !filled[(3, k)]));
    }
}
