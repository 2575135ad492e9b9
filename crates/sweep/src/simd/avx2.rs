//! Bytes in registers of AVX2: for functions that are compiled for it, and nowhere else.

use super::bytes::{Bytes, Instructions, REACH};
use std::arch::x86_64::*;

/// The instructions of AVX2.
pub(crate) struct Avx2;

/// A byte in the first lane of a register.
#[derive(Debug, Clone, Copy)]
pub(crate) struct First(__m128i);

#[derive(Debug, Clone, Copy)]
pub(crate) struct Sixteen(__m128i);

#[derive(Debug, Clone, Copy)]
pub(crate) struct ThirtyTwo(__m256i);

// SAFETY of all blocks below: the instructions are those of AVX2, for whose functions alone these types are; for what
// pointers point at, the caller vouches.
impl Instructions for Avx2 {
    type First = First;
    type Half = Sixteen;
    type One = ThirtyTwo;

    #[inline(always)]
    fn one(half: Sixteen) -> ThirtyTwo {
        // SAFETY: as above.
        ThirtyTwo(unsafe { _mm256_inserti128_si256::<0>(_mm256_set1_epi8(-1), half.0) })
    }

    #[inline(always)]
    fn half(one: ThirtyTwo) -> Sixteen {
        // SAFETY: as above.
        Sixteen(unsafe { _mm256_castsi256_si128(one.0) })
    }
}

impl Bytes for Sixteen {
    const LANES: usize = 16;
    type First = First;

    #[inline(always)]
    fn splat_first(first: First) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_broadcastb_epi8(first.0) })
    }

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
    fn average(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_avg_epu8(self.0, other.0) })
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
    unsafe fn around(self, by: i32) -> [Self; 3] {
        let at = (by + MIDDLE) as usize;
        let moved = |at: usize| {
            // SAFETY: as above; the tables are as long as any place and a register.
            unsafe {
                let (lanes, outside) = (LANE.as_ptr().add(at), OUTSIDE.as_ptr().add(at));
                let moved = _mm_shuffle_epi8(self.0, _mm_loadu_si128(lanes.cast()));
                Self(_mm_or_si128(moved, _mm_loadu_si128(outside.cast())))
            }
        };
        [moved(at - 1), moved(at), moved(at + 1)]
    }

    #[inline(always)]
    fn first(self) -> First {
        First(self.0)
    }

    #[inline(always)]
    fn leasts(four: [Self; 4], to: &mut [u8; 4]) -> First {
        // SAFETY: as above.
        unsafe {
            // The lesser of each two lanes as a word, of which the least can be had at once.
            let least = four.map(|v| _mm_minpos_epu16(_mm_min_epu8(v.0, _mm_srli_epi16::<8>(v.0))));
            let [a, b, c, d] = least;
            let all = _mm_unpacklo_epi16(_mm_unpacklo_epi8(a, b), _mm_unpacklo_epi8(c, d));
            *to = _mm_cvtsi128_si32(all).to_le_bytes();
            First(a)
        }
    }

    #[inline(always)]
    unsafe fn store_sums(eightfold: Self, twofold: Self, [a, b]: [Self; 2], to: *mut u16) {
        // SAFETY: as above.
        unsafe {
            let two = _mm256_add_epi16(_mm256_cvtepu8_epi16(a.0), _mm256_cvtepu8_epi16(b.0));
            let fourfold = _mm256_slli_epi16::<2>(_mm256_cvtepu8_epi16(eightfold.0));
            let half = _mm256_add_epi16(_mm256_cvtepu8_epi16(twofold.0), fourfold);
            _mm256_storeu_si256(to.cast(), _mm256_add_epi16(two, _mm256_add_epi16(half, half)));
        }
    }
}

impl Bytes for ThirtyTwo {
    const LANES: usize = 32;
    type First = First;

    #[inline(always)]
    fn splat_first(first: First) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_broadcastb_epi8(first.0) })
    }

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
    fn average(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_avg_epu8(self.0, other.0) })
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
    unsafe fn around(self, by: i32) -> [Self; 3] {
        let at = (by + MIDDLE) as usize;
        // SAFETY: as above; the tables are as long as any place, half a register to either side of it, and a register.
        unsafe {
            let swapped = _mm256_permute2x128_si256::<1>(self.0, self.0);
            let half = |at: usize| _mm_loadu_si128(LANE.as_ptr().add(at).cast());
            let moved = |at: usize| {
                // What comes from the same half of the register, and from the other one.
                let own = _mm256_shuffle_epi8(self.0, _mm256_broadcastsi128_si256(half(at)));
                let other = _mm256_shuffle_epi8(swapped, _mm256_set_m128i(half(at + 16), half(at - 16)));
                let outside = _mm256_loadu_si256(OUTSIDE_OF_BOTH.as_ptr().add(at).cast());
                Self(_mm256_or_si256(_mm256_or_si256(own, other), outside))
            };
            [moved(at - 1), moved(at), moved(at + 1)]
        }
    }

    #[inline(always)]
    fn first(self) -> First {
        First(Avx2::half(self).0)
    }

    #[inline(always)]
    fn leasts([a, b, c, d]: [Self; 4], to: &mut [u8; 4]) -> First {
        // SAFETY: as above.
        unsafe {
            // Each step halves the lanes of every vector and lays two of them side by side.
            let ab = _mm256_min_epu8(_mm256_unpacklo_epi8(a.0, b.0), _mm256_unpackhi_epi8(a.0, b.0));
            let cd = _mm256_min_epu8(_mm256_unpacklo_epi8(c.0, d.0), _mm256_unpackhi_epi8(c.0, d.0));
            let all = _mm256_min_epu8(_mm256_unpacklo_epi16(ab, cd), _mm256_unpackhi_epi16(ab, cd));
            let all = _mm_min_epu8(_mm256_castsi256_si128(all), _mm256_extracti128_si256::<1>(all));
            let all = _mm_min_epu8(all, _mm_srli_si128::<8>(all));
            let all = _mm_min_epu8(all, _mm_srli_si128::<4>(all));
            *to = _mm_cvtsi128_si32(all).to_le_bytes();
            First(all)
        }
    }

    #[inline(always)]
    unsafe fn store_sums(eightfold: Self, twofold: Self, [a, b]: [Self; 2], to: *mut u16) {
        // SAFETY: as above.
        unsafe {
            let (weights, ones) = (_mm256_set1_epi16(0x0208), _mm256_set1_epi8(1));
            // Lanes 0 to 7 and 16 to 23, and the others: unpacking keeps to the halves of a register.
            let outer = _mm256_add_epi16(
                _mm256_maddubs_epi16(_mm256_unpacklo_epi8(eightfold.0, twofold.0), weights),
                _mm256_maddubs_epi16(_mm256_unpacklo_epi8(a.0, b.0), ones),
            );
            let inner = _mm256_add_epi16(
                _mm256_maddubs_epi16(_mm256_unpackhi_epi8(eightfold.0, twofold.0), weights),
                _mm256_maddubs_epi16(_mm256_unpackhi_epi8(a.0, b.0), ones),
            );
            _mm256_storeu_si256(to.cast(), _mm256_permute2x128_si256::<0x20>(outer, inner));
            _mm256_storeu_si256(to.add(16).cast(), _mm256_permute2x128_si256::<0x31>(outer, inner));
        }
    }
}

/// Where in the tables below a register's lanes stay where they are.
const MIDDLE: i32 = REACH + 17;

/// Which lane of sixteen a lane gets, or none: from each place in the table on, those of lanes moved one further.
static LANE: [u8; 2 * MIDDLE as usize + 16] = {
    let mut out = [0x80; 2 * MIDDLE as usize + 16];
    let mut i = 0;
    while i < 16 {
        out[MIDDLE as usize + i] = i as u8;
        i += 1;
    }
    out
};

/// All bits where [`LANE`] names none.
static OUTSIDE: [u8; 2 * MIDDLE as usize + 16] = outside(16);

/// The same for thirty-two lanes.
static OUTSIDE_OF_BOTH: [u8; 2 * MIDDLE as usize + 32] = outside(32);

/// All bits but in so many bytes from [`MIDDLE`] on.
const fn outside<const N: usize>(lanes: usize) -> [u8; N] {
    let mut out = [u8::MAX; N];
    let mut i = 0;
    while i < lanes {
        out[MIDDLE as usize + i] = 0;
        i += 1;
    }
    out
}
