//! Eight f32 values side by side: AVX2 where the machine has it, plain arrays elsewhere.
//!
//! This is the only unsafe module of the crate. A kernel is written once, generic over an
//! [`InstructionSet`]. The value of that type is a token. The token of AVX2 can only be made by
//! [`dispatch`], after the machine was asked, and lanes can only be made from a token. So no safe
//! function reaches an instruction that the machine lacks. No fused multiply-add is used, so that
//! both sets give the same bits.
#![allow(unsafe_code)]

/// Makes lanes. Having a value of such a type proves that the machine has its instructions.
pub(crate) trait InstructionSet: Copy {
    /// Eight lanes of f32.
    type Lanes: Lanes;

    fn load(self, from: &[f32; 8]) -> Self::Lanes;
    fn load_bits(self, from: &[u32; 8]) -> Self::Lanes;
    fn splat(self, value: f32) -> Self::Lanes;

    #[inline(always)]
    fn splat_bits(self, bits: u32) -> Self::Lanes {
        self.splat(f32::from_bits(bits))
    }
}

/// Eight lanes of f32. Comparisons give masks: lanes with all bits set or none.
pub(crate) trait Lanes: Copy {
    fn store(self, to: &mut [f32; 8]);
    fn store_bits(self, to: &mut [u32; 8]);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// Returns the mask of `self > other`, which is unset where either is NaN.
    fn above(self, other: Self) -> Self;
    fn and(self, other: Self) -> Self;
    /// Takes `yes` where this mask is set and `no` elsewhere.
    fn pick(self, yes: Self, no: Self) -> Self;
    /// Returns one bit per lane of a mask, the first lane in the lowest bit.
    fn bits(self) -> u32;
}

/// Plain Rust, on every machine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain;

impl InstructionSet for Plain {
    type Lanes = PlainLanes;

    #[inline(always)]
    fn load(self, from: &[f32; 8]) -> PlainLanes {
        PlainLanes(*from)
    }

    #[inline(always)]
    fn load_bits(self, from: &[u32; 8]) -> PlainLanes {
        PlainLanes(from.map(f32::from_bits))
    }

    #[inline(always)]
    fn splat(self, value: f32) -> PlainLanes {
        PlainLanes([value; 8])
    }
}

/// Lanes in an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlainLanes([f32; 8]);

impl PlainLanes {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Lanes for PlainLanes {
    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn store_bits(self, to: &mut [u32; 8]) {
        *to = self.0.map(f32::to_bits);
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn above(self, other: Self) -> Self {
        self.zip(other, |a, b| f32::from_bits(if a > b { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.zip(other, |a, b| f32::from_bits(a.to_bits() & b.to_bits()))
    }

    #[inline(always)]
    fn pick(self, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|i| if self.0[i].to_bits() != 0 { yes.0[i] } else { no.0[i] }))
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.iter().enumerate().fold(0, |bits, (i, lane)| bits | (lane.to_bits() >> 31) << i)
    }
}

/// Work that is written once for every instruction set.
///
/// `run` and everything that it calls with lanes must be `#[inline(always)]`, so that the whole
/// becomes one function compiled for the instruction set.
pub(crate) trait Kernel {
    type Output;

    fn run<I: InstructionSet>(self, isa: I) -> Self::Output;
}

/// Runs a kernel with the widest lanes that the machine has.
pub(crate) fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(isa) = avx2::Avx2::detect() {
        return isa.run(kernel);
    }
    kernel.run(Plain)
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! Lanes in a 256-bit register.
    use std::arch::x86_64::*;

    use super::{InstructionSet, Kernel, Lanes};

    /// Proof that the machine has AVX2: only [`Avx2::detect`] makes one.
    #[derive(Debug, Clone, Copy)]
    pub(super) struct Avx2(());

    impl Avx2 {
        /// Returns the token where the machine has AVX2.
        #[inline]
        pub(super) fn detect() -> Option<Self> {
            std::arch::is_x86_feature_detected!("avx2").then_some(Self(()))
        }

        /// Runs a kernel in a function that is compiled for AVX2.
        pub(super) fn run<K: Kernel>(self, kernel: K) -> K::Output {
            #[target_feature(enable = "avx2")]
            fn compiled_for_avx2<K: Kernel>(isa: Avx2, kernel: K) -> K::Output {
                kernel.run(isa)
            }
            // SAFETY: `self` proves that the machine has AVX2, which is all that the function
            // needs.
            unsafe { compiled_for_avx2(self, kernel) }
        }
    }

    impl InstructionSet for Avx2 {
        type Lanes = Wide;

        #[inline(always)]
        fn load(self, from: &[f32; 8]) -> Wide {
            // SAFETY: `self` proves AVX2, and 32 bytes are readable behind the reference. The load
            // needs no alignment.
            Wide(unsafe { _mm256_loadu_ps(from.as_ptr()) })
        }

        #[inline(always)]
        fn load_bits(self, from: &[u32; 8]) -> Wide {
            // SAFETY: `self` proves AVX2, and 32 bytes are readable behind the reference. Every bit
            // pattern is an f32.
            Wide(unsafe { _mm256_loadu_ps(from.as_ptr().cast()) })
        }

        #[inline(always)]
        fn splat(self, value: f32) -> Wide {
            // SAFETY: `self` proves that the machine has AVX2, which this intrinsic needs.
            Wide(unsafe { _mm256_set1_ps(value) })
        }
    }

    /// Methods of [`Wide`] that apply an intrinsic to two registers.
    macro_rules! lanewise {
        ($($name:ident: $intrinsic:expr,)+) => {$(
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: `self` was made from an `Avx2`, so the machine has AVX2, which this
                // intrinsic needs.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        )+};
    }

    /// Lanes in a register. They are made from an [`Avx2`] or from other such lanes only.
    #[derive(Debug, Clone, Copy)]
    pub(super) struct Wide(__m256);

    impl Lanes for Wide {
        #[inline(always)]
        fn store(self, to: &mut [f32; 8]) {
            // SAFETY: `self` was made from an `Avx2`, and 32 bytes are writable behind the
            // reference. No alignment is needed.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn store_bits(self, to: &mut [u32; 8]) {
            // SAFETY: `self` was made from an `Avx2`, and 32 bytes are writable behind the
            // reference. Every bit pattern is a u32.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr().cast(), self.0) }
        }

        lanewise! {
            add: _mm256_add_ps,
            sub: _mm256_sub_ps,
            mul: _mm256_mul_ps,
            min: _mm256_min_ps,
            max: _mm256_max_ps,
            above: _mm256_cmp_ps::<_CMP_GT_OQ>,
            and: _mm256_and_ps,
        }

        #[inline(always)]
        fn pick(self, yes: Self, no: Self) -> Self {
            // SAFETY: `self` was made from an `Avx2`, so the machine has AVX2, which this intrinsic
            // needs.
            Self(unsafe { _mm256_blendv_ps(no.0, yes.0, self.0) })
        }

        #[inline(always)]
        fn bits(self) -> u32 {
            // SAFETY: `self` was made from an `Avx2`, so the machine has AVX2, which this intrinsic
            // needs.
            (unsafe { _mm256_movemask_ps(self.0) }) as u32
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bits that every operation gives for signs, zeros, infinities, NaN and subnormal numbers.
    struct All;

    impl Kernel for All {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<I: InstructionSet>(self, isa: I) -> Vec<u32> {
            let a = isa.load(&[1.5, -2.0, 0.0, -0.0, f32::INFINITY, f32::NAN, 1e-40, 7.0]);
            let b = isa.load(&[1.5, 3.0, -0.0, 0.0, f32::NEG_INFINITY, 1.0, 1e-40, -7.0]);
            let mut out = Vec::new();
            let mask = b.above(a);
            for lanes in [a.add(b), a.sub(b), a.mul(b), mask, mask.and(a.above(isa.splat(-9.0))), mask.pick(a, b)] {
                let mut bits = [0; 8];
                lanes.store_bits(&mut bits);
                // The sign and the payload of a NaN may differ between instruction sets.
                out.extend(bits.map(|b| if f32::from_bits(b).is_nan() && b != u32::MAX { 0x7fc0_0000 } else { b }));
            }
            let finite = [isa.splat(2.0), isa.load_bits(&[0x3f80_0000; 8]), isa.splat_bits(0x4000_0000)];
            for lanes in [finite[0].min(finite[1]), finite[0].max(finite[1]), finite[2]] {
                let mut values = [0.0; 8];
                lanes.store(&mut values);
                out.extend(values.map(f32::to_bits));
            }
            out.push(mask.bits());
            out
        }
    }

    #[test]
    fn wide_lanes_give_the_bits_of_plain_ones() {
        let plain = All.run(Plain);
        assert_eq!(dispatch(All), plain);
        assert_eq!(plain.last(), Some(&0b10));
    }
}
