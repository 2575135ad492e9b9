//! Registers of bytes and of words of 16 bits, as long as the machine has them (AVX2, or AVX-512 with its instructions for bytes and
//! words, BW): for functions that are compiled for their instructions, and nowhere else. `multiversion` takes AVX-512 only from Ice
//! Lake and Zen 4 on: before, it slows the processor's clock.

use std::arch::x86_64::*;

/// A register of bytes, or of half as many words.
pub(crate) trait Wide: Copy {
    const BYTES: usize;
    /// # Safety
    /// A register's bytes can be read.
    unsafe fn load<T>(from: *const T) -> Self;
    /// # Safety
    /// A register's bytes can be written.
    unsafe fn store<T>(self, to: *mut T);
    fn splat(byte: i8) -> Self;
    fn splat_word(word: i16) -> Self;
    fn and(self, other: Self) -> Self;
    fn xor(self, other: Self) -> Self;
    /// The lesser ones of unsigned bytes, and the greater ones.
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// Differences of unsigned bytes, 0 where they are less.
    fn minus(self, other: Self) -> Self;
    /// Sums of unsigned bytes, 255 where they are more.
    fn plus(self, other: Self) -> Self;
    /// Halves of the sums of unsigned bytes, rounded up.
    fn average(self, other: Self) -> Self;
    /// Sums of words, wrapped where they are too large, and cut there.
    fn add_words(self, other: Self) -> Self;
    fn add_words_cut(self, other: Self) -> Self;
    /// Differences of words, cut.
    fn minus_words_cut(self, other: Self) -> Self;
    /// Products of words in 2¹⁵ths, rounded.
    fn times_words(self, other: Self) -> Self;
    /// Words moved by some bits to the right.
    fn right(self, bits: i32) -> Self;
    /// The words of two registers as bytes, cut, each register's by eights; [`Wide::in_order`] brings them into their order.
    fn pack(self, next: Self) -> Self;
    fn in_order(self) -> Self;
}

/// Each method is an instruction.
macro_rules! wide {
    ($register:ty, $bytes:literal, load = $load:path, store = $store:path, splat = $splat:path, splat_word = $splat_word:path,
     right = $right:path, in_order = $in_order:expr, $($name:ident = $instruction:path),*) => {
        // SAFETY of all blocks: the instructions are those for whose functions alone this type is; for what pointers point at,
        // the caller vouches.
        impl Wide for $register {
            const BYTES: usize = $bytes;

            #[inline(always)]
            unsafe fn load<T>(from: *const T) -> Self {
                // SAFETY: as above.
                unsafe { $load(from.cast()) }
            }

            #[inline(always)]
            unsafe fn store<T>(self, to: *mut T) {
                // SAFETY: as above.
                unsafe { $store(to.cast(), self) }
            }

            #[inline(always)]
            fn splat(byte: i8) -> Self {
                // SAFETY: as above.
                unsafe { $splat(byte) }
            }

            #[inline(always)]
            fn splat_word(word: i16) -> Self {
                // SAFETY: as above.
                unsafe { $splat_word(word) }
            }

            #[inline(always)]
            fn right(self, bits: i32) -> Self {
                // SAFETY: as above.
                unsafe { $right(self, _mm_cvtsi32_si128(bits)) }
            }

            #[inline(always)]
            fn in_order(self) -> Self {
                // SAFETY: as above.
                unsafe { $in_order(self) }
            }

            $(
                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    // SAFETY: as above.
                    unsafe { $instruction(self, other) }
                }
            )*
        }
    };
}

wide!(
    __m256i,
    32,
    load = _mm256_loadu_si256,
    store = _mm256_storeu_si256,
    splat = _mm256_set1_epi8,
    splat_word = _mm256_set1_epi16,
    right = _mm256_srl_epi16,
    in_order = |packed| _mm256_permute4x64_epi64::<0b11_01_10_00>(packed),
    and = _mm256_and_si256,
    xor = _mm256_xor_si256,
    min = _mm256_min_epu8,
    max = _mm256_max_epu8,
    minus = _mm256_subs_epu8,
    plus = _mm256_adds_epu8,
    average = _mm256_avg_epu8,
    add_words = _mm256_add_epi16,
    add_words_cut = _mm256_adds_epi16,
    minus_words_cut = _mm256_subs_epi16,
    times_words = _mm256_mulhrs_epi16,
    pack = _mm256_packs_epi16
);

wide!(
    __m512i,
    64,
    load = _mm512_loadu_si512,
    store = _mm512_storeu_si512,
    splat = _mm512_set1_epi8,
    splat_word = _mm512_set1_epi16,
    right = _mm512_srl_epi16,
    in_order = |packed| _mm512_permutexvar_epi64(_mm512_setr_epi64(0, 2, 4, 6, 1, 3, 5, 7), packed),
    and = _mm512_and_si512,
    xor = _mm512_xor_si512,
    min = _mm512_min_epu8,
    max = _mm512_max_epu8,
    minus = _mm512_subs_epu8,
    plus = _mm512_adds_epu8,
    average = _mm512_avg_epu8,
    add_words = _mm512_add_epi16,
    add_words_cut = _mm512_adds_epi16,
    minus_words_cut = _mm512_subs_epi16,
    times_words = _mm512_mulhrs_epi16,
    pack = _mm512_packs_epi16
);
