//! Rows of pixels with the path costs that lead to them: where they lie, and what the next row has to know of them.
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

/// Path costs of one row along the three directions from the row before, in the order in which they are computed. What is said
/// of each pixel has one entry more at either end, at which nothing has a cost.
#[derive(Default)]
pub(crate) struct Row {
    /// One direction after the other, as many entries each.
    pub(super) paths: Vec<u8>,
    /// All hypotheses, and the most of a pixel.
    pub(super) count: usize,
    pub(super) most: usize,
    /// Each pixel's first hypothesis, and the one behind its last.
    pub(super) low: Vec<i32>,
    pub(super) high: Vec<i32>,
    /// Where its path costs are: as far on from here as the first hypothesis is from 0.
    pub(super) base: Vec<i32>,
    /// The penalty of a jump at it; between two pixels it is the lower one of theirs.
    pub(super) jump: Vec<u8>,
    /// The least path costs: of the path along the row, and of the three from the row before.
    pub(super) least: Vec<[u8; 4]>,
}

impl Row {
    /// Makes room for the pixels, each with its first hypothesis, its number of them, and its penalty of a jump.
    ///
    /// # Panics
    /// Fewer pixels than `width`, or more hypotheses than a row can have.
    #[inline(always)]
    pub(crate) fn place(&mut self, width: usize, pixels: impl Iterator<Item = (i32, usize, u8)>) {
        for entries in [&mut self.low, &mut self.high, &mut self.base] {
            entries.resize(width + 2, 0);
        }
        self.jump.resize(width + 2, 0);
        self.least.resize(width + 2, [0; 4]);
        let (mut place, mut placed, mut most) = (GUARD, 0, 0);
        let entries = self.low[1..=width].iter_mut().zip(&mut self.high[1..=width]);
        let entries = entries.zip(&mut self.base[1..=width]).zip(&mut self.jump[1..=width]);
        for ((((low, high), base), jump), pixel) in entries.zip(pixels) {
            let count = pixel.1;
            (*low, *high, *jump) = (pixel.0, pixel.0.wrapping_add(count as i32), pixel.2);
            *base = (place as i32).wrapping_sub(pixel.0);
            place += count + GUARD;
            placed += 1;
            most = most.max(count);
        }
        assert!(placed == width && place < i32::MAX as usize / 4, "{placed} of {width} pixels, {place} entries");
        (self.count, self.most) = (place - GUARD * (width + 1), most);
        for entries in [&mut self.low, &mut self.high, &mut self.base] {
            (entries[0], entries[width + 1]) = (entries[1], entries[width]);
        }
        // A register that overhangs and two more; guards reach as far.
        if self.apart() < place + 2 * LANES {
            self.paths.resize(3 * (place + 2 * LANES), FAR);
        }
        let apart = self.apart();
        (0..3).for_each(|d| self.paths[d * apart..][..GUARD].fill(FAR));
    }

    /// From the path costs of one direction to those of the next.
    pub(super) fn apart(&self) -> usize {
        self.paths.len() / 3
    }
}

/// What pixels of a row have to do with those before them, and room for single pixels' path costs.
#[derive(Default)]
pub(crate) struct Between {
    /// The penalties of a jump, along the row and from the three pixels of the row before.
    pub(super) jumps: [Vec<u8>; 4],
    /// By how many heights at most a pixel searches beyond those of one of the three in the row before.
    pub(super) beyond: Vec<i32>,
    pub(super) along: [Vec<u8>; 2],
    pub(super) aside: [Vec<u8>; 4],
}

impl Between {
    #[inline(always)]
    pub(super) fn prepare(&mut self, above: &Row, here: &Row) {
        let width = here.low.len() - 2;
        self.beyond.clear();
        self.beyond.resize(width, i32::MIN);
        let (low, high) = (&here.low[1..=width], &here.high[1..=width]);
        for d in 0..3 {
            let (q_low, q_high) = (&above.low[d..][..width], &above.high[d..][..width]);
            for (j, beyond) in self.beyond.iter_mut().enumerate() {
                *beyond = (*beyond).max(q_low[j].wrapping_sub(low[j])).max(high[j].wrapping_sub(q_high[j]));
            }
        }
        let own = &here.jump[1..=width];
        let others = [&here.jump[..width], &above.jump[..width], &above.jump[1..=width], &above.jump[2..]];
        for (jumps, other) in self.jumps.iter_mut().zip(others) {
            jumps.resize(width, 0);
            jumps.iter_mut().zip(own.iter().zip(other)).for_each(|(jump, (a, b))| *jump = *a.min(b));
        }
        let len = here.most + 5 * LANES;
        let short = self.along.iter_mut().chain(&mut self.aside).filter(|room| room.len() < len);
        short.for_each(|room| room.resize(len, FAR));
        self.along.iter_mut().for_each(|room| room[..LANES].fill(FAR));
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

    /// By how many heights a pixel searches beyond another's.
    #[inline(always)]
    pub(super) fn beyond(self, other: Self) -> i32 {
        other.low.wrapping_sub(self.low).max(self.high.wrapping_sub(other.high))
    }
}
