//! Semi-global aggregation (Hirschmüller 2008) over height hypotheses that differ from pixel to pixel.
//!
//! Along each of eight directions, `L(p, k) = C(p, k) + min(L(q, k), L(q, k ± 1) + P1, min L(q) + P2) − min L(q)` with q
//! the pixel before p; the result is ΣL. Hypotheses are indices on one height lattice, so pixels with different ranges
//! meet at equal heights; a height that the previous pixel did not search can only be reached by a jump. P2 falls where
//! the image has an edge. Path costs are bytes, cut at 255.

use multiversion::multiversion;
use multiversion::target::match_target;

use crate::simd::{Bytes, Plain};
#[cfg(target_arch = "x86_64")]
use crate::simd::{Sixteen, ThirtyTwo};

/// Penalties in units of the cost ([`crate::cost::COST_MAX`] = worst).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalties {
    /// For a change of one step.
    pub step: u8,
    /// For a jump, where the image is flat.
    pub jump: u8,
    /// For a jump, across the strongest edges.
    pub jump_at_edge: u8,
}

impl Default for Penalties {
    /// Measured on simulated towns and the LiDAR truth of JAX_068: a step costs about a quarter of the worst cost, so that noise
    /// does not ripple a roof; a jump a little more than the worst cost, and no more than a step across an image edge,
    /// where roofs end. The proportions are those of CARS and S2P (8 to 32 of 24 bits).
    fn default() -> Self {
        Self { step: 32, jump: 124, jump_at_edge: 32 }
    }
}

/// The cost of heights that a pixel does not search. Others reach it only where the worst cost and the penalty of a jump do
/// together, and are cut.
const FAR: u8 = u8::MAX;
/// Most hypotheses that are worked on together, a vector register of bytes; most pixels need half of it.
pub(crate) const LANES: usize = 32;
/// Guard entries before a pixel's path costs: a neighbour may search this many heights fewer one, and find its own in place.
const BEFORE: usize = 8;
/// Guard entries behind them: a vector that overhangs, and heights above this one's as below.
const BEHIND: usize = LANES + BEFORE;

/// A block of pixels with their hypotheses, row after row.
pub(crate) struct Volume<'a> {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// First hypothesis of each pixel.
    pub(crate) low: &'a [i32],
    /// Where each pixel's costs begin; one entry more than there are pixels.
    pub(crate) offsets: &'a [u32],
    /// The costs, and [`LANES`] entries that belong to no pixel.
    pub(crate) costs: &'a [u8],
    /// Strength of the image gradient at each pixel relative to the noise and contrast, 0 (flat) to 255 (edge).
    pub(crate) edges: &'a [u8],
}

/// Path costs of one row along one direction, and each pixel's least.
struct RowPaths {
    paths: Vec<u8>,
    least: Vec<u8>,
}

/// Where a pixel's hypotheses are: among all costs, and among the paths of its row.
#[derive(Clone, Copy)]
struct Span {
    pixel: usize,
    at: usize,
    count: usize,
    place: usize,
}

/// The previous pixel of a path, as the next one sees it.
#[derive(Clone, Copy)]
struct Previous<'a> {
    /// Its path costs from the height below the next pixel's first one on; [`FAR`] for heights that it did not search.
    paths: &'a [u8],
    least: u8,
    /// The cost of a jump from its best height.
    jumped: u8,
}

/// The sum of the path costs over eight directions, in the layout of the costs.
pub(crate) fn aggregate(volume: &Volume<'_>, penalties: Penalties) -> Vec<u16> {
    let mut sums = vec![0; volume.costs.len()];
    sweep_rows(volume, penalties, false, &mut sums);
    sweep_rows(volume, penalties, true, &mut sums);
    sums
}

impl Volume<'_> {
    #[inline(always)]
    fn span(&self, x: usize, y: usize) -> Span {
        let (row, pixel) = (y * self.width, y * self.width + x);
        let at = self.offsets[pixel] as usize;
        let count = self.offsets[pixel + 1] as usize - at;
        Span { pixel, at, count, place: at - self.offsets[row] as usize + (BEFORE + BEHIND) * x }
    }

    /// The previous pixel `q` of a path to `p`, whose vectors take `len` path costs with one on either side; they are
    /// moved to `aside` where they do not lie ready.
    #[inline(always)]
    fn previous<'a>(
        &self,
        (p, q): (Span, Span),
        (paths, least): (&'a [u8], u8),
        len: usize,
        penalties: Penalties,
        aside: &'a mut [u8],
    ) -> Previous<'a> {
        let jump = jump_penalty(penalties, self.edges[p.pixel], self.edges[q.pixel]);
        // The previous pixel's hypothesis that is one below this one's first.
        let first = self.low[p.pixel] - self.low[q.pixel] - 1;
        let begin = BEFORE as i32 + first;
        let paths = if begin >= 0 && begin as usize + len <= q.count + BEFORE + BEHIND {
            &paths[begin as usize..][..len]
        } else {
            moved(&paths[BEFORE..BEFORE + q.count], first, &mut aside[..len])
        };
        Previous { paths, least, jumped: least.saturating_add(jump) }
    }

    /// The longest row, in entries with their guards.
    fn row_capacity(&self) -> usize {
        let rows = (0..self.height).map(|y| self.offsets[(y + 1) * self.width] - self.offsets[y * self.width]);
        rows.max().unwrap_or(0) as usize + (BEFORE + BEHIND) * self.width
    }

    /// The most hypotheses of a pixel, with their guards.
    fn pixel_capacity(&self) -> usize {
        self.offsets.windows(2).map(|o| o[1] - o[0]).max().unwrap_or(0) as usize + BEFORE + BEHIND
    }
}

/// The path costs from the hypothesis `first` on, which may lie outside, as many as `to` holds.
fn moved<'a>(paths: &[u8], first: i32, to: &'a mut [u8]) -> &'a [u8] {
    let (have, want) = (paths.len() as i32, to.len() as i32);
    let from = first.clamp(0, have);
    let end = first.saturating_add(want).clamp(from, have);
    to.fill(FAR);
    if from < end {
        let at = (from - first) as usize;
        to[at..at + (end - from) as usize].copy_from_slice(&paths[from as usize..end as usize]);
    }
    to
}

/// Four of the eight directions: from the left and from the three pixels above, or mirrored at the centre.
#[multiversion(targets("x86_64+avx2"))]
fn sweep_rows(v: &Volume<'_>, penalties: Penalties, backward: bool, sums: &mut [u16]) {
    let (row, pixel) = (v.row_capacity(), v.pixel_capacity());
    let new_row = || RowPaths { paths: vec![FAR; row], least: vec![0; v.width] };
    let mut above: [RowPaths; 3] = std::array::from_fn(|_| new_row());
    let mut here: [RowPaths; 3] = std::array::from_fn(|_| new_row());
    // Along the row only the last pixel's paths are needed.
    let (mut last, mut along, mut last_least) = (vec![FAR; pixel], vec![FAR; pixel], 0);
    let mut aside: [Vec<u8>; 4] = std::array::from_fn(|_| vec![FAR; pixel]);
    let nothing = vec![FAR; pixel];
    for i in 0..v.height {
        let y = if backward { v.height - 1 - i } else { i };
        let y_above = if backward { y + 1 } else { y.wrapping_sub(1) };
        for j in 0..v.width {
            let x = if backward { v.width - 1 - j } else { j };
            let p = v.span(x, y);
            let len = p.count.next_multiple_of(if p.count > LANES / 2 { LANES } else { LANES / 2 }) + 2;
            // Nothing comes before a path's first pixel, and staying there costs nothing.
            let mut from = [Previous { paths: &nothing[..len], least: 0, jumped: 0 }; 4];
            let [beside, upper @ ..] = &mut aside;
            if j > 0 {
                let q = v.span(if backward { x + 1 } else { x - 1 }, y);
                from[0] = v.previous((p, q), (&last, last_least), len, penalties, beside);
            }
            for (d, aside) in upper.iter_mut().enumerate() {
                let qx = (x + d).wrapping_sub(1);
                if i > 0 && qx < v.width {
                    let q = v.span(qx, y_above);
                    let paths = (&above[d].paths[q.place..], above[d].least[qx]);
                    from[d + 1] = v.previous((p, q), paths, len, penalties, aside);
                }
            }
            let [a, b, c] = &mut here;
            let to = [&mut along[..], &mut a.paths[p.place..], &mut b.paths[p.place..], &mut c.paths[p.place..]];
            let (costs, own) = (&v.costs[p.at..], &mut sums[p.at..]);
            let narrow = p.count <= LANES / 2;
            let least = match_target! {
                "x86_64+avx2" => match narrow {
                    true => extend::<Sixteen>(costs, p.count, from, penalties.step, to, own),
                    false => extend::<ThirtyTwo>(costs, p.count, from, penalties.step, to, own),
                },
                _ => match narrow {
                    true => extend::<Plain<16>>(costs, p.count, from, penalties.step, to, own),
                    false => extend::<Plain<32>>(costs, p.count, from, penalties.step, to, own),
                },
            };
            last_least = least[0];
            here.iter_mut().zip(&least[1..]).for_each(|(row, l)| row.least[x] = *l);
            std::mem::swap(&mut last, &mut along);
        }
        std::mem::swap(&mut above, &mut here);
    }
}

/// The jump penalty between two pixels: lowered by the stronger of their edges.
#[inline(always)]
fn jump_penalty(p: Penalties, a: u8, b: u8) -> u8 {
    let range = u16::from(p.jump.saturating_sub(p.jump_at_edge));
    p.jump - ((range * u16::from(a.max(b))) / 255) as u8
}

/// Extends four paths to a pixel with `count` hypotheses and adds them to its sums; returns the least cost of each. `costs`
/// and `sums` begin at the pixel and may be read, not changed, behind it; the paths get their guards.
#[inline(always)]
fn extend<V: Bytes>(
    costs: &[u8],
    count: usize,
    from: [Previous<'_>; 4],
    step: u8,
    mut to: [&mut [u8]; 4],
    sums: &mut [u16],
) -> [u8; 4] {
    let step = V::splat(step);
    let mut least = [V::splat(FAR); 4];
    for at in (0..count).step_by(V::LANES) {
        let cost = V::load(&costs[at..]);
        let own = V::load(&OWN[LANES - (count - at).min(V::LANES)..]);
        let mut values = least;
        for (((q, to), least), value) in from.iter().zip(&mut to).zip(&mut least).zip(&mut values) {
            let around = &q.paths[at..at + V::LANES + 2];
            let (below, same, above) = (V::load(around), V::load(&around[1..]), V::load(&around[2..]));
            let stay = same.min(below.min(above).plus(step)).min(V::splat(q.jumped));
            let path = cost.plus(stay.minus(V::splat(q.least)));
            *value = path.and(own);
            let path = path.or_not(own);
            path.store(&mut to[BEFORE + at..]);
            *least = least.min(path);
        }
        V::add_to(values, &mut sums[at..]);
    }
    for to in to {
        to[..BEFORE].fill(FAR);
        to[BEFORE + count..][..BEHIND].fill(FAR);
    }
    V::least(least)
}

/// From [`LANES`] − n on: all bits of n lanes, and none of those that follow.
const OWN: [u8; 2 * LANES] = {
    let mut out = [0; 2 * LANES];
    let mut i = 0;
    while i < LANES {
        out[i] = u8::MAX;
        i += 1;
    }
    out
};

#[cfg(test)]
mod tests {
    use super::*;

    /// The recurrence as it is written in the module's text, over a full lattice, without ranges or guards; path costs are
    /// cut at 255.
    fn reference(
        width: usize,
        height: usize,
        low: &[i32],
        counts: &[usize],
        costs: &[Vec<u8>],
        p: Penalties,
    ) -> Vec<Vec<u32>> {
        let mut sums: Vec<Vec<u32>> = counts.iter().map(|&n| vec![0; n]).collect();
        for (dx, dy) in [(1i64, 0i64), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)] {
            let mut paths: Vec<Vec<u32>> = vec![Vec::new(); width * height];
            let xs: Vec<i64> = if dx < 0 { (0..width as i64).rev().collect() } else { (0..width as i64).collect() };
            let ys: Vec<i64> = if dy < 0 { (0..height as i64).rev().collect() } else { (0..height as i64).collect() };
            for &y in &ys {
                for &x in &xs {
                    let at = (y as usize) * width + x as usize;
                    let (qx, qy) = (x - dx, y - dy);
                    let inside = qx >= 0 && qy >= 0 && qx < width as i64 && qy < height as i64;
                    let q = inside.then(|| qy as usize * width + qx as usize);
                    let row = (0..counts[at]).map(|d| {
                        let c = u32::from(costs[at][d]);
                        let Some(q) = q else { return c };
                        let k = low[at] + d as i32;
                        let path = |k: i32| {
                            let i = k - low[q];
                            if i >= 0 && (i as usize) < counts[q] { paths[q][i as usize] } else { 1 << 20 }
                        };
                        let least = *paths[q].iter().min().unwrap();
                        let smooth = path(k).min(path(k - 1) + u32::from(p.step)).min(path(k + 1) + u32::from(p.step));
                        (c + smooth.min(least + u32::from(p.jump)).min(255) - least).min(255)
                    });
                    let row: Vec<u32> = row.collect();
                    sums[at].iter_mut().zip(&row).for_each(|(s, l)| *s += l);
                    paths[at] = row;
                }
            }
        }
        sums
    }

    /// Neighbours that search quite other heights, nearly the same ones, and the same.
    #[test]
    fn equals_the_textbook_recurrence_with_ranges_that_differ() {
        for (lows, counts) in [(30, 24), (300, 90), (4, 24), (4, 3), (1, 1)] {
            compare_with_the_recurrence(lows, counts);
        }
    }

    /// First hypotheses over `lows` lattice heights, and up to `most` of them.
    fn compare_with_the_recurrence(lows: u32, most: u32) {
        let (width, height) = (9, 7);
        let mut state = 12345u32;
        let mut random = move |n: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % n
        };
        let low: Vec<i32> = (0..width * height).map(|_| random(lows) as i32 - 10).collect();
        let counts: Vec<usize> = (0..width * height).map(|_| 7 + random(most) as usize).collect();
        let costs: Vec<Vec<u8>> = counts.iter().map(|&n| (0..n).map(|_| random(128) as u8).collect()).collect();
        let mut offsets = vec![0u32];
        counts.iter().for_each(|&n| offsets.push(offsets[offsets.len() - 1] + n as u32));
        let flat: Vec<u8> = [costs.concat(), vec![0; LANES]].concat();
        let p = Penalties { step: 30, jump: 150, jump_at_edge: 150 };
        let edges = vec![0; width * height];
        let volume = Volume { width, height, low: &low, offsets: &offsets, costs: &flat, edges: &edges };
        let sums = aggregate(&volume, p);
        let expected: Vec<u32> = reference(width, height, &low, &counts, &costs, p).concat();
        let (own, behind) = sums.split_at(expected.len());
        assert_eq!(own.iter().map(|&s| u32::from(s)).collect::<Vec<_>>(), expected);
        assert_eq!(behind, [0; LANES]);
    }
}
