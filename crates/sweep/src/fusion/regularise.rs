//! Regularisation of the heights of several views on the grid.
//!
//! Cells that are fused one by one keep the noise of their heights, and torn edges. Here the
//! heights of all views vote in a volume over the cells: a height h with weight w adds
//! `w · (1 − (k − h)² / R²)²` to the hypotheses k within R of it (biweight kernel). The cost of a
//! hypothesis is the share of the votes that it does not get,
//!
//! `C(k) = 1 − votes(k) / (Σ w + D)`
//!
//! so that a cell with little evidence, against the doubt D, follows those around it. Costs are
//! aggregated along eight directions ([`crate::aggregation`]) and read out between hypotheses, as
//! those of the images are. Where the surface is steep, its climb costs nothing.

use raster::Grid;

use super::mesh::ViewSurface;
use crate::aggregation::{LANES, Penalties, VolumeBlock, aggregate};
use crate::cost::COST_MAX;
use crate::ranges::{Ranges, Reach, extremes};
use crate::readout::{Modes, TOGETHER};
use crate::simd::Arrays;

/// Distance over which the aggregation settles, cells. What a path brings from farther away is less
/// than the penalty of a step.
pub(super) const MARGIN: usize = 32;

/// Penalties: a step costs a tenth of all votes of a cell, a jump half of them. A cell whose views
/// agree is moved by none of its neighbours; one whose views are divided follows them.
const PENALTIES: Penalties = Penalties { step: COST_MAX / 10, jump: COST_MAX / 2, jump_at_edge: COST_MAX / 2 };
/// Reach of a vote, hypotheses: heights of one surface scatter by about one of them.
const VOTE_REACH: f32 = 2.5;
/// Weight of the doubt, against 1 of a distinct height inside a surface.
const DOUBT: f32 = 0.5;
/// Distance in cells from which the heights that a cell may take come.
const NEIGHBOURS: usize = 2;
/// Hypotheses beyond the heights around a cell: as many as the read-out looks at.
const BEYOND: i32 = 3;
/// Most hypotheses of a cell, around the middle height of the views. Higher or lower by hundreds of
/// steps are only blunders, whose number bounds neither memory nor time.
const HYPOTHESES_MAX: i32 = 1024;
/// Deviation of a vote's share relative to all votes. It sets the deviations that the read-out
/// gives, which are not used.
const VOTE_NOISE: f32 = 0.02;

/// The lattice of heights `k · step_m` above the ellipsoid.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeightLattice {
    pub(super) step_m: f64,
    /// Height that those of the surfaces count from, metres above the ellipsoid.
    pub(super) origin_m: f64,
}

impl HeightLattice {
    fn index(&self, height_m: f32) -> f32 {
        ((self.origin_m + f64::from(height_m)) / self.step_m) as f32
    }

    fn height_m(&self, low: i32, index: f32) -> f32 {
        ((f64::from(low) + f64::from(index)) * self.step_m - self.origin_m) as f32
    }
}

/// Hypotheses of each cell of a part of the grid.
struct Hypotheses {
    low: Vec<i32>,
    /// Hypothesis at which a steep surface is expected ([`Ranges::steep`]).
    steep: Vec<i32>,
    /// Index of each cell's first cost; one entry more than there are cells.
    offsets: Vec<u32>,
}

/// Returns the regularised height of each cell in which a view has a height, metres above the
/// origin; NaN elsewhere. All surfaces are those of one window of `size`.
pub(super) fn regularised(
    surfaces: &[ViewSurface],
    (width, height): (usize, usize),
    lattice: HeightLattice,
) -> Grid<f32> {
    let mut out = Grid::filled(width, height, f32::NAN);
    let Some(hypotheses) = hypotheses(surfaces, (width, height), lattice) else { return out };
    let Hypotheses { low, steep, offsets } = &hypotheses;
    let costs = costs(surfaces, &hypotheses, lattice);
    let edges = vec![0; width * height];
    let block = VolumeBlock { width, height, low, steep, offsets, costs: &costs, edges: &edges };
    aggregate(&block, PENALTIES, &mut Vec::new(), |y, sums| {
        let mut modes = Modes::new();
        for start in (0..width).step_by(TOGETHER) {
            let run = start..(start + TOGETHER).min(width);
            for (i, x) in run.clone().enumerate() {
                let own = sums.pixel_with_overhang(x);
                modes.put(Arrays, i, own, first_least(&own.0[..own.1]));
            }
            let read = modes.estimates(8.0 * f32::from(COST_MAX), VOTE_NOISE);
            for (i, x) in run.enumerate() {
                if surfaces.iter().any(|s| !s.height_m[(x, y)].is_nan()) {
                    out[(x, y)] = lattice.height_m(low[y * width + x], read.index[i]);
                }
            }
        }
    });
    out
}

/// Returns the least sum and the position of the first one that is as small.
fn first_least(sums: &[u16]) -> (u16, usize) {
    sums.iter().zip(0..).fold((u16::MAX, 0), |least, (sum, at)| if *sum < least.0 { (*sum, at) } else { least })
}

/// Lays out the hypotheses between the lowest and the highest heights around each cell; `None`
/// without any height.
fn hypotheses(surfaces: &[ViewSurface], (width, height): (usize, usize), lattice: HeightLattice) -> Option<Hypotheses> {
    let mut least = Grid::filled(width, height, f32::NAN);
    let mut greatest = least.clone();
    for surface in surfaces {
        // For a NaN `f32::min` and `f32::max` return the other operand.
        least.data_mut().iter_mut().zip(surface.height_m.data()).for_each(|(least, h)| *least = least.min(*h));
        greatest.data_mut().iter_mut().zip(surface.height_m.data()).for_each(|(most, h)| *most = most.max(*h));
    }
    let least = extremes(&least, f32::INFINITY, f32::min, NEIGHBOURS);
    let greatest = extremes(&greatest, f32::NEG_INFINITY, f32::max, NEIGHBOURS);
    let lowest = least.data().iter().copied().fold(f32::INFINITY, f32::min);
    let highest = greatest.data().iter().copied().fold(f32::NEG_INFINITY, f32::max);
    if lowest > highest {
        return None;
    }
    let middle = middle_heights(surfaces, (width, height));
    let full = [lowest, highest].map(|h| lattice.origin_m + f64::from(h));
    let HeightLattice { step_m, origin_m } = lattice;
    let ranges = Ranges::from_coarser(width, height, step_m, &middle, origin_m, (full[0], full[1]), Reach::even(1));
    let mut out =
        Hypotheses { low: Vec::with_capacity(width * height), steep: ranges.steep.into_vec(), offsets: vec![0] };
    let mut next = 0;
    for (i, (least, greatest)) in least.data().iter().zip(greatest.data()).enumerate() {
        // A cell with no height around it has one hypothesis, which is not read.
        let (mut from, mut to) = (0, 1);
        if least <= greatest {
            from = lattice.index(*least).floor() as i32 - BEYOND;
            to = lattice.index(*greatest).ceil() as i32 + BEYOND + 1;
        }
        if to - from > HYPOTHESES_MAX {
            let middle_m = middle[(i % width / 2, i / width / 2)];
            let middle = lattice.index(if middle_m.is_nan() { *least } else { middle_m }) as i32;
            from = (middle - HYPOTHESES_MAX / 2).clamp(from, to - HYPOTHESES_MAX);
            to = from + HYPOTHESES_MAX;
        }
        next += (to - from) as u32;
        out.low.push(from);
        out.offsets.push(next);
    }
    Some(out)
}

/// Returns the median height of all views in each square of 2 × 2 cells, metres; NaN without any.
fn middle_heights(surfaces: &[ViewSurface], (width, height): (usize, usize)) -> Grid<f32> {
    let mut out = Grid::filled(width.div_ceil(2), height.div_ceil(2), f32::NAN);
    let mut held = Vec::new();
    for y in 0..out.height() {
        for x in 0..out.width() {
            held.clear();
            let cells =
                (2 * y..(2 * y + 2).min(height)).flat_map(|v| (2 * x..(2 * x + 2).min(width)).map(move |u| (u, v)));
            held.extend(cells.flat_map(|cell| surfaces.iter().map(move |s| s.height_m[cell])).filter(|h| !h.is_nan()));
            out[(x, y)] = numeric::upper_median(&mut held).unwrap_or(f32::NAN);
        }
    }
    out
}

/// Computes the costs of all hypotheses from the votes.
fn costs(surfaces: &[ViewSurface], hypotheses: &Hypotheses, lattice: HeightLattice) -> Vec<u8> {
    let Hypotheses { low, offsets, .. } = hypotheses;
    let mut out = vec![COST_MAX; offsets[low.len()] as usize + LANES];
    let mut votes = Vec::new();
    for (i, low) in low.iter().enumerate() {
        let own = &mut out[offsets[i] as usize..offsets[i + 1] as usize];
        votes.clear();
        votes.resize(own.len(), 0.0f32);
        let mut all = DOUBT;
        for surface in surfaces.iter().filter(|s| !s.height_m.data()[i].is_nan()) {
            let (at, weight) = (lattice.index(surface.height_m.data()[i]) - *low as f32, surface.weight.data()[i]);
            all += weight;
            let (from, to) = ((at - VOTE_REACH).ceil().max(0.0) as usize, (at + VOTE_REACH).floor().max(-1.0) + 1.0);
            for k in from..(to as usize).min(votes.len()) {
                let near = 1.0 - ((k as f32 - at) / VOTE_REACH).powi(2);
                votes[k] += weight * near * near;
            }
        }
        own.iter_mut()
            .zip(&votes)
            .for_each(|(cost, votes)| *cost = (f32::from(COST_MAX) * (1.0 - votes / all)).round() as u8);
    }
    out
}

#[cfg(test)]
mod tests {
    use raster::Window;

    use super::*;

    const SIZE: usize = 60;
    const LATTICE: HeightLattice = HeightLattice { step_m: 0.5, origin_m: 100.2 };

    fn views(count: u32, height_m: impl Fn(u32, usize, usize) -> f32) -> Vec<ViewSurface> {
        let view = |view: u32| {
            let mut surface = ViewSurface::empty(view as usize, Window::whole(SIZE, SIZE));
            for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
                surface.height_m[(x, y)] = height_m(view, x, y);
                surface.sigma_m[(x, y)] = 0.2;
                surface.weight[(x, y)] = 1.0;
            }
            surface
        };
        (0..count).map(view).collect()
    }

    /// Noise between −1 and 1.
    fn noise(view: u32, x: usize, y: usize) -> f32 {
        let mut n = (view as usize * 7919 + y * 104_729 + x * 1299) as u32;
        for _ in 0..3 {
            n = (n ^ (n >> 16)).wrapping_mul(0x45d9_f3b5);
        }
        (n % 2001) as f32 / 1000.0 - 1.0
    }

    fn rmse(found: &Grid<f32>, truth: impl Fn(usize, usize) -> f32) -> f32 {
        let inner = 6..SIZE - 6;
        let cells = inner.clone().flat_map(|y| inner.clone().map(move |x| (x, y)));
        let squares: Vec<f32> = cells.map(|(x, y)| (found[(x, y)] - truth(x, y)).powi(2)).collect();
        (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
    }

    #[test]
    fn noise_goes_and_edges_and_slopes_stay() {
        // A house of 8 m on ground that climbs by 0.4 m per cell, in noise of 0.29 m.
        let truth = |x: usize, y: usize| {
            0.4 * x as f32 + if (20..40).contains(&x) && (20..40).contains(&y) { 8.0 } else { 0.0 }
        };
        let surfaces = views(3, |view, x, y| truth(x, y) + 0.5 * noise(view, x, y));
        let found = regularised(&surfaces, (SIZE, SIZE), LATTICE);
        let single = rmse(&surfaces[0].height_m, truth);
        assert!(rmse(&found, truth) < 0.6 * single, "{} against {single}", rmse(&found, truth));
        let mean = |x: usize| (25..35).map(|y| found[(x, y)]).sum::<f32>() / 10.0;
        assert!((mean(20) - mean(19) - 8.4).abs() < 0.4 && (mean(40) - mean(39) + 7.6).abs() < 0.4);
    }

    #[test]
    fn a_cell_whose_views_disagree_follows_those_around_it() {
        // Two views: one is wrong in every seventh cell of a row, where both weigh the same.
        let wrong = |view: u32, x: usize, y: usize| view == 1 && x % 7 == 3 && y % 7 == 3;
        let surfaces = views(2, |view, x, y| if wrong(view, x, y) { 25.0 } else { 3.1 });
        let found = regularised(&surfaces, (SIZE, SIZE), LATTICE);
        assert!(found.data().iter().all(|h| (h - 3.1).abs() < 0.1));
    }

    #[test]
    fn cells_without_heights_stay_void_and_blunders_bound_nothing() {
        let surfaces = views(1, |_, x, y| match (x, y) {
            (30, 30) => f32::NAN,
            (10, 10) => 90_000.0,
            _ => 3.0,
        });
        let found = regularised(&surfaces, (SIZE, SIZE), LATTICE);
        assert!(found[(30, 30)].is_nan() && (found[(11, 10)] - 3.0).abs() < 0.1);
        let none = views(2, |_, _, _| f32::NAN);
        assert!(regularised(&none, (SIZE, SIZE), LATTICE).data().iter().all(|h| h.is_nan()));
    }
}
