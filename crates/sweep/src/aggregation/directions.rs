//! The aggregation over eight directions: four on the way down, four on the way up.

use super::block::VolumeBlock;
use super::layout::{LANES, PathRow, RowPixels};
use super::penalties::{Penalties, jump_penalty};
use super::row::{RowResults, RowScratch, RowTask, extend_row};
use super::row_sums::RowSums;
#[cfg(target_arch = "x86_64")]
use crate::simd::Avx2;
use crate::simd::{Arrays, Instructions, Kernel};

/// Sums the path costs over eight directions and hands every row to `read`, the last row first.
///
/// `forward` is a scratch buffer for what the first four directions add.
pub(crate) fn aggregate(
    block: &VolumeBlock<'_>,
    penalties: Penalties,
    forward: &mut Vec<u8>,
    read: impl FnMut(usize, RowSums<'_>),
) {
    aggregate_with(block, penalties, forward, extend_row_fast, read);
}

/// [`aggregate`] with a given function for a row.
fn aggregate_with(
    block: &VolumeBlock<'_>,
    penalties: Penalties,
    forward: &mut Vec<u8>,
    extend_row: fn(RowKernel<'_>),
    mut read: impl FnMut(usize, RowSums<'_>),
) {
    if block.low.is_empty() {
        return;
    }
    if forward.len() < block.costs.len() {
        forward.resize(block.costs.len(), 0);
    }
    let mut pass = Pass::new(block, penalties, false, extend_row);
    for y in 0..block.height {
        let first = block.row_offsets(y)[0] as usize;
        pass.extend(block, y, RowResults::Forward(&mut forward[first..]));
    }
    let mut pass = Pass::new(block, penalties, true, extend_row);
    let mut sums = vec![0; block.row_capacity() + LANES];
    for y in (0..block.height).rev() {
        let first = block.row_offsets(y)[0] as usize;
        pass.extend(block, y, RowResults::Backward(&forward[first..], &mut sums));
        read(y, RowSums::new(&sums, block.row_offsets(y)));
    }
}

/// Extension of four paths to one row.
struct RowKernel<'a> {
    above: &'a PathRow,
    here: &'a mut PathRow,
    pixels: RowPixels<'a>,
    penalties: Penalties,
    task: RowTask<'a>,
    scratch: &'a mut RowScratch,
}

impl<I: Instructions> Kernel<I> for RowKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, token: I) {
        let Self { above, here, pixels, penalties, task, scratch } = self;
        extend_row(token, above, here, pixels, |edge| jump_penalty(penalties, edge), task, scratch);
    }
}

/// Runs the kernel with the best instructions of the machine.
fn extend_row_fast(kernel: RowKernel<'_>) {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = Avx2::detect() {
        return avx2.run(kernel);
    }
    extend_row_plain(kernel);
}

/// Runs the kernel with arrays.
fn extend_row_plain(kernel: RowKernel<'_>) {
    kernel.run(Arrays);
}

/// A pass over the rows along four of the eight directions: from the left and from the three pixels
/// above, or from the right and from the three pixels below.
struct Pass {
    penalties: Penalties,
    above: PathRow,
    here: PathRow,
    scratch: RowScratch,
    extend_row: fn(RowKernel<'_>),
}

impl Pass {
    fn new(block: &VolumeBlock<'_>, penalties: Penalties, backward: bool, extend_row: fn(RowKernel<'_>)) -> Self {
        let (above, mut here) = (PathRow::default(), PathRow::default());
        here.place(block.row(if backward { block.height - 1 } else { 0 }), backward, |_| 0);
        Self { penalties, above, here, scratch: RowScratch::default(), extend_row }
    }

    /// Extends the paths to the next row.
    fn extend(&mut self, block: &VolumeBlock<'_>, y: usize, results: RowResults<'_>) {
        std::mem::swap(&mut self.above, &mut self.here);
        let pixels = block.row(y);
        let task = RowTask { costs: &block.costs[pixels.offsets[0] as usize..], step: self.penalties.step, results };
        let Self { penalties, above, here, scratch, extend_row } = self;
        extend_row(RowKernel { above, here, pixels, penalties: *penalties, task, scratch });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ranges::{CLIMB_MAX, NOT_STEEP};
    use crate::testing::random::random;

    /// The recurrence as the module states it, without vectors or guards. Path costs are cut at
    /// 255. The share of the directions of the forward pass is rounded up to an even number.
    fn reference(volume: &VolumeBlock<'_>, costs: &[Vec<u8>], p: Penalties) -> Vec<Vec<u32>> {
        let VolumeBlock { width, height, low, steep, edges, .. } = *volume;
        let counts: Vec<usize> = costs.iter().map(Vec::len).collect();
        let mut sums: [Vec<Vec<u32>>; 2] = std::array::from_fn(|_| counts.iter().map(|&n| vec![0; n]).collect());
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
                        let both = steep[q] != NOT_STEEP && steep[at] != NOT_STEEP;
                        let climb = if both { steep[at] - steep[q] } else { 0 };
                        let k = low[at] + d as i32 - if climb.abs() <= CLIMB_MAX { climb } else { 0 };
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
                    let sums = &mut sums[usize::from(dy < 0 || (dy == 0 && dx < 0))][at];
                    let added = row.iter().zip(&costs[at]).map(|(l, c)| l - u32::from(*c));
                    sums.iter_mut().zip(added).for_each(|(sum, added)| *sum += added);
                    paths[at] = row;
                }
            }
        }
        let [above, below] = sums;
        let pixel = |at: usize| {
            let added = above[at].iter().zip(&below[at]).map(|(a, b)| a.next_multiple_of(2) + b);
            added.zip(&costs[at]).map(|(added, c)| added + 8 * u32::from(*c)).collect()
        };
        (0..width * height).map(pixel).collect()
    }

    /// Neighbours search quite different heights, nearly the same ones, or the same.
    #[test]
    fn equals_the_textbook_recurrence_with_ranges_that_differ() {
        let all = [(30, 24), (300, 90), (4, 24), (4, 3), (1, 1), (60, 12), (3, 70)];
        // Miri takes minutes for all of them.
        for (lows, counts) in all.into_iter().take(if cfg!(miri) { 2 } else { all.len() }) {
            let mut random = random();
            let mut range = || (random(lows) as i32 - 10, 7 + random(counts) as usize);
            let each: Vec<(i32, usize)> = (0..9 * 7).map(|_| range()).collect();
            compare_with_the_recurrence((9, 7), |x, y| each[9 * y + x]);
            // Squares of pixels search the same heights, as the pixels below one coarser pixel do.
            // The row is longer than a run of links.
            let columns = if cfg!(miri) { 12 } else { 71 };
            compare_with_the_recurrence((columns, 5), |x, y| each[(x / 2 + 9 * (y / 2)) % each.len()]);
        }
    }

    #[test]
    fn equals_the_textbook_recurrence_with_ranges_that_are_the_same() {
        let (columns, counts) =
            if cfg!(miri) { (26, &[17, 65, 97][..]) } else { (70, &[1, 7, 16, 17, 32, 33, 64, 65, 97, 130][..]) };
        for &count in counts {
            compare_with_the_recurrence((columns, 4), |_, _| (-3, count));
            // The range moves up and down, and shrinks at one end more than at the other.
            compare_with_the_recurrence((columns, 4), |x, _| if x / 20 == 1 { (4, count) } else { (-3, count + 9) });
            compare_with_the_recurrence((12, 6), |_, y| if y < 3 { (-3, count) } else { (6, count) });
        }
    }

    #[test]
    #[should_panic(expected = "hypotheses begin at 1073741824")]
    fn absurd_heights_are_refused() {
        compare_with_the_recurrence((9, 7), |x, _| (if x == 3 { 1 << 30 } else { 0 }, 7));
    }

    type ExtendRow = fn(RowKernel<'_>);

    const ROWS: [(&str, ExtendRow); 2] =
        [("the machine's instructions", extend_row_fast), ("arrays", extend_row_plain)];

    /// `range` returns the first hypothesis of a pixel and how many it has.
    fn compare_with_the_recurrence((width, height): (usize, usize), range: impl Fn(usize, usize) -> (i32, usize)) {
        let mut random = random();
        let (low, counts): (Vec<i32>, Vec<usize>) = (0..width * height).map(|i| range(i % width, i / width)).unzip();
        let costs: Vec<Vec<u8>> = counts.iter().map(|&n| (0..n).map(|_| random(128) as u8).collect()).collect();
        let mut offsets = vec![0u32];
        counts.iter().for_each(|&n| offsets.push(offsets[offsets.len() - 1] + n as u32));
        let flat: Vec<u8> = [costs.concat(), vec![0; LANES]].concat();
        let p = Penalties { step: 30, jump: 125, jump_at_edge: 60 };
        let edges: Vec<u8> = (0..width * height).map(|_| random(256) as u8).collect();
        // A surface climbs to the right and upwards, breaks off at column 5, and is not steep here
        // and there.
        let climbing = |i: usize| {
            let (x, y) = ((i % width) as i32, (i / width) as i32);
            if random(9) > 0 { x - 2 * y + if x > 5 { 10 } else { 0 } } else { NOT_STEEP }
        };
        let climbing = (0..width * height).map(climbing).collect();
        for steep in [vec![NOT_STEEP; width * height], climbing] {
            let volume =
                VolumeBlock { width, height, low: &low, steep: &steep, offsets: &offsets, costs: &flat, edges: &edges };
            let expected = reference(&volume, &costs, p);
            for (name, extend_row) in ROWS {
                let mut sums = vec![Vec::new(); width * height];
                aggregate_with(&volume, p, &mut Vec::new(), extend_row, |y, row| {
                    (0..width).for_each(|x| sums[y * width + x] = row.pixel(x).iter().map(|&s| u32::from(s)).collect());
                });
                for (at, (sums, expected)) in sums.iter().zip(&expected).enumerate() {
                    let (x, y) = (at % width, at / width);
                    assert_eq!(sums, expected, "{name}, ({x}, {y}) of {width} x {height}, {} first heights", low[at]);
                }
            }
        }
    }

    /// Only every fifth pixel has texture: the pixels between follow the surface that is expected.
    #[test]
    fn a_steep_surface_is_followed_where_it_is_expected() {
        let (width, height, count) = (24, 3, 40);
        let (low, edges) = (vec![0; width * height], vec![0; width * height]);
        let offsets: Vec<u32> = (0..=(width * height) as u32).map(|i| i * count).collect();
        let tells = |i: usize, k: u32| if i % width % 5 == 2 && k as usize != i % width + 4 { 100 } else { 0 };
        let costs = (0..width * height).flat_map(|i| (0..count).map(move |k| tells(i, k)));
        let costs: Vec<u8> = costs.chain([0; LANES]).collect();
        let followed = |steep: &[i32]| {
            let volume =
                VolumeBlock { width, height, low: &low, steep, offsets: &offsets, costs: &costs, edges: &edges };
            let mut right = 0;
            aggregate(&volume, Penalties::default(), &mut Vec::new(), |_, row| {
                let best = |x: usize| row.pixel(x).iter().enumerate().min_by_key(|(_, sum)| **sum).map(|(k, _)| k);
                right += (0..width).filter(|x| best(*x) == Some(x + 4)).count();
            });
            right
        };
        let climbing: Vec<i32> = (0..width * height).map(|i| (i % width) as i32).collect();
        assert_eq!(followed(&climbing), width * height);
        assert!(followed(&vec![NOT_STEEP; width * height]) < width * height / 2);
    }
}
