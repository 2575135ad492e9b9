//! Rows of pixels with the path costs that lead to them: where they lie, and what pixels have to do with those before them.
//!
//! Between the path costs of two pixels lie [`GUARD`] entries that are [`FAR`], so that those of pixels that search nearly the
//! same heights are read in place.

/// The cost of heights that a pixel does not search. Others reach it only where the worst cost and the penalty of a jump do
/// together, and are cut.
pub(super) const FAR: u8 = u8::MAX;
/// Most hypotheses that are worked on together, a vector register of bytes; most pixels need half of it.
pub(crate) const LANES: usize = 32;
/// Entries between the path costs of two pixels: a neighbour that searches this many heights less one beyond them finds its
/// own in place.
pub(super) const GUARD: usize = 8;
/// Pixels whose links are worked out together.
pub(super) const RUN: usize = 64;
/// How far from 0 a pixel's hypotheses may begin: two pixels' differ by what 32 bits hold.
pub(crate) const FARTHEST: u32 = 1 << 29;

/// The pixels of a row, from left to right.
#[derive(Clone, Copy)]
pub(crate) struct Pixels<'a> {
    /// First hypothesis of each.
    pub(crate) low: &'a [i32],
    /// Where a steep surface is expected at each ([`crate::ranges::Ranges::steep`]).
    pub(crate) steep: &'a [i32],
    /// Where the costs of each begin, and those of the next row.
    pub(crate) offsets: &'a [u32],
    /// Strength of the edge at each.
    pub(crate) edges: &'a [u8],
}

/// Path costs of one row along the three directions from the row before, in the order in which they are computed. What is said
/// of each pixel is in the order of the image, with one entry more at either end, at which nothing has a cost, and room for
/// whole [`RUN`]s.
#[derive(Default)]
pub(crate) struct Row {
    /// One direction after the other, as many entries each.
    pub(super) paths: Vec<u8>,
    pub(super) width: usize,
    /// All hypotheses, and the most of a pixel.
    pub(super) count: usize,
    pub(super) most: usize,
    /// Each pixel's first hypothesis, and the one behind its last.
    pub(super) low: Vec<i32>,
    pub(super) high: Vec<i32>,
    /// Where a steep surface is expected at it.
    pub(super) steep: Vec<i32>,
    /// Where its path costs are.
    pub(super) place: Vec<i32>,
    /// The penalty of a jump at it; between two pixels it is the lower one of theirs.
    pub(super) jump: Vec<u8>,
    /// The least path costs: of the path along the row, and of the three from the row before.
    pub(super) least: Vec<[u8; 4]>,
}

impl Row {
    /// Makes room for the pixels, `backward` for the last one first; `jump` is the penalty of a jump by the edge.
    ///
    /// # Panics
    /// Slices of different lengths, a pixel without hypotheses or with those of absurd heights, or more of them than a row can have.
    #[inline(always)]
    pub(crate) fn place(&mut self, pixels: Pixels<'_>, backward: bool, jump: impl Fn(u8) -> u8) {
        let Pixels { low, steep, offsets, edges } = pixels;
        let width = low.len();
        assert!(width > 0 && offsets.len() == width + 1 && edges.len() == width && steep.len() == width);
        self.resize(width);
        self.low[1..=width].copy_from_slice(low);
        self.steep[1..=width].copy_from_slice(steep);
        self.jump[1..=width].iter_mut().zip(edges).for_each(|(to, edge)| *to = jump(*edge));
        let (first, end) = (offsets[0], offsets[width]);
        let (from, to) = (&offsets[..width], &offsets[1..]);
        let high = self.high[1..=width].iter_mut().zip(low);
        let (mut fewest, mut most, mut farthest) = (i32::MAX, 0, 0);
        for ((high, low), (from, to)) in high.zip(from.iter().zip(to)) {
            let count = to.wrapping_sub(*from) as i32;
            (fewest, most, farthest) = (count.min(fewest), count.max(most), low.unsigned_abs().max(farthest));
            *high = low.wrapping_add(count);
        }
        assert!(fewest > 0, "a pixel of {fewest} hypotheses");
        assert!(farthest <= FARTHEST, "hypotheses that begin at {farthest}");
        (self.count, self.most) = (end.wrapping_sub(first) as usize, most as usize);
        // A register that overhangs and two more; guards reach as far.
        let len = self.count + GUARD * (width + 1) + 2 * LANES;
        assert!(len < i32::MAX as usize / 4, "{len} entries");
        let guard = GUARD as i32;
        for ((place, pixel), (from, to)) in self.place[1..=width].iter_mut().zip(0..).zip(from.iter().zip(to)) {
            *place = if backward {
                end.wrapping_sub(*to) as i32 + guard * (width as i32 - pixel)
            } else {
                from.wrapping_sub(first) as i32 + guard * (pixel + 1)
            };
        }
        for of_each in [&mut self.low, &mut self.high, &mut self.steep, &mut self.place] {
            (of_each[0], of_each[width + 1]) = (of_each[1], of_each[width]);
        }
        (self.jump[0], self.jump[width + 1]) = (0, 0);
        (self.least[0], self.least[width + 1]) = ([0; 4], [0; 4]);
        if self.apart() < len {
            self.paths.resize(3 * len, FAR);
        }
        let apart = self.apart();
        (0..3).for_each(|d| self.paths[d * apart..][..GUARD].fill(FAR));
    }

    fn resize(&mut self, width: usize) {
        let entries = width.next_multiple_of(RUN) + 2;
        for of_each in [&mut self.low, &mut self.high, &mut self.steep, &mut self.place] {
            of_each.resize(entries, 0);
        }
        self.jump.resize(entries, 0);
        self.least.resize(entries, [0; 4]);
        self.width = width;
    }

    /// What the pixel of an entry searches.
    #[inline(always)]
    pub(super) fn range(&self, entry: usize) -> Range {
        Range { low: self.low[entry], high: self.high[entry] }
    }

    /// From the path costs of one direction to those of the next.
    pub(super) fn apart(&self) -> usize {
        self.paths.len() / 3
    }
}

/// A pixel's first hypothesis, and the one behind its last.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Range {
    pub(super) low: i32,
    pub(super) high: i32,
}

impl Range {
    #[inline(always)]
    pub(super) fn count(self) -> usize {
        self.high.wrapping_sub(self.low) as usize
    }

    #[inline(always)]
    pub(super) fn climbed(self, by: i32) -> Self {
        Self { low: self.low.wrapping_add(by), high: self.high.wrapping_add(by) }
    }

    /// By how many heights a pixel searches beyond another's.
    #[inline(always)]
    pub(super) fn beyond(self, other: Self) -> i32 {
        other.low.wrapping_sub(self.low).max(self.high.wrapping_sub(other.high))
    }
}
