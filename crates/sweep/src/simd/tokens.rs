//! Tokens that prove which instructions the machine has, and kernels that are compiled for them.

#![allow(unsafe_code)]

/// Work that is compiled anew for each kind of instructions.
///
/// Implementations of [`Kernel::run`] must be `#[inline(always)]`: they are then compiled inside
/// the function that the token's `run` enters, and the vector methods become single instructions.
pub(crate) trait Kernel<Token> {
    /// Result of the work.
    type Output;

    /// Does the work with the vectors that the token allows.
    fn run(self, token: Token) -> Self::Output;
}

/// Token of the array types, which need no particular instructions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arrays;

/// Proof that the machine has AVX2. Only [`Avx2::detect`] makes one.
#[cfg(target_arch = "x86_64")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2(());

#[cfg(target_arch = "x86_64")]
impl Avx2 {
    /// Returns the token if the machine has AVX2. Under Miri there is none.
    #[inline(always)]
    pub(crate) fn detect() -> Option<Self> {
        std::is_x86_feature_detected!("avx2").then_some(Self(()))
    }

    /// Runs a kernel in a function that is compiled for AVX2.
    #[inline(always)]
    pub(crate) fn run<K: Kernel<Self>>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx2")]
        fn compiled_for_avx2<K: Kernel<Avx2>>(token: Avx2, kernel: K) -> K::Output {
            kernel.run(token)
        }
        // SAFETY: the only requirement is that the machine has AVX2, which `self` proves.
        unsafe { compiled_for_avx2(self, kernel) }
    }
}

/// Proof that the machine has AVX-512 with byte and word instructions, of a generation whose clock
/// they do not slow down. Only [`Avx512::detect`] makes one.
#[cfg(target_arch = "x86_64")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx512(Avx2);

#[cfg(target_arch = "x86_64")]
impl Avx512 {
    /// Returns the token if the machine is of the generation of Ice Lake or Zen 4, or later.
    ///
    /// VBMI2, VPOPCNTDQ and GFNI came with these generations. Earlier ones lower their clock when
    /// they execute AVX-512.
    #[inline(always)]
    pub(crate) fn detect() -> Option<Self> {
        let has_all = std::is_x86_feature_detected!("avx512bw")
            && std::is_x86_feature_detected!("avx512vl")
            && std::is_x86_feature_detected!("avx512vbmi2")
            && std::is_x86_feature_detected!("avx512vpopcntdq")
            && std::is_x86_feature_detected!("gfni");
        Avx2::detect().filter(|_| has_all).map(Self)
    }

    /// Returns the token of AVX2, which every machine with AVX-512 has.
    #[inline(always)]
    pub(crate) fn avx2(self) -> Avx2 {
        self.0
    }

    /// Runs a kernel in a function that is compiled for AVX-512.
    #[inline(always)]
    pub(crate) fn run<K: Kernel<Self>>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx2,avx512f,avx512bw,avx512vl")]
        fn compiled_for_avx512<K: Kernel<Avx512>>(token: Avx512, kernel: K) -> K::Output {
            kernel.run(token)
        }
        // SAFETY: the only requirement is that the machine has AVX2, AVX-512F, BW and VL. `self`
        // proves AVX2, BW and VL, and no machine has BW without F.
        unsafe { compiled_for_avx512(self, kernel) }
    }
}
