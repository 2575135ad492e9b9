//! Vectors of bytes in AVX2 registers.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::bytes::{Bytes, Instructions, SHIFT_MAX};
use super::tokens::Avx2;

/// The first lane of a register.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FirstByte(__m128i);

/// 16 bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bytes16(__m128i);

/// 32 bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bytes32(__m256i);

impl Instructions for Avx2 {
    type First = FirstByte;
    type Half = Bytes16;
    type One = Bytes32;

    #[inline(always)]
    fn widen(half: Bytes16) -> Bytes32 {
        // SAFETY: `half` was made from an `Avx2` token, so that the machine has the instructions.
        Bytes32(unsafe { _mm256_inserti128_si256::<0>(_mm256_set1_epi8(-1), half.0) })
    }

    #[inline(always)]
    fn lower_half(one: Bytes32) -> Bytes16 {
        // SAFETY: `one` was made from an `Avx2` token, so that the machine has the instruction.
        Bytes16(unsafe { _mm256_castsi256_si128(one.0) })
    }
}

/// Methods that are one instruction on two registers.
macro_rules! lane_by_lane {
    ($($name:ident = $instruction:path),*) => {
        $(
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: `self` was made from an `Avx2` token, so that the machine has the
                // instruction.
                Self(unsafe { $instruction(self.0, other.0) })
            }
        )*
    };
}

impl Bytes for Bytes16 {
    const LANES: usize = 16;
    type Token = Avx2;
    type First = FirstByte;

    lane_by_lane!(
        min = _mm_min_epu8,
        saturating_add = _mm_adds_epu8,
        saturating_sub = _mm_subs_epu8,
        average = _mm_avg_epu8,
        or = _mm_or_si128
    );

    #[inline(always)]
    fn splat(_: Avx2, value: u8) -> Self {
        // SAFETY: the token proves that the machine has the instruction.
        Self(unsafe { _mm_set1_epi8(value as i8) })
    }

    #[inline(always)]
    fn splat_first(first: FirstByte) -> Self {
        // SAFETY: `first` was taken from a register that a token made: the machine has AVX2.
        Self(unsafe { _mm_broadcastb_epi8(first.0) })
    }

    #[inline(always)]
    unsafe fn load(_: Avx2, from: *const u8) -> Self {
        // SAFETY: the token proves the instruction, and the caller vouches for 16 readable bytes.
        Self(unsafe { _mm_loadu_si128(from.cast()) })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u8) {
        // SAFETY: SSE2 is part of x86-64, and the caller vouches for 16 writable bytes.
        unsafe { _mm_storeu_si128(to.cast(), self.0) }
    }

    #[inline(always)]
    fn preceded_by(self, before: Self) -> Self {
        // SAFETY: `self` was made from an `Avx2` token, so that the machine has the instruction.
        Self(unsafe { _mm_alignr_epi8::<15>(self.0, before.0) })
    }

    #[inline(always)]
    fn followed_by(self, next: Self) -> Self {
        // SAFETY: `self` was made from an `Avx2` token, so that the machine has the instruction.
        Self(unsafe { _mm_alignr_epi8::<1>(next.0, self.0) })
    }

    #[inline(always)]
    unsafe fn three_shifts(self, by: i32) -> [Self; 3] {
        let at = (by + MIDDLE) as usize;
        let shifted = |at: usize| {
            // SAFETY: `self` proves the instructions. `at` lies in `0..=2 * MIDDLE`, as the caller
            // keeps `by` within `SHIFT_MAX = MIDDLE - 17`, and both tables have 16 entries from
            // there on.
            unsafe {
                let (lanes, outside) = (SOURCE_LANE.as_ptr().add(at), OUTSIDE_16.as_ptr().add(at));
                let moved = _mm_shuffle_epi8(self.0, _mm_loadu_si128(lanes.cast()));
                Self(_mm_or_si128(moved, _mm_loadu_si128(outside.cast())))
            }
        };
        [shifted(at - 1), shifted(at), shifted(at + 1)]
    }

    #[inline(always)]
    fn first(self) -> FirstByte {
        FirstByte(self.0)
    }

    #[inline(always)]
    fn minima(four: [Self; 4], to: &mut [u8; 4]) -> FirstByte {
        // SAFETY: the registers were made from an `Avx2` token, so that the machine has the
        // instructions.
        unsafe {
            // The lesser of each two lanes becomes a word, and one instruction finds the least
            // word.
            let least = four.map(|v| _mm_minpos_epu16(_mm_min_epu8(v.0, _mm_srli_epi16::<8>(v.0))));
            let [a, b, c, d] = least;
            let all = _mm_unpacklo_epi16(_mm_unpacklo_epi8(a, b), _mm_unpacklo_epi8(c, d));
            *to = _mm_cvtsi128_si32(all).to_le_bytes();
            FirstByte(a)
        }
    }

    #[inline(always)]
    unsafe fn store_weighted_sums(eightfold: Self, twofold: Self, [a, b]: [Self; 2], to: *mut u16) {
        // SAFETY: the registers prove the instructions, and the caller vouches for 16 writable
        // words.
        unsafe {
            let two = _mm256_add_epi16(_mm256_cvtepu8_epi16(a.0), _mm256_cvtepu8_epi16(b.0));
            let fourfold = _mm256_slli_epi16::<2>(_mm256_cvtepu8_epi16(eightfold.0));
            let half = _mm256_add_epi16(_mm256_cvtepu8_epi16(twofold.0), fourfold);
            _mm256_storeu_si256(to.cast(), _mm256_add_epi16(two, _mm256_add_epi16(half, half)));
        }
    }
}

impl Bytes for Bytes32 {
    const LANES: usize = 32;
    type Token = Avx2;
    type First = FirstByte;

    lane_by_lane!(
        min = _mm256_min_epu8,
        saturating_add = _mm256_adds_epu8,
        saturating_sub = _mm256_subs_epu8,
        average = _mm256_avg_epu8,
        or = _mm256_or_si256
    );

    #[inline(always)]
    fn splat(_: Avx2, value: u8) -> Self {
        // SAFETY: the token proves that the machine has the instruction.
        Self(unsafe { _mm256_set1_epi8(value as i8) })
    }

    #[inline(always)]
    fn splat_first(first: FirstByte) -> Self {
        // SAFETY: `first` was taken from a register that a token made: the machine has AVX2.
        Self(unsafe { _mm256_broadcastb_epi8(first.0) })
    }

    #[inline(always)]
    unsafe fn load(_: Avx2, from: *const u8) -> Self {
        // SAFETY: the token proves the instruction, and the caller vouches for 32 readable bytes.
        Self(unsafe { _mm256_loadu_si256(from.cast()) })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u8) {
        // SAFETY: `self` proves the instruction, and the caller vouches for 32 writable bytes.
        unsafe { _mm256_storeu_si256(to.cast(), self.0) }
    }

    #[inline(always)]
    fn preceded_by(self, before: Self) -> Self {
        // SAFETY: `self` was made from an `Avx2` token, so that the machine has the instructions.
        Self(unsafe { _mm256_alignr_epi8::<15>(self.0, _mm256_permute2x128_si256::<0x21>(before.0, self.0)) })
    }

    #[inline(always)]
    fn followed_by(self, next: Self) -> Self {
        // SAFETY: `self` was made from an `Avx2` token, so that the machine has the instructions.
        Self(unsafe { _mm256_alignr_epi8::<1>(_mm256_permute2x128_si256::<0x21>(self.0, next.0), self.0) })
    }

    #[inline(always)]
    unsafe fn three_shifts(self, by: i32) -> [Self; 3] {
        let at = (by + MIDDLE) as usize;
        // SAFETY: `self` proves the instructions. The caller keeps `by` within
        // `SHIFT_MAX = MIDDLE - 17`, so that `at` and its neighbours lie in `16..=2 * MIDDLE - 16`.
        // `SOURCE_LANE` is read from 16 before to 32 behind them and has `2 * MIDDLE + 16` entries;
        // `OUTSIDE_32` is read up to 32 behind them and has `2 * MIDDLE + 32`.
        unsafe {
            let swapped = _mm256_permute2x128_si256::<1>(self.0, self.0);
            let half = |at: usize| _mm_loadu_si128(SOURCE_LANE.as_ptr().add(at).cast());
            let shifted = |at: usize| {
                // A shuffle stays inside a half of the register: one takes what comes from the same
                // half, the other one what comes from the other half.
                let own = _mm256_shuffle_epi8(self.0, _mm256_broadcastsi128_si256(half(at)));
                let other = _mm256_shuffle_epi8(swapped, _mm256_set_m128i(half(at + 16), half(at - 16)));
                let outside = _mm256_loadu_si256(OUTSIDE_32.as_ptr().add(at).cast());
                Self(_mm256_or_si256(_mm256_or_si256(own, other), outside))
            };
            [shifted(at - 1), shifted(at), shifted(at + 1)]
        }
    }

    #[inline(always)]
    fn first(self) -> FirstByte {
        FirstByte(Avx2::lower_half(self).0)
    }

    #[inline(always)]
    fn minima([a, b, c, d]: [Self; 4], to: &mut [u8; 4]) -> FirstByte {
        // SAFETY: the registers were made from an `Avx2` token, so that the machine has the
        // instructions.
        unsafe {
            // Each step halves the lanes of every register and lays two of them side by side.
            let ab = _mm256_min_epu8(_mm256_unpacklo_epi8(a.0, b.0), _mm256_unpackhi_epi8(a.0, b.0));
            let cd = _mm256_min_epu8(_mm256_unpacklo_epi8(c.0, d.0), _mm256_unpackhi_epi8(c.0, d.0));
            let all = _mm256_min_epu8(_mm256_unpacklo_epi16(ab, cd), _mm256_unpackhi_epi16(ab, cd));
            let all = _mm_min_epu8(_mm256_castsi256_si128(all), _mm256_extracti128_si256::<1>(all));
            let all = _mm_min_epu8(all, _mm_srli_si128::<8>(all));
            let all = _mm_min_epu8(all, _mm_srli_si128::<4>(all));
            *to = _mm_cvtsi128_si32(all).to_le_bytes();
            FirstByte(all)
        }
    }

    #[inline(always)]
    unsafe fn store_weighted_sums(eightfold: Self, twofold: Self, [a, b]: [Self; 2], to: *mut u16) {
        // SAFETY: the registers prove the instructions, and the caller vouches for 32 writable
        // words.
        unsafe {
            let (weights, ones) = (_mm256_set1_epi16(0x0208), _mm256_set1_epi8(1));
            // Unpacking stays inside the halves of a register: `outer` holds lanes 0 to 7 and 16 to
            // 23.
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

/// Index in the tables below at which every lane stays in its place.
const MIDDLE: i32 = SHIFT_MAX + 17;

/// Lane that a lane of sixteen gets: the 16 entries from index `MIDDLE + by` on shift by `by`. The
/// shuffle instruction writes 0 where an entry has its highest bit.
static SOURCE_LANE: [u8; 2 * MIDDLE as usize + 16] = {
    let mut out = [0x80; 2 * MIDDLE as usize + 16];
    let mut i = 0;
    while i < 16 {
        out[MIDDLE as usize + i] = i as u8;
        i += 1;
    }
    out
};

/// 255 where a shift of 16 lanes brings in a lane from outside, 0 elsewhere.
static OUTSIDE_16: [u8; 2 * MIDDLE as usize + 16] = outside(16);

/// 255 where a shift of 32 lanes brings in a lane from outside, 0 elsewhere.
static OUTSIDE_32: [u8; 2 * MIDDLE as usize + 32] = outside(32);

/// Returns 0 in `lanes` entries from [`MIDDLE`] on, and 255 elsewhere.
const fn outside<const N: usize>(lanes: usize) -> [u8; N] {
    let mut out = [u8::MAX; N];
    let mut i = 0;
    while i < lanes {
        out[MIDDLE as usize + i] = 0;
        i += 1;
    }
    out
}
