//! Lanes in 256-bit registers: a block takes two.
#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::lanes::{Block, InstructionSet, Kernel, Lanes};

/// Proof that the machine has AVX2 and fused multiply-add: only [`Avx2::detect`] makes one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// Returns the token where the machine has both.
    #[inline]
    pub(crate) fn detect() -> Option<Self> {
        (std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")).then_some(Self(()))
    }

    /// Runs a kernel in a function that is compiled for AVX2.
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx2,fma")]
        fn compiled<K: Kernel>(isa: Avx2, kernel: K) -> K::Output {
            kernel.run(isa)
        }
        // SAFETY: `self` proves that the machine has AVX2 and FMA, which is all that the function
        // needs.
        unsafe { compiled(self, kernel) }
    }
}

/// Asks for memory that is read soon.
#[inline(always)]
pub(super) fn prefetch<T>(soon: &T) {
    let from: *const i8 = std::ptr::from_ref(soon).cast();
    // SAFETY: every machine of this architecture has the instruction, which never faults.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(from) };
    if size_of::<T>() > 64 {
        // SAFETY: byte 64 belongs to the value, and the instruction never faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(from.add(64)) };
    }
}

/// Adds the lanes of eight registers.
///
/// # Safety
/// The machine has AVX2.
#[inline(always)]
pub(super) unsafe fn totals_of_eight(v: [__m256; 8]) -> __m256 {
    // SAFETY: the caller vouches for AVX2.
    unsafe {
        let low = _mm256_hadd_ps(_mm256_hadd_ps(v[0], v[1]), _mm256_hadd_ps(v[2], v[3]));
        let high = _mm256_hadd_ps(_mm256_hadd_ps(v[4], v[5]), _mm256_hadd_ps(v[6], v[7]));
        _mm256_add_ps(_mm256_permute2f128_ps::<0x20>(low, high), _mm256_permute2f128_ps::<0x31>(low, high))
    }
}

/// Adds the lanes of sixteen blocks, given their first halves in memory and their second ones in
/// registers.
///
/// # Safety
/// The machine has AVX2.
#[inline(always)]
unsafe fn totals(first: &[Block; 16], second: [Lanes256; 16]) -> [f32; 16] {
    let mut out = [0.0; 16];
    for (group, sums) in out.chunks_exact_mut(8).enumerate() {
        let halves = first[group * 8..group * 8 + 8].iter().zip(&second[group * 8..group * 8 + 8]);
        // SAFETY: the caller vouches for AVX2. A block has 16 values, of which eight are read, and
        // eight are written to a chunk of eight.
        unsafe {
            let mut folded = [_mm256_setzero_ps(); 8];
            for (lanes, (first, Lanes256(second))) in folded.iter_mut().zip(halves) {
                *lanes = _mm256_add_ps(_mm256_loadu_ps(first.0.as_ptr()), *second);
            }
            _mm256_storeu_ps(sums.as_mut_ptr(), totals_of_eight(folded));
        }
    }
    out
}

impl InstructionSet for Avx2 {
    type Lanes = Lanes256;

    const PARTS: usize = 2;

    #[inline(always)]
    fn load(self, from: &Block, part: usize) -> Lanes256 {
        let values = &from.0[part * 8..part * 8 + 8];
        // SAFETY: `self` proves AVX2, and the slice has eight values. The load needs no alignment.
        Lanes256(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    fn splat(self, value: f32) -> Lanes256 {
        // SAFETY: `self` proves that the machine has AVX2, which this intrinsic needs.
        Lanes256(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    fn prefetch<T>(self, soon: &T) {
        prefetch(soon);
    }

    #[inline(always)]
    fn mask(self, bits: u16, part: usize) -> Mask256 {
        // SAFETY: `self` proves that the machine has AVX2, which these intrinsics need.
        Mask256(unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let all = _mm256_set1_epi32(i32::from(bits >> (8 * part)));
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(all, lanes), lanes))
        })
    }

    #[inline(always)]
    fn totals(self, lanes: [Lanes256; 16], part: usize, kept: &mut [Block; 16]) -> [f32; 16] {
        if part == 0 {
            for (lanes, block) in lanes.iter().zip(kept) {
                lanes.store(block, 0);
            }
            return [0.0; 16];
        }
        // SAFETY: `self` proves that the machine has AVX2.
        unsafe { totals(kept, lanes) }
    }
}

/// Half a block in a register. It is made from an [`Avx2`] or from other such lanes only.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lanes256(__m256);

/// Methods of [`Lanes256`] that apply an intrinsic to registers.
macro_rules! lanewise {
    ($($name:ident($($other:ident),*): $intrinsic:expr,)+) => {$(
        #[inline(always)]
        fn $name(self, $($other: Self),*) -> Self {
            // SAFETY: `self` was made from an `Avx2`, so the machine has AVX2 and FMA, which this
            // intrinsic needs.
            Self(unsafe { $intrinsic(self.0, $($other.0),*) })
        }
    )+};
}

impl Lanes for Lanes256 {
    type Mask = Mask256;

    #[inline(always)]
    fn store(self, to: &mut Block, part: usize) {
        let values = &mut to.0[part * 8..part * 8 + 8];
        // SAFETY: `self` was made from an `Avx2`, and the slice has eight values. No alignment is
        // needed.
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) }
    }

    lanewise! {
        add(other): _mm256_add_ps,
        sub(other): _mm256_sub_ps,
        mul(other): _mm256_mul_ps,
        div(other): _mm256_div_ps,
        min(other): _mm256_min_ps,
        max(other): _mm256_max_ps,
        mul_add(factor, term): _mm256_fmadd_ps,
        neg_mul_add(factor, term): _mm256_fnmadd_ps,
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Mask256 {
        // SAFETY: `self` was made from an `Avx2`, so the machine has the instruction.
        Mask256(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn both(a: Mask256, b: Mask256) -> Mask256 {
        // SAFETY: the masks were made from lanes of an `Avx2`, so the machine has the instruction.
        Mask256(unsafe { _mm256_and_ps(a.0, b.0) })
    }

    #[inline(always)]
    fn or_else(self, mask: Mask256, other: Self) -> Self {
        // SAFETY: `self` was made from an `Avx2`, so the machine has the instruction.
        Self(unsafe { _mm256_blendv_ps(other.0, self.0, mask.0) })
    }

    #[inline(always)]
    fn only(self, mask: Mask256) -> Self {
        // SAFETY: `self` was made from an `Avx2`, so the machine has the instruction.
        Self(unsafe { _mm256_and_ps(self.0, mask.0) })
    }

    #[inline(always)]
    fn any(mask: Mask256) -> bool {
        // SAFETY: the mask was made from lanes of an `Avx2`, so the machine has the instruction.
        unsafe { _mm256_movemask_ps(mask.0) != 0 }
    }

    #[inline(always)]
    fn bits(mask: Mask256, part: usize) -> u16 {
        // SAFETY: the mask was made from lanes of an `Avx2`, so the machine has the instruction.
        (unsafe { _mm256_movemask_ps(mask.0) } as u16) << (8 * part)
    }

    #[inline(always)]
    fn scaled(self, shifted: Self) -> Self {
        // SAFETY: `self` was made from an `Avx2`, so the machine has the instructions.
        Self(unsafe {
            let exponent = _mm256_slli_epi32::<23>(_mm256_castps_si256(shifted.0));
            _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(self.0), exponent))
        })
    }
}

/// A mask of all bits or none per lane. It is made from an [`Avx2`] or from [`Lanes256`] only.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mask256(__m256);
