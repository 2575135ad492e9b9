//! Lanes of unsigned bytes, and what the path costs need of them: as an array on any machine, in registers in [`super::avx2`].

/// Registers whose lanes are moved this far have none of them left.
pub(crate) const REACH: i32 = 33;

/// Lanes of unsigned bytes.
pub(crate) trait Bytes: Copy {
    /// How many.
    const LANES: usize;
    /// A byte where it is at hand for all lanes.
    type First: Copy;
    fn splat(value: u8) -> Self;
    fn splat_first(first: Self::First) -> Self;
    /// # Safety
    /// [`Self::LANES`] bytes can be read.
    unsafe fn load(from: *const u8) -> Self;
    /// # Safety
    /// [`Self::LANES`] bytes can be written.
    unsafe fn store(self, to: *mut u8);
    fn min(self, other: Self) -> Self;
    /// Sums, 255 where they are more.
    fn plus(self, other: Self) -> Self;
    /// Differences, 0 where they are less.
    fn minus(self, other: Self) -> Self;
    /// Halves of the sums, rounded up.
    fn average(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
    /// The lanes one further on, behind the last one of `before`.
    fn behind(self, before: Self) -> Self;
    /// The lanes one further back, and the first one of `next`.
    fn ahead(self, next: Self) -> Self;
    /// The lanes one less than `by` further back, `by`, and one more, and 255 where there are none.
    /// # Safety
    /// It is by no more than [`REACH`] either way.
    unsafe fn around(self, by: i32) -> [Self; 3];
    /// The first lane.
    fn first(self) -> Self::First;
    /// Writes the least lane of each of four, and returns the first one's.
    fn leasts(four: [Self; 4], to: &mut [u8; 4]) -> Self::First;
    /// Writes the sums of two, twice a third one, and eight times another one.
    /// # Safety
    /// [`Self::LANES`] words can be written.
    unsafe fn store_sums(eightfold: Self, twofold: Self, two: [Self; 2], to: *mut u16);
}

/// As many lanes as a pixel's hypotheses are worked on at once, and half of them.
pub(crate) trait Instructions {
    type First: Copy;
    type Half: Bytes<First = Self::First>;
    type One: Bytes<First = Self::First>;
    /// The lanes and as many of 255.
    fn one(half: Self::Half) -> Self::One;
    /// The first half of the lanes.
    fn half(one: Self::One) -> Self::Half;
}

/// Instructions of no machine in particular.
pub(crate) struct Anywhere;

impl Instructions for Anywhere {
    type First = u8;
    type Half = Plain<16>;
    type One = Plain<32>;

    #[inline(always)]
    fn one(half: Plain<16>) -> Plain<32> {
        Plain(std::array::from_fn(|i| half.0.get(i).copied().unwrap_or(u8::MAX)))
    }

    #[inline(always)]
    fn half(one: Plain<32>) -> Plain<16> {
        Plain(std::array::from_fn(|i| one.0[i]))
    }
}

/// Bytes as an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain<const N: usize>([u8; N]);

impl<const N: usize> Plain<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(u8, u8) -> u8) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    /// Lanes from `by` on; `outside` says what lies before and behind.
    #[inline(always)]
    fn lanes_from(self, by: i32, outside: u8) -> Self {
        Self(std::array::from_fn(|i| {
            usize::try_from(i as i32 + by).ok().and_then(|i| self.0.get(i)).copied().unwrap_or(outside)
        }))
    }
}

impl<const N: usize> Bytes for Plain<N> {
    const LANES: usize = N;
    type First = u8;

    #[inline(always)]
    fn splat(value: u8) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn splat_first(first: u8) -> Self {
        Self::splat(first)
    }

    #[inline(always)]
    unsafe fn load(from: *const u8) -> Self {
        // SAFETY: an array of bytes may lie anywhere; the caller vouches for its length.
        Self(unsafe { from.cast::<[u8; N]>().read() })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u8) {
        // SAFETY: as above.
        unsafe { to.cast::<[u8; N]>().write(self.0) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, u8::min)
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.zip(other, u8::saturating_add)
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.zip(other, u8::saturating_sub)
    }

    #[inline(always)]
    fn average(self, other: Self) -> Self {
        self.zip(other, |a, b| a.midpoint(b) + ((a ^ b) & 1))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.zip(other, |a, b| a | b)
    }

    #[inline(always)]
    fn behind(self, before: Self) -> Self {
        self.lanes_from(-1, before.0[N - 1])
    }

    #[inline(always)]
    fn ahead(self, next: Self) -> Self {
        self.lanes_from(1, next.0[0])
    }

    #[inline(always)]
    unsafe fn around(self, by: i32) -> [Self; 3] {
        [self.lanes_from(by - 1, u8::MAX), self.lanes_from(by, u8::MAX), self.lanes_from(by + 1, u8::MAX)]
    }

    #[inline(always)]
    fn first(self) -> u8 {
        self.0[0]
    }

    #[inline(always)]
    fn leasts(four: [Self; 4], to: &mut [u8; 4]) -> u8 {
        *to = four.map(|v| v.0.iter().fold(u8::MAX, |least, lane| least.min(*lane)));
        to[0]
    }

    #[inline(always)]
    unsafe fn store_sums(eightfold: Self, twofold: Self, [a, b]: [Self; 2], to: *mut u16) {
        let word = |v: Self, i: usize| u16::from(v.0[i]);
        let sum = |i: usize| 8 * word(eightfold, i) + 2 * word(twofold, i) + word(a, i) + word(b, i);
        // SAFETY: the caller vouches for the length, and that words begin at whole ones.
        unsafe { to.cast::<[u16; N]>().write(std::array::from_fn(sum)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Everything that `V` can do with some bytes.
    fn results<V: Bytes>(bytes: &[u8], by: i32) -> (Vec<Vec<u8>>, Vec<u16>, [u8; 4]) {
        let n = V::LANES;
        // SAFETY: as many as the lanes of a register.
        let load = |i: usize| unsafe { V::load(bytes[i * n..][..n].as_ptr()) };
        let four: [V; 4] = std::array::from_fn(load);
        let [a, b, c, d] = four;
        let mut leasts = [0; 4];
        let least = V::splat_first(V::leasts(four, &mut leasts));
        let made =
            [a.min(b), a.plus(b), a.minus(b), c.or(d), a.behind(b), a.ahead(b), V::splat(bytes[0]), a.average(b)];
        // SAFETY: the tests move no further.
        let moved = unsafe { a.around(by) };
        let all = made.into_iter().chain(moved).chain([V::splat_first(a.first()), least]);
        let stored = all.map(|v| {
            let mut out = vec![0; n];
            // SAFETY: as above.
            unsafe { v.store(out.as_mut_ptr()) };
            out
        });
        let mut sums = vec![0; n];
        // SAFETY: as above.
        unsafe { V::store_sums(a, b, [c, d], sums.as_mut_ptr()) };
        (stored.collect(), sums, leasts)
    }

    /// The first half of a register's lanes, and what becomes of one with as many.
    fn halves<I: Instructions>(bytes: &[u8]) -> (Vec<u8>, Vec<u8>) {
        let (mut half, mut one) = (vec![0; 16], vec![0; 32]);
        // SAFETY: the slices are as long as the registers.
        unsafe {
            I::half(I::One::load(bytes[..32].as_ptr())).store(half.as_mut_ptr());
            I::one(I::Half::load(bytes[..16].as_ptr())).store(one.as_mut_ptr());
        }
        (half, one)
    }

    proptest! {
        #[test]
        fn registers_do_what_arrays_do(bytes in prop::collection::vec(any::<u8>(), 128), by in -REACH..=REACH) {
            #[cfg(target_arch = "x86_64")]
            if std::is_x86_feature_detected!("avx2") {
                use crate::simd::avx2::{Avx2, Sixteen, ThirtyTwo};
                prop_assert_eq!(results::<Sixteen>(&bytes, by), results::<Plain<16>>(&bytes, by));
                prop_assert_eq!(results::<ThirtyTwo>(&bytes, by), results::<Plain<32>>(&bytes, by));
                prop_assert_eq!(halves::<Avx2>(&bytes), halves::<Anywhere>(&bytes));
            }
            let (stored, sums, leasts) = results::<Plain<16>>(&bytes, by);
            prop_assert_eq!(stored[1][3], bytes[3].saturating_add(bytes[19]));
            prop_assert_eq!((stored[4][0], stored[4][5], stored[5][15]), (bytes[31], bytes[4], bytes[16]));
            let [a, b, c, d] = [5, 21, 37, 53].map(|i| u16::from(bytes[i]));
            prop_assert_eq!((u16::from(stored[7][5]), sums[5]), ((a + b).div_ceil(2), 8 * a + 2 * b + c + d));
            for (four, least) in bytes.chunks(16).zip(leasts) {
                prop_assert_eq!(four.iter().min(), Some(&least));
            }
            prop_assert_eq!((stored[11][7], stored[12][7]), (bytes[0], leasts[0]));
            for (moved, by) in stored[8..11].iter().zip(by - 1..=by + 1) {
                let at = usize::try_from(by + 4).ok().filter(|at| *at < 16);
                prop_assert_eq!(moved[4], at.map_or(u8::MAX, |at| bytes[at]));
            }
        }
    }
}
