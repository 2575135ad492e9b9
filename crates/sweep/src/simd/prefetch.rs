//! Hints that memory is wanted soon.

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
