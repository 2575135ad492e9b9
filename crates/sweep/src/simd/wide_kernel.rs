//! Kernels that work with the longest registers of the machine.

use super::wide::Wide;

/// Work for registers of any length, with a plain form for machines without them.
pub(crate) trait WideKernel: Sized {
    /// Does the work with registers. Implementations must be `#[inline(always)]`.
    #[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "there are no registers"))]
    fn run<V: Wide>(self, token: V::Token);

    /// Does the work without registers, with the same results.
    fn run_plain(self);
}

/// Runs a kernel with the longest registers of the machine, or in its plain form.
pub(crate) fn run_wide(kernel: impl WideKernel) {
    #[cfg(target_arch = "x86_64")]
    {
        use registers::OnRegisters;
        if let Some(avx512) = super::tokens::Avx512::detect() {
            return avx512.run(OnRegisters(kernel));
        }
        if let Some(avx2) = super::tokens::Avx2::detect() {
            return avx2.run(OnRegisters(kernel));
        }
    }
    kernel.run_plain();
}

/// Runs a kernel with AVX2, whatever else the machine has. Returns `false` where it has no AVX2.
#[cfg(test)]
pub(crate) fn run_with_avx2(kernel: impl WideKernel) -> bool {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = super::tokens::Avx2::detect() {
        avx2.run(registers::OnRegisters(kernel));
        return true;
    }
    drop(kernel);
    false
}

#[cfg(target_arch = "x86_64")]
mod registers {
    use super::super::tokens::{Avx2, Avx512, Kernel};
    use super::super::wide_registers::{Wide256, Wide512};
    use super::WideKernel;

    /// Runs a kernel with the registers that a token allows.
    pub(super) struct OnRegisters<K>(pub(super) K);

    impl<K: WideKernel> Kernel<Avx2> for OnRegisters<K> {
        type Output = ();

        #[inline(always)]
        fn run(self, token: Avx2) {
            self.0.run::<Wide256>(token);
        }
    }

    impl<K: WideKernel> Kernel<Avx512> for OnRegisters<K> {
        type Output = ();

        #[inline(always)]
        fn run(self, token: Avx512) {
            self.0.run::<Wide512>(token);
        }
    }
}
