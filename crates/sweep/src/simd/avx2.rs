//! Bytes in registers of AVX2: for functions that are compiled for it, and nowhere else.

use super::bytes::{Bytes, Half, Instructions};
use std::arch::x86_64::*;

/// The instructions of AVX2.
pub(crate) struct Avx2;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Sixteen(__m128i);

#[derive(Debug, Clone, Copy)]
pub(crate) struct ThirtyTwo(__m256i);

// SAFETY of all blocks below: the instructions are those of AVX2, for whose functions alone these types are; for what
// pointers point at, the caller vouches.
impl Instructions for Avx2 {
    type Narrow = Sixteen;
    type Wide = ThirtyTwo;

    #[inline(always)]
    fn widened(first: Sixteen) -> ThirtyTwo {
        // SAFETY: as above.
        ThirtyTwo(unsafe { _mm256_broadcastb_epi8(first.0) })
    }

    #[inline(always)]
    fn narrowed(all: ThirtyTwo) -> Sixteen {
        // SAFETY: as above.
        Sixteen(unsafe { _mm256_castsi256_si128(all.0) })
    }
}

impl Bytes for Sixteen {
    const LANES: usize = 16;

    #[inline(always)]
    fn splat(value: u8) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_set1_epi8(value as i8) })
    }

    #[inline(always)]
    unsafe fn load(from: *const u8) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_loadu_si128(from.cast()) })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u8) {
        // SAFETY: as above.
        unsafe { _mm_storeu_si128(to.cast(), self.0) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_min_epu8(self.0, other.0) })
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_adds_epu8(self.0, other.0) })
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_subs_epu8(self.0, other.0) })
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_or_si128(self.0, other.0) })
    }

    #[inline(always)]
    fn behind(self, before: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_alignr_epi8::<15>(self.0, before.0) })
    }

    #[inline(always)]
    fn ahead(self, next: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_alignr_epi8::<1>(next.0, self.0) })
    }

    #[inline(always)]
    fn least(self) -> Self {
        // SAFETY: as above.
        unsafe {
            // The lesser of each two lanes as a word, of which the least can be had at once.
            let words = _mm_min_epu8(self.0, _mm_srli_epi16::<8>(self.0));
            Self(_mm_broadcastb_epi8(_mm_minpos_epu16(words)))
        }
    }

    #[inline(always)]
    fn least_of_each([a, b, c, d]: [Self; 4]) -> [u8; 4] {
        // SAFETY: as above.
        unsafe {
            // Each step halves the lanes of every vector and lays two of them side by side.
            let ab = _mm_min_epu8(_mm_unpacklo_epi8(a.0, b.0), _mm_unpackhi_epi8(a.0, b.0));
            let cd = _mm_min_epu8(_mm_unpacklo_epi8(c.0, d.0), _mm_unpackhi_epi8(c.0, d.0));
            let all = _mm_min_epu8(_mm_unpacklo_epi16(ab, cd), _mm_unpackhi_epi16(ab, cd));
            let all = _mm_min_epu8(all, _mm_srli_si128::<8>(all));
            let all = _mm_min_epu8(all, _mm_srli_si128::<4>(all));
            _mm_cvtsi128_si32(all).to_le_bytes()
        }
    }

    #[inline(always)]
    unsafe fn sum(four: [Self; 4], to: *mut u16) {
        // SAFETY: as above.
        unsafe { _mm256_storeu_si256(to.cast(), sums_of_sixteen(four)) }
    }

    #[inline(always)]
    unsafe fn sum_with(four: [Self; 4], before: *const u16, to: *mut u16) {
        // SAFETY: as above.
        unsafe {
            _mm256_storeu_si256(to.cast(), _mm256_add_epi16(_mm256_loadu_si256(before.cast()), sums_of_sixteen(four)))
        }
    }
}

impl Bytes for ThirtyTwo {
    const LANES: usize = 32;

    #[inline(always)]
    fn splat(value: u8) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_set1_epi8(value as i8) })
    }

    #[inline(always)]
    unsafe fn load(from: *const u8) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_loadu_si256(from.cast()) })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u8) {
        // SAFETY: as above.
        unsafe { _mm256_storeu_si256(to.cast(), self.0) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_min_epu8(self.0, other.0) })
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_adds_epu8(self.0, other.0) })
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_subs_epu8(self.0, other.0) })
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_or_si256(self.0, other.0) })
    }

    #[inline(always)]
    fn behind(self, before: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_alignr_epi8::<15>(self.0, _mm256_permute2x128_si256::<0x21>(before.0, self.0)) })
    }

    #[inline(always)]
    fn ahead(self, next: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_alignr_epi8::<1>(_mm256_permute2x128_si256::<0x21>(self.0, next.0), self.0) })
    }

    #[inline(always)]
    fn least(self) -> Self {
        Avx2::widened(lesser_half(self).least())
    }

    #[inline(always)]
    fn least_of_each([a, b, c, d]: [Self; 4]) -> [u8; 4] {
        Sixteen::least_of_each([lesser_half(a), lesser_half(b), lesser_half(c), lesser_half(d)])
    }

    #[inline(always)]
    unsafe fn sum(four: [Self; 4], to: *mut u16) {
        let (low, high) = sums_of_thirty_two(four);
        // SAFETY: as above.
        unsafe {
            _mm256_storeu_si256(to.cast(), low);
            _mm256_storeu_si256(to.add(16).cast(), high);
        }
    }

    #[inline(always)]
    unsafe fn sum_with(four: [Self; 4], before: *const u16, to: *mut u16) {
        let (low, high) = sums_of_thirty_two(four);
        // SAFETY: as above.
        unsafe {
            _mm256_storeu_si256(to.cast(), _mm256_add_epi16(_mm256_loadu_si256(before.cast()), low));
            _mm256_storeu_si256(to.add(16).cast(), _mm256_add_epi16(_mm256_loadu_si256(before.add(16).cast()), high));
        }
    }
}

impl Half for Sixteen {
    #[inline(always)]
    fn around(self, by: i32) -> [Self; 3] {
        // Beyond its lanes there are none, however far.
        let at = (by.clamp(-17, 17) + 17) as usize;
        // SAFETY: as above; the tables hold 18 bytes from every place on that `at` can be.
        unsafe {
            let (lanes, outside) = (LANE.as_ptr().add(at), OUTSIDE.as_ptr().add(at));
            let moved = |by: usize| {
                let lanes = _mm_shuffle_epi8(self.0, _mm_loadu_si128(lanes.add(by).cast()));
                Self(_mm_or_si128(lanes, _mm_loadu_si128(outside.add(by).cast())))
            };
            [moved(0), moved(1), moved(2)]
        }
    }
}

/// The lanes −18 to 33, of which there are sixteen.
static LANE: [u8; 52] = {
    let mut out = [0x80; 52];
    let mut i = 0;
    while i < 16 {
        out[18 + i] = i as u8;
        i += 1;
    }
    out
};

/// All bits where [`LANE`] names none.
static OUTSIDE: [u8; 52] = {
    let mut out = [u8::MAX; 52];
    let mut i = 0;
    while i < 16 {
        out[18 + i] = 0;
        i += 1;
    }
    out
};

/// The lesser of each lane of the lower half and the same one of the upper.
#[inline(always)]
fn lesser_half(v: ThirtyTwo) -> Sixteen {
    // SAFETY: as above.
    Sixteen(unsafe { _mm_min_epu8(_mm256_castsi256_si128(v.0), _mm256_extracti128_si256::<1>(v.0)) })
}

#[inline(always)]
fn sums_of_sixteen([a, b, c, d]: [Sixteen; 4]) -> __m256i {
    // SAFETY: as above.
    unsafe {
        let ones = _mm_set1_epi8(1);
        let low = _mm_add_epi16(
            _mm_maddubs_epi16(_mm_unpacklo_epi8(a.0, b.0), ones),
            _mm_maddubs_epi16(_mm_unpacklo_epi8(c.0, d.0), ones),
        );
        let high = _mm_add_epi16(
            _mm_maddubs_epi16(_mm_unpackhi_epi8(a.0, b.0), ones),
            _mm_maddubs_epi16(_mm_unpackhi_epi8(c.0, d.0), ones),
        );
        _mm256_set_m128i(high, low)
    }
}

#[inline(always)]
fn sums_of_thirty_two([a, b, c, d]: [ThirtyTwo; 4]) -> (__m256i, __m256i) {
    // SAFETY: as above.
    unsafe {
        let ones = _mm256_set1_epi8(1);
        // Lanes 0 to 7 and 16 to 23, and the others: unpacking keeps to the halves of a register.
        let outer = _mm256_add_epi16(
            _mm256_maddubs_epi16(_mm256_unpacklo_epi8(a.0, b.0), ones),
            _mm256_maddubs_epi16(_mm256_unpacklo_epi8(c.0, d.0), ones),
        );
        let inner = _mm256_add_epi16(
            _mm256_maddubs_epi16(_mm256_unpackhi_epi8(a.0, b.0), ones),
            _mm256_maddubs_epi16(_mm256_unpackhi_epi8(c.0, d.0), ones),
        );
        (_mm256_permute2x128_si256::<0x20>(outer, inner), _mm256_permute2x128_si256::<0x31>(outer, inner))
    }
}
