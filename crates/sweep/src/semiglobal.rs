//! Semi-global aggregation (Hirschmüller 2008) over height hypotheses that differ from pixel to pixel.
//!
//! Along each of eight directions, `L(p, k) = C(p, k) + min(L(q, k), L(q, k ± 1) + P1, min L(q) + P2) − min L(q)` with q
//! the pixel before p; the result is ΣL. Hypotheses are indices on one height lattice, so pixels with different ranges
//! meet at equal heights; a height that the previous pixel did not search can only be reached by a jump. P2 falls where
//! the image has an edge.

use multiversion::multiversion;

/// Penalties in units of the cost ([`crate::cost::COST_MAX`] = worst).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalties {
    /// For a change of one step.
    pub step: u16,
    /// For a jump, where the image is flat.
    pub jump: u16,
    /// For a jump, across the strongest edges.
    pub jump_at_edge: u16,
}

/// Larger than any path cost, small enough that adding a penalty does not overflow.
const FAR: u16 = 20_000;
/// Guard entries on each side of a pixel's path costs.
const PAD: usize = 2;

/// A block of pixels with their hypotheses, row after row.
pub(crate) struct Volume<'a> {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// First hypothesis of each pixel.
    pub(crate) low: &'a [i32],
    /// Where each pixel's costs begin; one entry more than there are pixels.
    pub(crate) offsets: &'a [u32],
    pub(crate) costs: &'a [u8],
    /// Strength of the image gradient at each pixel relative to the noise and contrast, 0 (flat) to 255 (edge).
    pub(crate) edges: &'a [u8],
}

/// Path costs of one row, and each pixel's least.
#[derive(Default)]
struct RowPaths {
    paths: Vec<u16>,
    least: Vec<u16>,
}

/// The sum of the path costs over eight directions, in the layout of the costs.
pub(crate) fn aggregate(volume: &Volume<'_>, penalties: Penalties, sums: &mut Vec<u16>) {
    sums.clear();
    sums.resize(volume.costs.len(), 0);
    sweep_rows(volume, penalties, false, sums);
    sweep_rows(volume, penalties, true, sums);
}

/// The longest row, in entries with their guards.
fn row_capacity(v: &Volume<'_>) -> usize {
    let rows = (0..v.height).map(|y| v.offsets[(y + 1) * v.width] - v.offsets[y * v.width]);
    rows.max().unwrap_or(0) as usize + 2 * PAD * v.width
}

/// Four of the eight directions: from the left and from the three pixels above, or mirrored at the centre.
#[multiversion(targets("x86_64+avx2"))]
fn sweep_rows(v: &Volume<'_>, penalties: Penalties, backward: bool, sums: &mut [u16]) {
    let capacity = row_capacity(v);
    let new_row = || RowPaths { paths: vec![FAR; capacity], least: vec![0; v.width] };
    let mut above: [RowPaths; 3] = std::array::from_fn(|_| new_row());
    let mut here: [RowPaths; 3] = std::array::from_fn(|_| new_row());
    let mut along = new_row();
    for i in 0..v.height {
        let y = if backward { v.height - 1 - i } else { i };
        let y_above = (i > 0).then(|| if backward { y + 1 } else { y - 1 });
        for j in 0..v.width {
            let x = if backward { v.width - 1 - j } else { j };
            let before = (j > 0).then(|| if backward { x + 1 } else { x - 1 });
            step(v, penalties, (x, y), before.map(|bx| (bx, y)), None, &mut along, sums);
            for (d, (from, to)) in above.iter().zip(&mut here).enumerate() {
                let bx = (x + d).wrapping_sub(1);
                let q = y_above.filter(|_| bx < v.width).map(|by| (bx, by));
                step(v, penalties, (x, y), q, Some(from), to, sums);
            }
        }
        std::mem::swap(&mut above, &mut here);
    }
}

/// One pixel along one direction. `from` holds the previous pixel's paths, or is `None` when they are in `to` itself.
#[inline(always)]
fn step(
    v: &Volume<'_>,
    penalties: Penalties,
    (x, y): (usize, usize),
    before: Option<(usize, usize)>,
    from: Option<&RowPaths>,
    to: &mut RowPaths,
    sums: &mut [u16],
) {
    let p = y * v.width + x;
    let (at, n) = (v.offsets[p] as usize, (v.offsets[p + 1] - v.offsets[p]) as usize);
    let place = at - v.offsets[y * v.width] as usize + 2 * PAD * x;
    let costs = &v.costs[at..at + n];
    let sums = &mut sums[at..at + n];
    let Some((qx, qy)) = before else {
        let paths = &mut to.paths[place..place + n + 2 * PAD];
        guard(paths, n);
        to.least[x] = start(costs, &mut paths[PAD..PAD + n], sums);
        return;
    };
    let q = qy * v.width + qx;
    let q_n = (v.offsets[q + 1] - v.offsets[q]) as usize;
    let q_place = (v.offsets[q] - v.offsets[qy * v.width]) as usize + 2 * PAD * qx;
    let jump = jump_penalty(penalties, v.edges[p], v.edges[q]);
    let shift = v.low[p] - v.low[q];
    let (q_paths, q_least, paths) = match from {
        Some(row) => {
            (&row.paths[q_place..q_place + q_n + 2 * PAD], row.least[qx], &mut to.paths[place..place + n + 2 * PAD])
        }
        None => {
            let least = to.least[qx];
            // The previous pixel of the same row lies wholly before or wholly behind this one.
            if q_place < place {
                let (a, b) = to.paths.split_at_mut(place);
                (&a[q_place..q_place + q_n + 2 * PAD], least, &mut b[..n + 2 * PAD])
            } else {
                let (a, b) = to.paths.split_at_mut(q_place);
                (&b[..q_n + 2 * PAD], least, &mut a[place..place + n + 2 * PAD])
            }
        }
    };
    guard(paths, n);
    let previous = Previous { paths: q_paths, least: q_least, count: q_n, shift };
    to.least[x] = extend(costs, previous, penalties.step, jump, &mut paths[PAD..PAD + n], sums);
}

#[inline(always)]
fn guard(paths: &mut [u16], n: usize) {
    paths[..PAD].fill(FAR);
    paths[PAD + n..].fill(FAR);
}

/// The jump penalty between two pixels: lowered by the stronger of their edges.
#[inline(always)]
fn jump_penalty(p: Penalties, a: u8, b: u8) -> u16 {
    let range = u32::from(p.jump.saturating_sub(p.jump_at_edge));
    p.jump - ((range * u32::from(a.max(b))) / 255) as u16
}

/// The first pixel of a path.
#[inline(always)]
fn start(costs: &[u8], paths: &mut [u16], sums: &mut [u16]) -> u16 {
    let mut least = u16::MAX;
    for ((c, l), s) in costs.iter().zip(paths).zip(sums) {
        *l = u16::from(*c);
        *s += *l;
        least = least.min(*l);
    }
    least
}

/// The previous pixel of a path: its costs with guards, and how its hypotheses lie to this pixel's.
struct Previous<'a> {
    paths: &'a [u16],
    least: u16,
    count: usize,
    /// This pixel's first hypothesis minus the previous one's.
    shift: i32,
}

#[inline(always)]
fn extend(costs: &[u8], q: Previous<'_>, step: u16, jump: u16, paths: &mut [u16], sums: &mut [u16]) -> u16 {
    let n = costs.len() as i32;
    // Where hypothesis d of this pixel has d + shift within one step of the previous pixel's range.
    let first = (-1 - q.shift).clamp(0, n) as usize;
    let last = (q.count as i32 + 1 - q.shift).clamp(first as i32, n) as usize;
    let mut least = u16::MAX;
    for d in (0..first).chain(last..n as usize) {
        let l = u16::from(costs[d]) + jump;
        paths[d] = l;
        sums[d] += l;
        least = least.min(l);
    }
    if first < last {
        let len = last - first;
        let at = (first as i32 + q.shift + PAD as i32) as usize;
        let (below, same, above) = (&q.paths[at - 1..][..len], &q.paths[at..][..len], &q.paths[at + 1..][..len]);
        let (c, l, s) = (&costs[first..last], &mut paths[first..last], &mut sums[first..last]);
        let bound = q.least + jump;
        for i in 0..len {
            let stay = same[i].min(below[i].min(above[i]) + step).min(bound);
            let value = u16::from(c[i]) + stay - q.least;
            l[i] = value;
            s[i] += value;
            least = least.min(value);
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The recurrence as it is written in the module's text, over a full lattice, without ranges or guards.
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
                        c + smooth.min(least + u32::from(p.jump)) - least
                    });
                    let row: Vec<u32> = row.collect();
                    sums[at].iter_mut().zip(&row).for_each(|(s, l)| *s += l);
                    paths[at] = row;
                }
            }
        }
        sums
    }

    #[test]
    fn equals_the_textbook_recurrence_with_ranges_that_differ() {
        let (width, height) = (9, 7);
        let mut state = 12345u32;
        let mut random = move |n: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % n
        };
        let low: Vec<i32> = (0..width * height).map(|_| random(30) as i32 - 10).collect();
        let counts: Vec<usize> = (0..width * height).map(|_| 1 + random(24) as usize).collect();
        let costs: Vec<Vec<u8>> = counts.iter().map(|&n| (0..n).map(|_| random(128) as u8).collect()).collect();
        let mut offsets = vec![0u32];
        counts.iter().for_each(|&n| offsets.push(offsets[offsets.len() - 1] + n as u32));
        let flat: Vec<u8> = costs.concat();
        let p = Penalties { step: 8, jump: 32, jump_at_edge: 32 };
        let edges = vec![0; width * height];
        let volume = Volume { width, height, low: &low, offsets: &offsets, costs: &flat, edges: &edges };
        let mut sums = Vec::new();
        aggregate(&volume, p, &mut sums);
        let expected: Vec<u32> = reference(width, height, &low, &counts, &costs, p).concat();
        assert_eq!(sums.iter().map(|&s| u32::from(s)).collect::<Vec<_>>(), expected);
    }
}
