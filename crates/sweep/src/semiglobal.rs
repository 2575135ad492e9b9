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
/// Hypotheses that are worked on together: ranges are mostly this short.
pub(crate) const LANES: usize = 8;
/// Guard entries before a pixel's path costs: heights that a neighbour may search below this one's and still be compared
/// in whole vectors, and one.
const BEFORE: usize = 4;
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
    paths: Vec<u16>,
    least: Vec<u16>,
}

/// Where a pixel's hypotheses are: among all costs, and among the paths of its row.
#[derive(Clone, Copy)]
struct Span {
    pixel: usize,
    at: usize,
    count: usize,
    place: usize,
}

/// The previous pixel of a path.
struct Previous<'a> {
    /// Its path costs with their guards.
    paths: &'a [u16],
    least: u16,
    count: usize,
    /// The pixel's first hypothesis minus the previous one's.
    shift: i32,
    /// The penalty of a jump between the two.
    jump: u16,
}

/// The sum of the path costs over eight directions, in the layout of the costs.
pub(crate) fn aggregate(volume: &Volume<'_>, penalties: Penalties, sums: &mut Vec<u16>) {
    sums.clear();
    sums.resize(volume.costs.len(), 0);
    sweep_rows(volume, penalties, false, sums);
    sweep_rows(volume, penalties, true, sums);
}

impl Volume<'_> {
    fn span(&self, x: usize, y: usize) -> Span {
        let (row, pixel) = (y * self.width, y * self.width + x);
        let at = self.offsets[pixel] as usize;
        let count = self.offsets[pixel + 1] as usize - at;
        Span { pixel, at, count, place: at - self.offsets[row] as usize + (BEFORE + BEHIND) * x }
    }

    fn previous<'a>(&self, p: Span, q: Span, paths: &'a [u16], least: u16, penalties: Penalties) -> Previous<'a> {
        Previous {
            paths,
            least,
            count: q.count,
            shift: self.low[p.pixel] - self.low[q.pixel],
            jump: jump_penalty(penalties, self.edges[p.pixel], self.edges[q.pixel]),
        }
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

/// Four of the eight directions: from the left and from the three pixels above, or mirrored at the centre.
#[multiversion(targets("x86_64+avx2"))]
fn sweep_rows(v: &Volume<'_>, penalties: Penalties, backward: bool, sums: &mut [u16]) {
    let capacity = v.row_capacity();
    let new_row = || RowPaths { paths: vec![FAR; capacity], least: vec![0; v.width] };
    let mut above: [RowPaths; 3] = std::array::from_fn(|_| new_row());
    let mut here: [RowPaths; 3] = std::array::from_fn(|_| new_row());
    // Along the row only the last pixel's paths are needed.
    let (mut last, mut along) = (vec![FAR; v.pixel_capacity()], vec![FAR; v.pixel_capacity()]);
    let mut last_least = 0;
    for i in 0..v.height {
        let y = if backward { v.height - 1 - i } else { i };
        let y_above = if backward { y + 1 } else { y.wrapping_sub(1) };
        for j in 0..v.width {
            let x = if backward { v.width - 1 - j } else { j };
            let p = v.span(x, y);
            let beside = (j > 0).then(|| {
                let q = v.span(if backward { x + 1 } else { x - 1 }, y);
                v.previous(p, q, &last[..q.count + BEFORE + BEHIND], last_least, penalties)
            });
            let upper = |d: usize| {
                let qx = (x + d).wrapping_sub(1);
                (i > 0 && qx < v.width).then(|| {
                    let q = v.span(qx, y_above);
                    let paths = &above[d].paths[q.place..][..q.count + BEFORE + BEHIND];
                    v.previous(p, q, paths, above[d].least[qx], penalties)
                })
            };
            let from = [beside, upper(0), upper(1), upper(2)];
            let width = p.count + BEFORE + BEHIND;
            let [a, b, c] = &mut here;
            let to = [
                &mut along[..width],
                &mut a.paths[p.place..][..width],
                &mut b.paths[p.place..][..width],
                &mut c.paths[p.place..][..width],
            ];
            let least = extend(&v.costs[p.at..], p.count, from, penalties.step, to, &mut sums[p.at..]);
            last_least = least[0];
            here.iter_mut().zip(&least[1..]).for_each(|(row, l)| row.least[x] = *l);
            std::mem::swap(&mut last, &mut along);
        }
        std::mem::swap(&mut above, &mut here);
    }
}

/// The jump penalty between two pixels: lowered by the stronger of their edges.
#[inline(always)]
fn jump_penalty(p: Penalties, a: u8, b: u8) -> u16 {
    let range = u32::from(p.jump.saturating_sub(p.jump_at_edge));
    p.jump - ((range * u32::from(a.max(b))) / 255) as u16
}

/// Extends four paths to a pixel; returns the least cost of each. `costs` and `sums` begin at the pixel and may be read,
/// not changed, behind it.
#[inline(always)]
fn extend(
    costs: &[u8],
    count: usize,
    from: [Option<Previous<'_>>; 4],
    step: u16,
    mut to: [&mut [u16]; 4],
    sums: &mut [u16],
) -> [u16; 4] {
    if let [Some(a), Some(b), Some(c), Some(d)] = &from
        && [a, b, c, d].iter().all(|q| q.is_near(count))
    {
        return extend_near(costs, count, [a, b, c, d], step, &mut to, sums);
    }
    let mut least = [0; 4];
    for ((least, q), to) in least.iter_mut().zip(from).zip(to) {
        let (costs, sums) = (&costs[..count], &mut sums[..count]);
        *least = match q {
            Some(q) => extend_far(costs, q, step, &mut to[BEFORE..BEFORE + count], sums),
            None => start(costs, &mut to[BEFORE..BEFORE + count], sums),
        };
        guard(to, count);
    }
    least
}

#[inline(always)]
fn guard(paths: &mut [u16], count: usize) {
    paths[..BEFORE].fill(FAR);
    paths[BEFORE + count..].fill(FAR);
}

impl Previous<'_> {
    /// Whether all heights of a pixel with `count` of them fall among the path costs and their guards, in whole vectors.
    #[inline(always)]
    fn is_near(&self, count: usize) -> bool {
        let first = BEFORE as i32 + self.shift - 1;
        first >= 0 && first as usize + count.next_multiple_of(LANES) + 2 <= self.paths.len()
    }
}

/// [`extend`] for pixels that search nearly the same heights, a vector at a time.
#[inline(always)]
fn extend_near(
    costs: &[u8],
    count: usize,
    from: [&Previous<'_>; 4],
    step: u16,
    to: &mut [&mut [u16]; 4],
    sums: &mut [u16],
) -> [u16; 4] {
    let mut least = [[u16::MAX; LANES]; 4];
    for at in (0..count).step_by(LANES) {
        let others = OTHERS[(count - at).min(LANES)];
        let (Some(costs), Some(sums)) = (costs[at..].first_chunk::<LANES>(), sums[at..].first_chunk_mut::<LANES>())
        else {
            break;
        };
        let costs = widened(costs);
        let mut total = [0u16; LANES];
        for ((q, to), least) in from.iter().zip(&mut *to).zip(&mut least) {
            let begin = (BEFORE as i32 + q.shift - 1) as usize + at;
            let around = &q.paths[begin..begin + LANES + 2];
            let (below, same, above) = (lanes(around, 0), lanes(around, 1), lanes(around, 2));
            let step_away = each(each(below, above, u16::min), [step; LANES], u16::wrapping_add);
            let stay = each(each(same, step_away, u16::min), [q.least + q.jump; LANES], u16::min);
            let value = each(each(costs, stay, u16::wrapping_add), [q.least; LANES], u16::wrapping_sub);
            to[BEFORE + at..][..LANES].copy_from_slice(&value);
            total = each(total, value, u16::wrapping_add);
            *least = each(*least, each(value, others, |v, o| v | o), u16::min);
        }
        *sums = each(*sums, each(total, others, |t, o| t & !o), u16::wrapping_add);
    }
    for to in to {
        guard(to, count);
    }
    least.map(least_of)
}

type Lanes = [u16; LANES];

/// All bits of the lanes that do not belong to a pixel of which so many hypotheses are left.
const OTHERS: [Lanes; LANES + 1] = {
    let mut out = [[u16::MAX; LANES]; LANES + 1];
    let mut left = 0;
    while left <= LANES {
        let mut i = 0;
        while i < left {
            out[left][i] = 0;
            i += 1;
        }
        left += 1;
    }
    out
};

#[inline(always)]
fn lanes(values: &[u16], at: usize) -> Lanes {
    let mut out = [0; LANES];
    out.copy_from_slice(&values[at..at + LANES]);
    out
}

#[inline(always)]
fn widened(costs: &[u8; LANES]) -> Lanes {
    let mut out = [0; LANES];
    for i in 0..LANES {
        out[i] = u16::from(costs[i]);
    }
    out
}

#[inline(always)]
fn least_of(mut lanes: Lanes) -> u16 {
    for half in [LANES / 2, LANES / 4, LANES / 8] {
        for i in 0..half {
            lanes[i] = lanes[i].min(lanes[i + half]);
        }
    }
    lanes[0]
}

#[inline(always)]
fn each(a: Lanes, b: Lanes, f: impl Fn(u16, u16) -> u16) -> Lanes {
    let mut out = [0; LANES];
    for i in 0..LANES {
        out[i] = f(a[i], b[i]);
    }
    out
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

/// One path to a pixel that searches other heights than the previous one.
#[inline(always)]
fn extend_far(costs: &[u8], q: Previous<'_>, step: u16, paths: &mut [u16], sums: &mut [u16]) -> u16 {
    let n = costs.len() as i32;
    // Where hypothesis d of this pixel has d + shift within one step of the previous pixel's range.
    let first = (-1 - q.shift).clamp(0, n) as usize;
    let last = (q.count as i32 + 1 - q.shift).clamp(first as i32, n) as usize;
    let mut least = u16::MAX;
    for d in (0..first).chain(last..n as usize) {
        let l = u16::from(costs[d]) + q.jump;
        paths[d] = l;
        sums[d] += l;
        least = least.min(l);
    }
    if first < last {
        let len = last - first;
        let at = (first as i32 + q.shift + BEFORE as i32) as usize;
        let (below, same, above) = (&q.paths[at - 1..][..len], &q.paths[at..][..len], &q.paths[at + 1..][..len]);
        let (c, l, s) = (&costs[first..last], &mut paths[first..last], &mut sums[first..last]);
        let bound = q.least + q.jump;
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

    /// Neighbours that search quite other heights, nearly the same ones, and the same.
    #[test]
    fn equals_the_textbook_recurrence_with_ranges_that_differ() {
        for (lows, counts) in [(30, 24), (4, 24), (4, 3), (1, 1)] {
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
        let p = Penalties { step: 8, jump: 32, jump_at_edge: 32 };
        let edges = vec![0; width * height];
        let volume = Volume { width, height, low: &low, offsets: &offsets, costs: &flat, edges: &edges };
        let mut sums = Vec::new();
        aggregate(&volume, p, &mut sums);
        let expected: Vec<u32> = reference(width, height, &low, &counts, &costs, p).concat();
        let (own, behind) = sums.split_at(expected.len());
        assert_eq!(own.iter().map(|&s| u32::from(s)).collect::<Vec<_>>(), expected);
        assert_eq!(behind, [0; LANES]);
    }
}
