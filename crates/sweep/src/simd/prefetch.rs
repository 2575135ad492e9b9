//! Hints that memory is wanted soon.

#![allow(unsafe_code)]

/// Asks the processor for the cache line at an address. The address may lie outside any allocation.
///
/// Does nothing on machines other than x86-64.
#[inline(always)]
pub(crate) fn prefetch<T>(at: *const T) {
    // SAFETY: the instruction is part of SSE, which every x86-64 machine has, and it reads nothing
    // that the program can observe, whatever the address.
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(at.cast());
    }
    #[cfg(any(not(target_arch = "x86_64"), miri))]
    let _ = at;
}
