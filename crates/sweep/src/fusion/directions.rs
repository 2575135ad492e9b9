//! Nearest known heights of voids in eight directions: whether a void is narrow, and whether it
//! lies between known heights.

use raster::Grid;

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

/// Where a void lies among the known heights around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Setting {
    /// Whether known heights lie on more than one side.
    pub(super) is_enclosed: bool,
    /// Least distance of two opposite known heights, cells; infinite where there are none.
    pub(super) width_cells: f32,
    /// Whether two opposite heights have no blind cell between them.
    pub(super) is_between: bool,
    /// Second lowest of the nearest known heights, metres, as the lowest may be a pit; infinite
    /// where there are fewer than two.
    pub(super) low_m: f32,
}

/// Returns where each of `voids` lies among the heights within `reach` cells; in the order of
/// `voids`, which are in the order of the rows. `blind` marks cells where the images could not show
/// what stands there.
pub(super) fn settings(sources: &Grid<f32>, blind: &Grid<bool>, voids: &[usize], reach: f32) -> Vec<Setting> {
    let (before, behind) = rayon::join(
        || known_before(sources, blind, voids.iter().copied(), false, reach),
        || known_before(sources, blind, voids.iter().rev().copied(), true, reach),
    );
    before.iter().zip(behind.iter().rev()).map(|(before, behind)| setting(before, behind)).collect()
}

fn setting(before: &Nearest, behind: &Nearest) -> Setting {
    let mut heights: Vec<f32> = before.iter().chain(behind).flatten().map(|k| k.height_m).collect();
    heights.sort_by(f32::total_cmp);
    let across = || before.iter().zip(behind).filter_map(|(a, b)| Some(((*a)?, (*b)?)));
    Setting {
        is_enclosed: heights.len() >= KNOWN_MIN,
        width_cells: across().map(|(a, b)| a.apart + b.apart).fold(f32::INFINITY, f32::min),
        is_between: across().any(|(a, b)| a.in_sight && b.in_sight),
        low_m: heights.get(1).copied().unwrap_or(f32::INFINITY),
    }
}

/// Finds, for each of `voids`, the nearest known heights within reach in the four directions before
/// it. `voids` are in the order of the rows; with `reversed` everything runs backwards.
fn known_before(
    height_m: &Grid<f32>,
    blind: &Grid<bool>,
    voids: impl Iterator<Item = usize>,
    reversed: bool,
    reach: f32,
) -> Vec<Nearest> {
    let (w, h) = (height_m.width() as isize, height_m.height() as isize);
    let sign = if reversed { -1 } else { 1 };
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
                let own_m = height_m[at];
                if !own_m.is_nan() {
                    return Some(Known { height_m: own_m, apart: length, in_sight: true });
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
