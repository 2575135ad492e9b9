//! Where a row puts what four directions add to the cost: kept in the forward pass, summed up with
//! the other four in the backward pass.

#![allow(unsafe_code)]

use crate::simd::Bytes;
use crate::simd::prefetch::prefetch;

/// Destination of the results of a pass.
pub(super) trait Store: Copy {
    /// Whether the pass goes from right to left.
    const BACKWARD: bool;

    /// Asks for the memory of the forward pass at index `own` of the row's costs, which may lie
    /// outside the row.
    fn prefetch(self, own: usize);

    /// Returns the destination of one pixel: `own` is the index of its first cost in the row from
    /// left to right, `preceding` the number of hypotheses before it in the order of computation.
    ///
    /// # Safety
    /// The row has that many hypotheses.
    unsafe fn pixel(self, own: usize, preceding: usize) -> Self;

    /// Stores a vector of results from the pixel's hypothesis `at` on. `added` is what the
    /// directions add to the cost, two directions each; `cost` is the cost.
    ///
    /// # Safety
    /// `self` comes from [`Store::pixel`], and the row has `V::LANES` entries from that hypothesis
    /// on, those behind its last pixel included.
    unsafe fn store<V: Bytes>(self, token: V::Token, at: usize, added: [V; 2], cost: V);
}

/// Forward pass: stores half of what four directions add, rounded up, in the layout of the costs.
#[derive(Clone, Copy)]
pub(super) struct Forward(pub(super) *mut u8);

/// Backward pass: reads what the forward pass stored, and stores the sums of eight path costs.
#[derive(Clone, Copy)]
pub(super) struct Backward(pub(super) *const u8, pub(super) *mut u16);

impl Store for Forward {
    const BACKWARD: bool = false;

    #[inline(always)]
    fn prefetch(self, own: usize) {
        prefetch(self.0.wrapping_add(own));
    }

    #[inline(always)]
    unsafe fn pixel(self, own: usize, _: usize) -> Self {
        // SAFETY: the caller vouches that the row has `own` hypotheses, so the pointer stays inside
        // it.
        Self(unsafe { self.0.add(own) })
    }

    #[inline(always)]
    unsafe fn store<V: Bytes>(self, _: V::Token, at: usize, [a, b]: [V; 2], _: V) {
        // SAFETY: the caller vouches for `V::LANES` bytes from `at` on.
        unsafe { a.average(b).store(self.0.add(at)) }
    }
}

impl Store for Backward {
    const BACKWARD: bool = true;

    #[inline(always)]
    fn prefetch(self, own: usize) {
        prefetch(self.0.wrapping_add(own));
    }

    #[inline(always)]
    unsafe fn pixel(self, own: usize, preceding: usize) -> Self {
        // SAFETY: the caller vouches that the row has `own` and `preceding` hypotheses, so both
        // pointers stay inside their rows.
        unsafe { Self(self.0.add(own), self.1.add(preceding)) }
    }

    #[inline(always)]
    unsafe fn store<V: Bytes>(self, token: V::Token, at: usize, added: [V; 2], cost: V) {
        // SAFETY: the caller vouches for `V::LANES` bytes and words from `at` on, and the words
        // come from a slice of words, which is aligned.
        unsafe { V::store_weighted_sums(cost, V::load(token, self.0.add(at)), added, self.1.add(at)) }
    }
}
