//! Eight f32 side by side: AVX2 where the machine has it, plain arrays elsewhere.
//!
//! The only unsafe module of the crate. No fused multiply-add is used, so that both give the same bits.
#![allow(unsafe_code)]

/// Eight lanes of f32; comparisons give lanes of all or no bits.
pub(crate) trait Lanes: Copy {
    fn load(from: &[f32; 8]) -> Self;
    fn load_bits(from: &[u32; 8]) -> Self;
    fn store(self, to: &mut [f32; 8]);
    fn store_bits(self, to: &mut [u32; 8]);
    fn splat(value: f32) -> Self;
    fn splat_bits(bits: u32) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// Where `self > other`; false for NaN.
    fn above(self, other: Self) -> Self;
    fn and(self, other: Self) -> Self;
    /// `self` where `mask` is set, else `other`.
    fn pick(mask: Self, yes: Self, no: Self) -> Self;
    /// One bit per lane that is set.
    fn bits(self) -> u32;
}

/// Lanes as an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain([f32; 8]);

impl Plain {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Lanes for Plain {
    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn load_bits(from: &[u32; 8]) -> Self {
        Self(from.map(f32::from_bits))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn store_bits(self, to: &mut [u32; 8]) {
        *to = self.0.map(f32::to_bits);
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    fn splat_bits(bits: u32) -> Self {
        Self([f32::from_bits(bits); 8])
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
    fn pick(mask: Self, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|i| if mask.0[i].to_bits() != 0 { yes.0[i] } else { no.0[i] }))
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.iter().enumerate().fold(0, |bits, (i, lane)| bits | (lane.to_bits() >> 31) << i)
    }
}

/// Work that is written once for any lanes. `run` and all that it calls with lanes must be inlined.
pub(crate) trait Kernel {
    type Output;

    fn run<V: Lanes>(self) -> Self::Output;
}

/// Runs a kernel with the widest lanes that the machine has.
pub(crate) fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2, as was asked just now.
        return unsafe { run_wide(kernel) };
    }
    kernel.run::<Plain>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_wide<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<avx2::Wide>()
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! Lanes in a 256-bit register. Every method is inlined into `run_wide`, which runs on machines with AVX2 only: that is
    //! what the intrinsics ask for.
    use super::Lanes;
    use std::arch::x86_64::*;

    #[derive(Debug, Clone, Copy)]
    pub(super) struct Wide(__m256);

    impl Lanes for Wide {
        #[inline(always)]
        fn load(from: &[f32; 8]) -> Self {
            // SAFETY: AVX2 is there (see above), and 32 bytes are readable behind the reference.
            Self(unsafe { _mm256_loadu_ps(from.as_ptr()) })
        }

        #[inline(always)]
        fn load_bits(from: &[u32; 8]) -> Self {
            // SAFETY: as `load`; every bit pattern is a f32.
            Self(unsafe { _mm256_loadu_ps(from.as_ptr().cast()) })
        }

        #[inline(always)]
        fn store(self, to: &mut [f32; 8]) {
            // SAFETY: AVX2 is there (see above), and 32 bytes are writable behind the reference.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn store_bits(self, to: &mut [u32; 8]) {
            // SAFETY: as `store`; every bit pattern is a u32.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr().cast(), self.0) }
        }

        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_set1_ps(value) })
        }

        #[inline(always)]
        fn splat_bits(bits: u32) -> Self {
            Self::splat(f32::from_bits(bits))
        }

        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_add_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_sub_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_mul_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn above(self, other: Self) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0) })
        }

        #[inline(always)]
        fn and(self, other: Self) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_and_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn pick(mask: Self, yes: Self, no: Self) -> Self {
            // SAFETY: AVX2 is there (see above).
            Self(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
        }

        #[inline(always)]
        fn bits(self) -> u32 {
            // SAFETY: AVX2 is there (see above).
            (unsafe { _mm256_movemask_ps(self.0) }) as u32
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation on numbers that matter, as bits.
    struct All;

    impl Kernel for All {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<V: Lanes>(self) -> Vec<u32> {
            let a = V::load(&[1.5, -2.0, 0.0, -0.0, f32::INFINITY, f32::NAN, 1e-40, 7.0]);
            let b = V::load(&[1.5, 3.0, -0.0, 0.0, f32::NEG_INFINITY, 1.0, 1e-40, -7.0]);
            let mut out = Vec::new();
            let mask = b.above(a);
            for lanes in [a.add(b), a.sub(b), a.mul(b), mask, mask.and(a.above(V::splat(-9.0))), V::pick(mask, a, b)] {
                let mut bits = [0; 8];
                lanes.store_bits(&mut bits);
                // NaNs may differ in sign and payload.
                out.extend(bits.map(|b| if f32::from_bits(b).is_nan() && b != u32::MAX { 0x7fc0_0000 } else { b }));
            }
            let finite = [V::splat(2.0), V::load_bits(&[0x3f80_0000; 8]), V::splat_bits(0x4000_0000)];
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
        let plain = All.run::<Plain>();
        assert_eq!(dispatch(All), plain);
        assert_eq!(plain.last(), Some(&0b10));
    }
}
