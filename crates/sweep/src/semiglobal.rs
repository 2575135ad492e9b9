//! Semi-global aggregation (Hirschmüller 2008) over height hypotheses that differ from pixel to pixel.
//!
//! Along each of eight directions, `L(p, k) = C(p, k) + min(L(q, k), L(q, k ± 1) + P1, min L(q) + P2) − min L(q)` with q
//! the pixel before p; the result is ΣL. Hypotheses are indices on one height lattice, so pixels with different ranges
//! meet at equal heights; a height that the previous pixel did not search can only be reached by a jump. P2 falls where
//! the image has an edge. Path costs are bytes, cut at 255.

use multiversion::multiversion;
use multiversion::target::match_target;

use crate::simd::Anywhere;
#[cfg(target_arch = "x86_64")]
use crate::simd::Avx2;
use crate::simd::paths::{Task, extend_row};
use crate::simd::rows::{Between, Row};

pub(crate) use crate::simd::rows::LANES;

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

/// Sums of path costs of one row.
#[derive(Debug, Clone, Copy)]
pub struct RowSums<'a> {
    sums: &'a [u16],
    /// Of the row's pixels among all costs, and where the next row's begin.
    offsets: &'a [u32],
}

impl RowSums<'_> {
    /// Those of the pixel at `x`.
    pub fn pixel(&self, x: usize) -> &[u16] {
        let (sums, count) = self.pixel_and_more(x);
        &sums[..count]
    }

    /// Those of the pixel at `x` with [`LANES`] more behind them, and how many they are.
    #[inline(always)]
    pub(crate) fn pixel_and_more(&self, x: usize) -> (&[u16], usize) {
        // The last pixel comes first.
        let end = self.offsets[self.offsets.len() - 1];
        let (first, count) = (end - self.offsets[x + 1], self.offsets[x + 1] - self.offsets[x]);
        (&self.sums[first as usize..][..count as usize + LANES], count as usize)
    }
}

/// The sums of the path costs over eight directions: `read` is given every row, the last one first. `forward` is for the
/// sums of the first four directions.
pub(crate) fn aggregate(
    volume: &Volume<'_>,
    penalties: Penalties,
    forward: &mut Vec<u16>,
    read: impl FnMut(usize, RowSums<'_>),
) {
    aggregate_with(volume, penalties, forward, extend_row_fast, read);
}

/// [`aggregate`] with a function that computes a row as [`extend_row`] does.
fn aggregate_with(
    volume: &Volume<'_>,
    penalties: Penalties,
    forward: &mut Vec<u16>,
    extend_row: ExtendRow,
    mut read: impl FnMut(usize, RowSums<'_>),
) {
    if volume.low.is_empty() {
        return;
    }
    if forward.len() < volume.costs.len() {
        forward.resize(volume.costs.len(), 0);
    }
    let mut sweep = Sweep::new(volume, penalties, false, extend_row);
    for y in 0..volume.height {
        let first = volume.row_offsets(y)[0] as usize;
        sweep.extend(volume, y, None, &mut forward[first..]);
    }
    let mut sweep = Sweep::new(volume, penalties, true, extend_row);
    let mut sums = vec![0; volume.row_capacity() + LANES];
    for y in (0..volume.height).rev() {
        sweep.extend(volume, y, Some(forward), &mut sums);
        read(y, RowSums { sums: &sums, offsets: volume.row_offsets(y) });
    }
}

type ExtendRow = fn(&Row, &mut Row, Task<'_>, &mut Between);

/// [`extend_row`] with the best instructions of the machine.
#[multiversion(targets("x86_64+avx2"))]
fn extend_row_fast(above: &Row, here: &mut Row, task: Task<'_>, between: &mut Between) {
    match_target! {
        "x86_64+avx2" => extend_row::<Avx2>(above, here, task, between),
        _ => extend_row::<Anywhere>(above, here, task, between),
    };
}

/// Four of the eight directions, row by row: from the left and from the three pixels above, or mirrored at the centre.
struct Sweep {
    backward: bool,
    step: u8,
    /// The jump penalty by the strength of the edge.
    jumps: [u8; 256],
    above: Row,
    here: Row,
    between: Between,
    extend_row: ExtendRow,
}

impl Sweep {
    fn new(v: &Volume<'_>, penalties: Penalties, backward: bool, extend_row: ExtendRow) -> Self {
        let (above, here, between) = (Row::default(), Row::default(), Between::default());
        let mut sweep = Self { backward, step: penalties.step, jumps: [0; 256], above, here, between, extend_row };
        // Nothing comes before a path's first pixel, and staying there costs nothing: a jump neither.
        sweep.place(v, if backward { v.height - 1 } else { 0 });
        sweep.jumps = std::array::from_fn(|edge| jump_penalty(penalties, edge as u8));
        sweep
    }

    /// Takes the places and penalties of a row.
    fn place(&mut self, v: &Volume<'_>, y: usize) {
        let row = y * v.width..(y + 1) * v.width;
        let pixels = v.low[row.clone()].iter().zip(v.row_offsets(y).array_windows()).zip(&v.edges[row]);
        let jumps = &self.jumps;
        let pixel = |((low, [from, to]), edge): ((&i32, &[u32; 2]), &u8)| {
            (*low, (to - from) as usize, jumps[usize::from(*edge)])
        };
        match self.backward {
            true => self.here.place(v.width, pixels.rev().map(pixel)),
            false => self.here.place(v.width, pixels.map(pixel)),
        }
    }

    /// The next row; its sums, and those `before` of all rows, go to `sums` in the order of the sweep.
    fn extend(&mut self, v: &Volume<'_>, y: usize, before: Option<&[u16]>, sums: &mut [u16]) {
        std::mem::swap(&mut self.above, &mut self.here);
        self.place(v, y);
        let first = v.row_offsets(y)[0] as usize;
        let (costs, before) = (&v.costs[first..], before.map(|all| &all[first..]));
        let task = Task { costs, backward: self.backward, step: self.step, before, sums };
        (self.extend_row)(&self.above, &mut self.here, task, &mut self.between);
    }
}

impl Volume<'_> {
    /// Where the costs of a row's pixels begin, and those of the next row.
    fn row_offsets(&self, y: usize) -> &[u32] {
        &self.offsets[y * self.width..(y + 1) * self.width + 1]
    }

    /// The most hypotheses of a row.
    fn row_capacity(&self) -> usize {
        let row = |y: usize| self.offsets[(y + 1) * self.width] - self.offsets[y * self.width];
        (0..self.height).map(row).max().unwrap_or(0) as usize
    }
}

/// The jump penalty at a pixel: the stronger its edge is, the lower. Between two pixels it is the lower one of theirs.
fn jump_penalty(p: Penalties, edge: u8) -> u8 {
    let range = u16::from(p.jump.saturating_sub(p.jump_at_edge));
    p.jump - ((range * u16::from(edge)) / 255) as u8
}

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
        edges: &[u8],
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
                        let jump = u32::from(jump_penalty(p, edges[at].max(edges[q])));
                        let smooth = path(k).min(path(k - 1) + u32::from(p.step)).min(path(k + 1) + u32::from(p.step));
                        (c + smooth.min(least + jump).min(255) - least).min(255)
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

    const ROWS: [(&str, ExtendRow); 2] =
        [("this machine's instructions", extend_row_fast), ("any machine's", extend_row::<Anywhere>)];

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
        let p = Penalties { step: 30, jump: 150, jump_at_edge: 60 };
        let edges: Vec<u8> = (0..width * height).map(|_| random(256) as u8).collect();
        let volume = Volume { width, height, low: &low, offsets: &offsets, costs: &flat, edges: &edges };
        let expected = reference(width, height, &low, &counts, &costs, &edges, p);
        for (name, extend_row) in ROWS {
            let mut sums = vec![Vec::new(); width * height];
            aggregate_with(&volume, p, &mut Vec::new(), extend_row, |y, row| {
                (0..width).for_each(|x| sums[y * width + x] = row.pixel(x).iter().map(|&s| u32::from(s)).collect());
            });
            assert_eq!(sums, expected, "{name}, {lows} first heights, up to {} hypotheses", 6 + most);
        }
    }
}
