//! Nearest known heights of voids in eight directions.

use raster::Grid;

/// Four of the eight directions: towards cells that come earlier row by row. The other four are
/// their opposites.
const BEFORE: [(isize, isize); 4] = [(-1, 0), (-1, -1), (0, -1), (1, -1)];

/// Nearest known height in one direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// Height above the origin, metres.
    pub(super) height_m: f32,
    /// Distance, cells.
    pub(super) apart: f32,
    /// Whether no blind cell lies between.
    in_sight: bool,
}

impl Known {
    /// A height found at a distance in cells.
    pub(super) fn new(height_m: f32, apart: f32) -> Self {
        Self { height_m, apart, in_sight: true }
    }
}

/// Nearest known heights in the four directions before a cell, or in the four behind it.
type Nearest = [Option<Known>; 4];

/// Nearest known heights around a void cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Around {
    before: Nearest,
    behind: Nearest,
}

impl Around {
    /// Returns the known heights, the lowest first.
    pub(super) fn known(&self) -> Vec<Known> {
        let mut out: Vec<Known> = self.before.iter().chain(&self.behind).copied().flatten().collect();
        out.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
        out
    }

    /// Returns the least distance of two opposite known heights, cells; infinite where there are
    /// none.
    pub(super) fn width_cells(&self) -> f32 {
        self.across().map(|(a, b)| a.apart + b.apart).fold(f32::INFINITY, f32::min)
    }

    /// Returns whether two opposite heights have no blind cell between them.
    pub(super) fn is_between(&self) -> bool {
        self.across().any(|(a, b)| a.in_sight && b.in_sight)
    }

    /// Returns whether two opposite heights are both `wanted`.
    pub(super) fn is_enclosed_by(&self, wanted: impl Fn(&Known) -> bool) -> bool {
        self.across().any(|(a, b)| wanted(&a) && wanted(&b))
    }

    fn across(&self) -> impl Iterator<Item = (Known, Known)> {
        self.before.iter().zip(&self.behind).filter_map(|(a, b)| Some(((*a)?, (*b)?)))
    }
}

/// Returns the heights within `reach` cells around each of `voids`; in the order of `voids`, which
/// are in the order of the rows. `blind` marks cells where the images could not show what stands
/// there.
pub(super) fn around(sources: &Grid<f32>, blind: &Grid<bool>, voids: &[usize], reach: f32) -> Vec<Around> {
    let (before, behind) = rayon::join(
        || known_before(sources, blind, voids.iter().copied(), false, reach),
        || known_before(sources, blind, voids.iter().rev().copied(), true, reach),
    );
    before.into_iter().zip(behind.into_iter().rev()).map(|(before, behind)| Around { before, behind }).collect()
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
                    return Some(Known::new(own_m, length));
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
