//! Lanes of unsigned bytes, and what the path costs need of them: as an array on any machine, in registers in [`super::avx2`].

/// Lanes of unsigned bytes.
pub(crate) trait Bytes: Copy {
    /// How many.
    const LANES: usize;
    fn splat(value: u8) -> Self;
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
    fn or(self, other: Self) -> Self;
    /// The lanes one further on, behind the last one of `before`.
    fn behind(self, before: Self) -> Self;
    /// The lanes one further back, and the first one of `next`.
    fn ahead(self, next: Self) -> Self;
    /// The least lane, in all of them.
    fn least(self) -> Self;
    /// The least lane of each of four.
    fn least_of_each(four: [Self; 4]) -> [u8; 4];
    /// Writes the sums of four.
    /// # Safety
    /// [`Self::LANES`] words can be written.
    unsafe fn sum(four: [Self; 4], to: *mut u16);
    /// Writes the sums of four and what `before` holds.
    /// # Safety
    /// [`Self::LANES`] words can be read and written.
    unsafe fn sum_with(four: [Self; 4], before: *const u16, to: *mut u16);
}

/// Sixteen lanes.
pub(crate) trait Half: Bytes {
    /// The lanes one less than `by` further back, `by`, and one more, and 255 where there are none.
    fn around(self, by: i32) -> [Self; 3];
}

/// As many lanes as a pixel's hypotheses are worked on at once, and half of them.
pub(crate) trait Instructions {
    type Narrow: Half;
    type Wide: Bytes;
    /// The first lane, in all of them.
    fn widened(first: Self::Narrow) -> Self::Wide;
    /// Half of the lanes.
    fn narrowed(all: Self::Wide) -> Self::Narrow;
}

/// Instructions of no machine in particular.
pub(crate) struct Anywhere;

impl Instructions for Anywhere {
    type Narrow = Plain<16>;
    type Wide = Plain<32>;

    #[inline(always)]
    fn widened(first: Plain<16>) -> Plain<32> {
        Plain::splat(first.0[0])
    }

    #[inline(always)]
    fn narrowed(all: Plain<32>) -> Plain<16> {
        Plain(std::array::from_fn(|i| all.0[i]))
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

    #[inline(always)]
    fn splat(value: u8) -> Self {
        Self([value; N])
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
    fn least(self) -> Self {
        Self::splat(self.0.iter().fold(u8::MAX, |least, v| least.min(*v)))
    }

    #[inline(always)]
    fn least_of_each(four: [Self; 4]) -> [u8; 4] {
        four.map(|v| v.least().0[0])
    }

    #[inline(always)]
    unsafe fn sum(four: [Self; 4], to: *mut u16) {
        let sums: [u16; N] = std::array::from_fn(|i| four.iter().map(|v| u16::from(v.0[i])).sum());
        // SAFETY: the caller vouches for the length, and that words begin at whole ones.
        unsafe { to.cast::<[u16; N]>().write(sums) }
    }

    #[inline(always)]
    unsafe fn sum_with(four: [Self; 4], before: *const u16, to: *mut u16) {
        // SAFETY: as above.
        let before = unsafe { before.cast::<[u16; N]>().read() };
        let sums: [u16; N] = std::array::from_fn(|i| before[i] + four.iter().map(|v| u16::from(v.0[i])).sum::<u16>());
        // SAFETY: as above.
        unsafe { to.cast::<[u16; N]>().write(sums) }
    }
}

impl Half for Plain<16> {
    #[inline(always)]
    fn around(self, by: i32) -> [Self; 3] {
        // Beyond its lanes there are none, however far.
        let by = by.clamp(-17, 17);
        [self.lanes_from(by - 1, u8::MAX), self.lanes_from(by, u8::MAX), self.lanes_from(by + 1, u8::MAX)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Everything that `V` can do with some bytes, and with the sums of some words and them.
    fn results<V: Bytes>(bytes: &[u8], words: &[u16]) -> (Vec<Vec<u8>>, Vec<Vec<u16>>, [u8; 4]) {
        let n = V::LANES;
        // SAFETY: as many as the lanes of a register.
        let load = |i: usize| unsafe { V::load(bytes[i * n..][..n].as_ptr()) };
        let four: [V; 4] = std::array::from_fn(load);
        let [a, b, c, d] = four;
        let made = [a.min(b), a.plus(b), a.minus(b), c.or(d), a.behind(b), a.ahead(b), a.least(), V::splat(bytes[0])];
        let stored = made.map(|v| {
            let mut out = vec![0; n];
            // SAFETY: as above.
            unsafe { v.store(out.as_mut_ptr()) };
            out
        });
        let (mut sums, mut more) = (vec![0; n], vec![0; n]);
        // SAFETY: as above; there are more words.
        unsafe {
            V::sum(four, sums.as_mut_ptr());
            V::sum_with(four, words[..n].as_ptr(), more.as_mut_ptr());
        }
        (stored.to_vec(), vec![sums, more], V::least_of_each(four))
    }

    /// The narrow register's lanes moved, and what becomes of them in a wide one.
    fn halves<I: Instructions>(bytes: &[u8], by: i32) -> [Vec<u8>; 5] {
        let mut out = [vec![0; 16], vec![0; 16], vec![0; 16], vec![0; 32], vec![0; 16]];
        // SAFETY: the slices are as long as the registers.
        unsafe {
            let narrow = I::Narrow::load(bytes[..16].as_ptr());
            narrow.around(by).iter().zip(&mut out).for_each(|(v, out)| v.store(out.as_mut_ptr()));
            I::widened(narrow).store(out[3].as_mut_ptr());
            I::narrowed(I::Wide::load(bytes[..32].as_ptr())).store(out[4].as_mut_ptr());
        }
        out
    }

    proptest! {
        #[test]
        fn registers_do_what_arrays_do(
            bytes in prop::collection::vec(any::<u8>(), 128),
            words in prop::collection::vec(0..60_000u16, 32),
            by in -40..40i32,
        ) {
            #[cfg(target_arch = "x86_64")]
            if std::is_x86_feature_detected!("avx2") {
                use crate::simd::avx2::{Avx2, Sixteen, ThirtyTwo};
                prop_assert_eq!(results::<Sixteen>(&bytes, &words), results::<Plain<16>>(&bytes, &words));
                prop_assert_eq!(results::<ThirtyTwo>(&bytes, &words), results::<Plain<32>>(&bytes, &words));
                prop_assert_eq!(halves::<Avx2>(&bytes, by), halves::<Anywhere>(&bytes, by));
            }
            let (stored, sums, least) = results::<Plain<16>>(&bytes, &words);
            prop_assert_eq!(stored[1][3], bytes[3].saturating_add(bytes[19]));
            prop_assert_eq!((stored[4][0], stored[4][5], stored[5][15]), (bytes[31], bytes[4], bytes[16]));
            let four: u16 = (0..4).map(|i| u16::from(bytes[16 * i + 5])).sum();
            prop_assert_eq!((sums[0][5], sums[1][5]), (four, words[5] + four));
            prop_assert_eq!(Some(least[2]), bytes[32..48].iter().min().copied());
            for (moved, by) in halves::<Anywhere>(&bytes, by).iter().zip(by - 1..=by + 1) {
                let at = usize::try_from(by + 4).ok().filter(|at| *at < 16);
                prop_assert_eq!(moved[4], at.map_or(u8::MAX, |at| bytes[at]));
            }
        }
    }
}
