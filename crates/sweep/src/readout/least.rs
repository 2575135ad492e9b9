//! The least of a pixel's sums, and the least outside of a window of them.

#![allow(unsafe_code)]

/// Words that are read at once: a pixel's sums are followed by as many others.
pub(crate) const WORDS: usize = 16;

/// What is asked of a pixel's sums.
pub(crate) trait Sums {
    /// The least of the first `count`, at least one, and the first place where it is.
    ///
    /// # Panics
    /// Fewer than [`WORDS`] behind them.
    fn least(sums: &[u16], count: usize) -> (u16, usize);

    /// The least of the first `count` but those in `from..to`; the greatest number where there are none.
    ///
    /// # Panics
    /// As above.
    fn least_outside(sums: &[u16], count: usize, from: usize, to: usize) -> u16;
}

impl Sums for crate::simd::Anywhere {
    #[inline(always)]
    fn least(sums: &[u16], count: usize) -> (u16, usize) {
        let first = |best: (u16, usize), (place, sum): (usize, &u16)| if *sum < best.0 { (*sum, place) } else { best };
        sums[..count].iter().enumerate().fold((u16::MAX, 0), first)
    }

    #[inline(always)]
    fn least_outside(sums: &[u16], count: usize, from: usize, to: usize) -> u16 {
        sums[..from].iter().chain(&sums[to..count]).copied().fold(u16::MAX, u16::min)
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{Sums, WORDS};
    use std::arch::x86_64::*;

    // SAFETY of all blocks below: the instructions are those of AVX2, for whose functions alone this is; what is read lies in the
    // slice, whose length is checked.
    impl Sums for crate::simd::Avx2 {
        #[inline(always)]
        fn least(sums: &[u16], count: usize) -> (u16, usize) {
            assert!(sums.len() >= count + WORDS && (1..=usize::from(u16::MAX)).contains(&count));
            // SAFETY: as above.
            unsafe {
                let mut least = _mm256_set1_epi16(-1);
                let mut at = 0;
                while at + WORDS < count {
                    least = _mm256_min_epu16(least, load(sums, at));
                    at += WORDS;
                }
                let last = _mm256_or_si256(load(sums, at), others(count - at));
                let least = _mm256_min_epu16(least, last);
                let least = least_lane(least);
                let mut at = 0;
                loop {
                    let same = _mm256_cmpeq_epi16(load(sums, at), _mm256_set1_epi16(least as i16));
                    let bits = _mm256_movemask_epi8(same) as u32;
                    at += WORDS;
                    if bits != 0 || at >= count {
                        break (least, at - WORDS + bits.trailing_zeros() as usize / 2);
                    }
                }
            }
        }

        #[inline(always)]
        fn least_outside(sums: &[u16], count: usize, from: usize, to: usize) -> u16 {
            assert!(sums.len() >= count + WORDS && from <= to && to <= count && count <= usize::from(u16::MAX));
            // SAFETY: as above.
            unsafe {
                let (all, window) = (_mm256_set1_epi16(-1), splat(to - from));
                let mut least = all;
                // Numbers before the window become great ones, as there are none below 0.
                let mut place = _mm256_sub_epi16(lanes(), splat(from));
                let mut at = 0;
                loop {
                    let away = _mm256_cmpeq_epi16(_mm256_min_epu16(place, window), window);
                    let seen = _mm256_blendv_epi8(all, load(sums, at), away);
                    if at + WORDS >= count {
                        least = _mm256_min_epu16(least, _mm256_or_si256(seen, others(count - at)));
                        break;
                    }
                    least = _mm256_min_epu16(least, seen);
                    place = _mm256_add_epi16(place, splat(WORDS));
                    at += WORDS;
                }
                least_lane(least)
            }
        }
    }

    #[inline(always)]
    fn splat(number: usize) -> __m256i {
        // SAFETY: as above.
        unsafe { _mm256_set1_epi16(number as i16) }
    }

    #[inline(always)]
    fn lanes() -> __m256i {
        // SAFETY: as above.
        unsafe { _mm256_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) }
    }

    /// All bits in the lanes behind the first `count`.
    ///
    /// # Safety
    /// They are no more than there are lanes.
    #[inline(always)]
    unsafe fn others(count: usize) -> __m256i {
        static OTHERS: [u16; 2 * WORDS] = {
            let mut out = [0; 2 * WORDS];
            let mut i = WORDS;
            while i < 2 * WORDS {
                out[i] = u16::MAX;
                i += 1;
            }
            out
        };
        // SAFETY: the caller's.
        unsafe { _mm256_loadu_si256(OTHERS.as_ptr().add(WORDS - count).cast()) }
    }

    /// # Safety
    /// [`WORDS`] sums can be read from `at` on.
    #[inline(always)]
    unsafe fn load(sums: &[u16], at: usize) -> __m256i {
        // SAFETY: the caller's.
        unsafe { _mm256_loadu_si256(sums.as_ptr().add(at).cast()) }
    }

    #[inline(always)]
    fn least_lane(v: __m256i) -> u16 {
        // SAFETY: as above.
        unsafe {
            let half = _mm_min_epu16(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
            _mm_cvtsi128_si32(_mm_minpos_epu16(half)) as u16
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Anywhere;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn registers_find_what_a_search_finds(
            sums in prop::collection::vec(prop_oneof![0..40u16, any::<u16>()], WORDS + 1..120),
            window in (0..200usize, 0..200usize),
        ) {
            let count = sums.len() - WORDS;
            let (from, to) = (window.0.min(window.1).min(count), window.0.max(window.1).min(count));
            let (least, place) = Anywhere::least(&sums, count);
            let outside = Anywhere::least_outside(&sums, count, from, to);
            let own = &sums[..count];
            prop_assert_eq!((Some(&least), Some(place)), (own.iter().min(), own.iter().position(|s| *s == least)));
            let others = own.iter().enumerate().filter(|(i, _)| !(from..to).contains(i)).map(|(_, s)| *s);
            prop_assert_eq!(outside, others.min().unwrap_or(u16::MAX));
            #[cfg(target_arch = "x86_64")]
            if std::is_x86_feature_detected!("avx2") {
                use crate::simd::Avx2;
                prop_assert_eq!(Avx2::least(&sums, count), (least, place));
                prop_assert_eq!(Avx2::least_outside(&sums, count, from, to), outside);
            }
        }
    }
}
