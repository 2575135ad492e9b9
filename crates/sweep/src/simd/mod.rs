//! Bytes and words side by side: AVX2 where the machine has it, AVX-512 where that gains something, plain arrays elsewhere, with the
//! same results.
//!
//! The only unsafe module of the crate.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
mod bytes;
pub(crate) mod census;
pub(crate) mod paths;
pub(crate) mod pixel;
pub(crate) mod raise;
pub(crate) mod rows;
pub(crate) mod shift;
pub(crate) mod sums;
pub(crate) mod transpose;
#[cfg(target_arch = "x86_64")]
mod wide;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
pub(crate) use bytes::{Anywhere, Instructions};

/// Asks for the memory of an element that is wanted soon, which need not be one's own; where machines do not take such hints
/// that means nothing.
#[inline(always)]
pub(crate) fn fetch<T>(at: *const T) {
    // SAFETY: a hint reads nothing.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(at.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}
