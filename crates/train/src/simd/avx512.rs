//! Lanes in a 512-bit register: a block takes one.
#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::avx2::{prefetch, totals_of_eight};
use super::lanes::{Block, InstructionSet, Kernel, Lanes};

/// Proof that the machine has AVX-512 (foundation, DQ), AVX2 and fused multiply-add: only
/// [`Avx512::detect`] makes one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx512(());

impl Avx512 {
    /// Returns the token where the machine has all of them.
    #[inline]
    pub(crate) fn detect() -> Option<Self> {
        let has_all = std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512dq")
            && std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("fma");
        has_all.then_some(Self(()))
    }

    /// Runs a kernel in a function that is compiled for AVX-512.
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx512f,avx512dq,avx2,fma")]
        fn compiled<K: Kernel>(isa: Avx512, kernel: K) -> K::Output {
            kernel.run(isa)
        }
        // SAFETY: `self` proves that the machine has the four features, which is all that the
        // function needs.
        unsafe { compiled(self, kernel) }
    }
}

/// Adds the lanes of sixteen blocks.
///
/// # Safety
/// The machine has AVX-512 (foundation, DQ) and AVX2.
#[inline(always)]
unsafe fn totals(blocks: [Lanes512; 16]) -> [f32; 16] {
    let mut out = [0.0; 16];
    for (group, sums) in out.chunks_exact_mut(8).enumerate() {
        // SAFETY: the caller vouches for the instructions. Eight values are written to a chunk of
        // eight.
        unsafe {
            let mut folded = [_mm256_setzero_ps(); 8];
            for (lanes, Lanes512(all)) in folded.iter_mut().zip(&blocks[group * 8..group * 8 + 8]) {
                *lanes = _mm256_add_ps(_mm512_castps512_ps256(*all), _mm512_extractf32x8_ps::<1>(*all));
            }
            _mm256_storeu_ps(sums.as_mut_ptr(), totals_of_eight(folded));
        }
    }
    out
}

impl InstructionSet for Avx512 {
    type Lanes = Lanes512;

    const PARTS: usize = 1;

    #[inline(always)]
    fn load(self, from: &Block, _: usize) -> Lanes512 {
        // SAFETY: `self` proves AVX-512, and a block has sixteen values.
        Lanes512(unsafe { _mm512_loadu_ps(from.0.as_ptr()) })
    }

    #[inline(always)]
    fn splat(self, value: f32) -> Lanes512 {
        // SAFETY: `self` proves that the machine has AVX-512, which this intrinsic needs.
        Lanes512(unsafe { _mm512_set1_ps(value) })
    }

    #[inline(always)]
    fn prefetch<T>(self, soon: &T) {
        prefetch(soon);
    }

    #[inline(always)]
    fn mask(self, bits: u16, _: usize) -> __mmask16 {
        bits
    }

    #[inline(always)]
    fn totals(self, lanes: [Lanes512; 16], _: usize, _: &mut [Block; 16]) -> [f32; 16] {
        // SAFETY: `self` proves that the machine has AVX-512 (foundation, DQ) and AVX2.
        unsafe { totals(lanes) }
    }
}

/// A block in a register. It is made from an [`Avx512`] or from other such lanes only.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lanes512(__m512);

/// Methods of [`Lanes512`] that apply an intrinsic to registers.
macro_rules! lanewise {
    ($($name:ident($($other:ident),*): $intrinsic:expr,)+) => {$(
        #[inline(always)]
        fn $name(self, $($other: Self),*) -> Self {
            // SAFETY: `self` was made from an `Avx512`, so the machine has AVX-512, which this
            // intrinsic needs.
            Self(unsafe { $intrinsic(self.0, $($other.0),*) })
        }
    )+};
}

impl Lanes for Lanes512 {
    type Mask = __mmask16;

    #[inline(always)]
    fn store(self, to: &mut Block, _: usize) {
        // SAFETY: `self` was made from an `Avx512`, and a block has sixteen values.
        unsafe { _mm512_storeu_ps(to.0.as_mut_ptr(), self.0) }
    }

    lanewise! {
        add(other): _mm512_add_ps,
        sub(other): _mm512_sub_ps,
        mul(other): _mm512_mul_ps,
        div(other): _mm512_div_ps,
        min(other): _mm512_min_ps,
        max(other): _mm512_max_ps,
        mul_add(factor, term): _mm512_fmadd_ps,
        neg_mul_add(factor, term): _mm512_fnmadd_ps,
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> __mmask16 {
        // SAFETY: `self` was made from an `Avx512`, so the machine has the instruction.
        unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn both(a: __mmask16, b: __mmask16) -> __mmask16 {
        a & b
    }

    #[inline(always)]
    fn or_else(self, mask: __mmask16, other: Self) -> Self {
        // SAFETY: `self` was made from an `Avx512`, so the machine has the instruction.
        Self(unsafe { _mm512_mask_blend_ps(mask, other.0, self.0) })
    }

    #[inline(always)]
    fn only(self, mask: __mmask16) -> Self {
        // SAFETY: `self` was made from an `Avx512`, so the machine has the instruction.
        Self(unsafe { _mm512_maskz_mov_ps(mask, self.0) })
    }

    #[inline(always)]
    fn any(mask: __mmask16) -> bool {
        mask != 0
    }

    #[inline(always)]
    fn bits(mask: __mmask16, _: usize) -> u16 {
        mask
    }

    #[inline(always)]
    fn scaled(self, shifted: Self) -> Self {
        // SAFETY: `self` was made from an `Avx512`, so the machine has the instructions.
        Self(unsafe {
            let exponent = _mm512_slli_epi32::<23>(_mm512_castps_si512(shifted.0));
            _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(self.0), exponent))
        })
    }
}
