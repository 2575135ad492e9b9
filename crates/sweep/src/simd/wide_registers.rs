//! Registers of bytes and of 16-bit words: 32 bytes of AVX2, or 64 bytes of AVX-512.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::tokens::{Avx2, Avx512};
use super::wide::Wide;

/// 32 bytes of AVX2.
#[derive(Clone, Copy)]
pub(crate) struct Wide256(__m256i);

/// 64 bytes of AVX-512.
#[derive(Clone, Copy)]
pub(crate) struct Wide512(__m512i);

/// Implements [`Wide`] for a register, with one instruction for each method.
#[rustfmt::skip]
macro_rules! wide {
    ($register:ident, $token:ty, $bytes:literal, short_token = $short:expr, load = $load:path,
     store = $store:path, splat = $splat:path, splat_word = $splat_word:path,
     shift_words_right = $right:path, in_order = $in_order:expr, $($name:ident = $instruction:path),*) => {
        impl Wide for $register {
            const BYTES: usize = $bytes;
            type Token = $token;
            type Short = Wide256;

            #[inline(always)]
            fn short_token(token: $token) -> Avx2 {
                $short(token)
            }

            #[inline(always)]
            unsafe fn load<T>(_: $token, from: *const T) -> Self {
                // SAFETY: the token proves the instruction, and the caller vouches for the memory.
                Self(unsafe { $load(from.cast()) })
            }

            #[inline(always)]
            unsafe fn store<T>(self, to: *mut T) {
                // SAFETY: `self` was made from a token, which proves the instruction, and the
                // caller vouches for the memory.
                unsafe { $store(to.cast(), self.0) }
            }

            #[inline(always)]
            fn splat(_: $token, byte: i8) -> Self {
                // SAFETY: the token proves that the machine has the instruction.
                Self(unsafe { $splat(byte) })
            }

            #[inline(always)]
            fn splat_word(_: $token, word: i16) -> Self {
                // SAFETY: the token proves that the machine has the instruction.
                Self(unsafe { $splat_word(word) })
            }

            #[inline(always)]
            fn shift_words_right(self, bits: i32) -> Self {
                // SAFETY: `self` was made from a token, so that the machine has the instruction.
                Self(unsafe { $right(self.0, _mm_cvtsi32_si128(bits)) })
            }

            #[inline(always)]
            fn in_order(self) -> Self {
                // SAFETY: `self` was made from a token, so that the machine has the instructions.
                Self(unsafe { $in_order(self.0) })
            }

            $(
                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    // SAFETY: `self` was made from a token, so that the machine has the
                    // instruction.
                    Self(unsafe { $instruction(self.0, other.0) })
                }
            )*
        }
    };
}

wide!(
    Wide256,
    Avx2,
    32,
    short_token = |token| token,
    load = _mm256_loadu_si256,
    store = _mm256_storeu_si256,
    splat = _mm256_set1_epi8,
    splat_word = _mm256_set1_epi16,
    shift_words_right = _mm256_srl_epi16,
    in_order = |packed| _mm256_permute4x64_epi64::<0b11_01_10_00>(packed),
    and = _mm256_and_si256,
    xor = _mm256_xor_si256,
    min = _mm256_min_epu8,
    max = _mm256_max_epu8,
    saturating_sub = _mm256_subs_epu8,
    saturating_add = _mm256_adds_epu8,
    average = _mm256_avg_epu8,
    wrapping_add_words = _mm256_add_epi16,
    saturating_add_words = _mm256_adds_epi16,
    saturating_sub_words = _mm256_subs_epi16,
    multiply_words = _mm256_mulhrs_epi16,
    pack = _mm256_packs_epi16
);

wide!(
    Wide512,
    Avx512,
    64,
    short_token = Avx512::avx2,
    load = _mm512_loadu_si512,
    store = _mm512_storeu_si512,
    splat = _mm512_set1_epi8,
    splat_word = _mm512_set1_epi16,
    shift_words_right = _mm512_srl_epi16,
    in_order = |packed| _mm512_permutexvar_epi64(_mm512_setr_epi64(0, 2, 4, 6, 1, 3, 5, 7), packed),
    and = _mm512_and_si512,
    xor = _mm512_xor_si512,
    min = _mm512_min_epu8,
    max = _mm512_max_epu8,
    saturating_sub = _mm512_subs_epu8,
    saturating_add = _mm512_adds_epu8,
    average = _mm512_avg_epu8,
    wrapping_add_words = _mm512_add_epi16,
    saturating_add_words = _mm512_adds_epi16,
    saturating_sub_words = _mm512_subs_epi16,
    multiply_words = _mm512_mulhrs_epi16,
    pack = _mm512_packs_epi16
);
