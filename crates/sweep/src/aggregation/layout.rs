//! Layout of one row of path costs in memory, and what is known of each of its pixels.

/// Path cost of heights that a pixel does not search.
///
/// A path that comes from such a height is dearer than a jump, so that the jump is taken. A true
/// path cost is 255 only where the worst cost and the penalty of a jump exceed it together.
pub(super) const FAR: u8 = u8::MAX;

/// Longest vector, bytes: most hypotheses that are worked on together. Most pixels need half of it.
pub(crate) const LANES: usize = 32;

/// Guard entries between the path costs of two pixels.
///
/// A neighbour whose range ends up to `GUARD − 1` hypotheses inside a pixel's range is read in
/// place.
pub(super) const GUARD: usize = 8;

/// Pixels whose links to their neighbours are worked out together.
pub(super) const RUN: usize = 64;

/// Largest distance of a pixel's first hypothesis from 0. The difference of two such numbers fits
/// 32 bits, climbs included.
pub(crate) const FARTHEST: u32 = 1 << 29;

/// Input of one row of pixels, from left to right.
#[derive(Clone, Copy)]
pub(crate) struct RowPixels<'a> {
    /// First hypothesis of each pixel.
    pub(crate) low: &'a [i32],
    /// Hypothesis at which a steep surface is expected at each pixel
    /// ([`crate::ranges::Ranges::steep`]).
    pub(crate) steep: &'a [i32],
    /// Index of each pixel's first cost, and of the next row's.
    pub(crate) offsets: &'a [u32],
    /// Strength of the image edge at each pixel, 0 to 255.
    pub(crate) edges: &'a [u8],
}

/// Path costs of one row along the three directions that come from the row before.
///
/// `paths` holds the directions one after the other, [`PathRow::direction_stride`] bytes each. The
/// pixels follow each other in the order of computation (left to right forward, right to left
/// backward), each with one byte per hypothesis:
///
/// ```text
///            start[1]        start[2]                        start[width]
///            v               v                               v
/// +-------+--------+-------+----------+-------+-- ... --+-------+--------+-------+-----------+
/// | guard | pixel  | guard | pixel    | guard |         | guard | pixel  | guard | overhang  |
/// | 8 FAR | n₁     | 8 FAR | n₂       | 8 FAR |         | 8 FAR | n_w    | 8 FAR | 2 · LANES |
/// +-------+--------+-------+----------+-------+-- ... --+-------+--------+-------+-----------+
///  <------------------------------ direction_stride -------------------------------------->
/// ```
///
/// Vectors are written whole. The last one of a pixel overhangs into the guard behind it and into
/// the next pixel; the guard is written again when the pixel is complete, and the next pixel's
/// costs come later. Behind the last pixel the overhang takes what is too much.
///
/// A pixel reads a neighbour's costs from one height below its own first one to one above its last
/// one, as whole vectors. If its range exceeds the neighbour's by less than [`GUARD`] hypotheses at
/// either end, its own heights meet only the neighbour's costs and guards. The lanes behind its
/// last hypothesis read whatever lies there and do not count. Other neighbours are copied aside
/// first.
///
/// The vectors per pixel (`low`, `high`, …) are in the order of the image. They have one entry more
/// at either end, which stands for the pixels outside the image: a jump from there costs nothing.
/// They are filled up to whole [`RUN`]s.
#[derive(Default)]
pub(crate) struct PathRow {
    /// Path costs, as drawn above.
    pub(super) paths: Vec<u8>,
    /// Number of pixels.
    pub(super) width: usize,
    /// Number of hypotheses of all pixels.
    pub(super) count: usize,
    /// Largest number of hypotheses of a pixel.
    pub(super) most: usize,
    /// First hypothesis of each pixel.
    pub(super) low: Vec<i32>,
    /// Hypothesis after the last one of each pixel.
    pub(super) high: Vec<i32>,
    /// Hypothesis at which a steep surface is expected at each pixel.
    pub(super) steep: Vec<i32>,
    /// Index of each pixel's path costs within a direction.
    pub(super) start: Vec<i32>,
    /// Penalty of a jump at each pixel. Between two pixels the lower penalty counts.
    pub(super) jump: Vec<u8>,
    /// Least path costs of each pixel: along the row, then along the three other directions.
    pub(super) least: Vec<[u8; 4]>,
}

impl PathRow {
    /// Lays out a row of pixels, the last one first if `backward`. `jump` maps the strength of an
    /// edge to the penalty of a jump.
    ///
    /// # Panics
    /// Panics if the slices do not fit each other, if a pixel has no hypothesis or one farther than
    /// [`FARTHEST`], or if the row needs more than 2²⁹ bytes.
    #[inline(always)]
    pub(crate) fn place(&mut self, pixels: RowPixels<'_>, backward: bool, jump: impl Fn(u8) -> u8) {
        let RowPixels { low, steep, offsets, edges } = pixels;
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
        assert!(fewest > 0, "a pixel has {fewest} hypotheses");
        assert!(
            farthest <= FARTHEST,
            "a pixel's hypotheses begin at {farthest}, at most {FARTHEST} from 0 are allowed"
        );
        (self.count, self.most) = (end.wrapping_sub(first) as usize, most as usize);
        let len = self.count + GUARD * (width + 1) + 2 * LANES;
        assert!(len < i32::MAX as usize / 4, "a row has {len} path costs");
        let guard = GUARD as i32;
        for ((start, pixel), (from, to)) in self.start[1..=width].iter_mut().zip(0..).zip(from.iter().zip(to)) {
            *start = if backward {
                end.wrapping_sub(*to) as i32 + guard * (width as i32 - pixel)
            } else {
                from.wrapping_sub(first) as i32 + guard * (pixel + 1)
            };
        }
        for per_pixel in [&mut self.low, &mut self.high, &mut self.steep, &mut self.start] {
            (per_pixel[0], per_pixel[width + 1]) = (per_pixel[1], per_pixel[width]);
        }
        (self.jump[0], self.jump[width + 1]) = (0, 0);
        (self.least[0], self.least[width + 1]) = ([0; 4], [0; 4]);
        if self.direction_stride() < len {
            self.paths.resize(3 * len, FAR);
        }
        let stride = self.direction_stride();
        (0..3).for_each(|d| self.paths[d * stride..][..GUARD].fill(FAR));
    }

    fn resize(&mut self, width: usize) {
        let entries = width.next_multiple_of(RUN) + 2;
        for per_pixel in [&mut self.low, &mut self.high, &mut self.steep, &mut self.start] {
            per_pixel.resize(entries, 0);
        }
        self.jump.resize(entries, 0);
        self.least.resize(entries, [0; 4]);
        self.width = width;
    }

    /// Returns the heights that the pixel of an entry searches.
    #[inline(always)]
    pub(super) fn range(&self, entry: usize) -> HypothesisRange {
        HypothesisRange { low: self.low[entry], high: self.high[entry] }
    }

    /// Returns the number of bytes from one direction to the next.
    pub(super) fn direction_stride(&self) -> usize {
        self.paths.len() / 3
    }
}

/// Hypotheses `low..high` of a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct HypothesisRange {
    pub(super) low: i32,
    pub(super) high: i32,
}

impl HypothesisRange {
    /// Returns the number of hypotheses.
    #[inline(always)]
    pub(super) fn count(self) -> usize {
        self.high.wrapping_sub(self.low) as usize
    }

    /// Returns the range raised by a climb.
    #[inline(always)]
    pub(super) fn climbed(self, by: i32) -> Self {
        Self { low: self.low.wrapping_add(by), high: self.high.wrapping_add(by) }
    }

    /// Returns by how many hypotheses the range exceeds another one, at the end where that is more.
    #[inline(always)]
    pub(super) fn excess_over(self, other: Self) -> i32 {
        other.low.wrapping_sub(self.low).max(self.high.wrapping_sub(other.high))
    }
}
