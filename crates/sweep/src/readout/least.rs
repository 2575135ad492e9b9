//! The least of a pixel's aggregated costs, and the least outside a window of them.

#![allow(unsafe_code)]

use crate::simd::Arrays;

/// Words that are read at once. As many others must follow a pixel's sums.
pub(crate) const WORDS: usize = 16;

/// A token whose instructions search the sums of a pixel.
pub(crate) trait LeastSum: Copy {
    /// Returns the least of the first `count` sums and the first place where it is.
    ///
    /// # Panics
    /// May panic if `count` is 0 or above 65,535, or if fewer than [`WORDS`] entries follow.
    fn least(self, sums: &[u16], count: usize) -> (u16, usize);

    /// Returns the least of the first `count` sums outside `from..to`, or [`u16::MAX`] if there is
    /// none.
    ///
    /// # Panics
    /// May panic if the window is not inside `0..count`, if `count` is above 65,535, or if fewer
    /// than [`WORDS`] entries follow.
    fn least_outside(self, sums: &[u16], count: usize, from: usize, to: usize) -> u16;
}

impl LeastSum for Arrays {
    #[inline(always)]
    fn least(self, sums: &[u16], count: usize) -> (u16, usize) {
        let first = |best: (u16, usize), (place, sum): (usize, &u16)| if *sum < best.0 { (*sum, place) } else { best };
        sums[..count].iter().enumerate().fold((u16::MAX, 0), first)
    }

    #[inline(always)]
    fn least_outside(self, sums: &[u16], count: usize, from: usize, to: usize) -> u16 {
        sums[..from].iter().chain(&sums[to..count]).copied().fold(u16::MAX, u16::min)
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use super::{LeastSum, WORDS};
    use crate::simd::Avx2;

    impl LeastSum for Avx2 {
        #[inline(always)]
        fn least(self, sums: &[u16], count: usize) -> (u16, usize) {
            assert!(sums.len() >= count + WORDS && (1..=usize::from(u16::MAX)).contains(&count));
            // SAFETY: `self` proves that the machine has AVX2. Registers are read from places below
            // `count` on, and `WORDS` entries follow the first `count`. `behind` gets `count - at`,
            // which is between 1 and `WORDS` after the first loop.
            unsafe {
                let mut least = _mm256_set1_epi16(-1);
                let mut at = 0;
                while at + WORDS < count {
                    least = _mm256_min_epu16(least, load(self, sums, at));
                    at += WORDS;
                }
                let last = _mm256_or_si256(load(self, sums, at), behind(self, count - at));
                let least = _mm256_min_epu16(least, last);
                let least = least_lane(self, least);
                let mut at = 0;
                loop {
                    let same = _mm256_cmpeq_epi16(load(self, sums, at), _mm256_set1_epi16(least as i16));
                    let bits = _mm256_movemask_epi8(same) as u32;
                    at += WORDS;
                    if bits != 0 || at >= count {
                        break (least, at - WORDS + bits.trailing_zeros() as usize / 2);
                    }
                }
            }
        }

        #[inline(always)]
        fn least_outside(self, sums: &[u16], count: usize, from: usize, to: usize) -> u16 {
            assert!(sums.len() >= count + WORDS && from <= to && to <= count && count <= usize::from(u16::MAX));
            // SAFETY: `self` proves that the machine has AVX2. Registers are read from places up to
            // `count` on, and `WORDS` entries follow the first `count`. `behind` gets `count - at`,
            // which is at most `WORDS`.
            unsafe {
                let (all, window) = (_mm256_set1_epi16(-1), splat(self, to - from));
                let mut least = all;
                // Places relative to the window. Those before it wrap around to large numbers.
                let mut place = _mm256_sub_epi16(lanes(self), splat(self, from));
                let mut at = 0;
                loop {
                    let is_outside = _mm256_cmpeq_epi16(_mm256_min_epu16(place, window), window);
                    let seen = _mm256_blendv_epi8(all, load(self, sums, at), is_outside);
                    if at + WORDS >= count {
                        least = _mm256_min_epu16(least, _mm256_or_si256(seen, behind(self, count - at)));
                        break;
                    }
                    least = _mm256_min_epu16(least, seen);
                    place = _mm256_add_epi16(place, splat(self, WORDS));
                    at += WORDS;
                }
                least_lane(self, least)
            }
        }
    }

    #[inline(always)]
    fn splat(_: Avx2, number: usize) -> __m256i {
        // SAFETY: the token proves that the machine has the instruction.
        unsafe { _mm256_set1_epi16(number as i16) }
    }

    #[inline(always)]
    fn lanes(_: Avx2) -> __m256i {
        // SAFETY: the token proves that the machine has the instruction.
        unsafe { _mm256_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) }
    }

    /// Returns a mask that sets all bits in the lanes behind the first `count`.
    ///
    /// # Safety
    /// `count` is at most [`WORDS`].
    #[inline(always)]
    unsafe fn behind(_: Avx2, count: usize) -> __m256i {
        static BEHIND: [u16; 2 * WORDS] = {
            let mut out = [0; 2 * WORDS];
            let mut i = WORDS;
            while i < 2 * WORDS {
                out[i] = u16::MAX;
                i += 1;
            }
            out
        };
        // SAFETY: the token proves the instruction. The table has `2 * WORDS` entries, and the
        // register begins at `WORDS - count`, between 0 and `WORDS`.
        unsafe { _mm256_loadu_si256(BEHIND.as_ptr().add(WORDS - count).cast()) }
    }

    /// Reads a register.
    ///
    /// # Safety
    /// `sums` has [`WORDS`] entries from `at` on.
    #[inline(always)]
    unsafe fn load(_: Avx2, sums: &[u16], at: usize) -> __m256i {
        // SAFETY: the token proves the instruction, and the caller vouches for the entries.
        unsafe { _mm256_loadu_si256(sums.as_ptr().add(at).cast()) }
    }

    #[inline(always)]
    fn least_lane(_: Avx2, v: __m256i) -> u16 {
        // SAFETY: the token proves that the machine has the instructions.
        unsafe {
            let half = _mm_min_epu16(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
            _mm_cvtsi128_si32(_mm_minpos_epu16(half)) as u16
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: if cfg!(miri) { 4 } else { 256 }, ..ProptestConfig::default() })]

        #[test]
        fn registers_find_what_a_search_finds(
            sums in prop::collection::vec(prop_oneof![0..40u16, any::<u16>()], WORDS + 1..120),
            window in (0..200usize, 0..200usize),
        ) {
            let count = sums.len() - WORDS;
            let (from, to) = (window.0.min(window.1).min(count), window.0.max(window.1).min(count));
            let (least, place) = Arrays.least(&sums, count);
            let outside = Arrays.least_outside(&sums, count, from, to);
            let own = &sums[..count];
            prop_assert_eq!((Some(&least), Some(place)), (own.iter().min(), own.iter().position(|s| *s == least)));
            let others = own.iter().enumerate().filter(|(i, _)| !(from..to).contains(i)).map(|(_, s)| *s);
            prop_assert_eq!(outside, others.min().unwrap_or(u16::MAX));
            #[cfg(target_arch = "x86_64")]
            if let Some(avx2) = crate::simd::Avx2::detect() {
                prop_assert_eq!(avx2.least(&sums, count), (least, place));
                prop_assert_eq!(avx2.least_outside(&sums, count, from, to), outside);
            }
        }
    }
}
