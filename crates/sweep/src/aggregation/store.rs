//! What becomes of the path costs of a pixel.

#![allow(unsafe_code)]

use crate::simd::Bytes;
use crate::simd::prefetch::fetch;

/// Where the results of a pixel go.
pub(super) trait Store: Copy {
    const BACKWARD: bool;
    /// Asks for the memory of what the first half of the directions adds at a pixel whose costs are the row's from `own` on; it need
    /// not be one of the row's.
    fn fetch(self, own: usize);
    /// That of the pixel whose costs are the row's from `own` on, with so many before it in the order of the row.
    ///
    /// # Safety
    /// The row has as many.
    unsafe fn pixel(self, own: usize, before: usize) -> Self;
    /// Stores what is to be told of the hypotheses from `at` on: of what was added, the sums of two paths each, and the costs.
    ///
    /// # Safety
    /// There are as many as a register has lanes.
    unsafe fn store<V: Bytes>(self, at: usize, added: [V; 2], cost: V);
}

#[derive(Clone, Copy)]
pub(super) struct Forward(pub(super) *mut u8);

#[derive(Clone, Copy)]
pub(super) struct Backward(pub(super) *const u8, pub(super) *mut u16);

// SAFETY of both below: the caller's.
impl Store for Forward {
    const BACKWARD: bool = false;

    #[inline(always)]
    fn fetch(self, own: usize) {
        fetch(self.0.wrapping_add(own));
    }

    #[inline(always)]
    unsafe fn pixel(self, own: usize, _: usize) -> Self {
        // SAFETY: as above.
        Self(unsafe { self.0.add(own) })
    }

    #[inline(always)]
    unsafe fn store<V: Bytes>(self, at: usize, [a, b]: [V; 2], _: V) {
        // SAFETY: as above.
        unsafe { a.average(b).store(self.0.add(at)) }
    }
}

impl Store for Backward {
    const BACKWARD: bool = true;

    #[inline(always)]
    fn fetch(self, own: usize) {
        fetch(self.0.wrapping_add(own));
    }

    #[inline(always)]
    unsafe fn pixel(self, own: usize, before: usize) -> Self {
        // SAFETY: as above.
        unsafe { Self(self.0.add(own), self.1.add(before)) }
    }

    #[inline(always)]
    unsafe fn store<V: Bytes>(self, at: usize, added: [V; 2], cost: V) {
        // SAFETY: as above.
        unsafe { V::store_sums(cost, V::load(self.0.add(at)), added, self.1.add(at)) }
    }
}
