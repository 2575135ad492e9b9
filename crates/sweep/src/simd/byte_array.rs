//! Vectors of bytes as arrays, for any machine.

#![allow(unsafe_code)]

use super::bytes::{Bytes, Instructions};
use super::tokens::Arrays;

/// Bytes as an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ByteArray<const N: usize>([u8; N]);

impl Instructions for Arrays {
    type First = u8;
    type Half = ByteArray<16>;
    type One = ByteArray<32>;

    #[inline(always)]
    fn widen(half: ByteArray<16>) -> ByteArray<32> {
        ByteArray(std::array::from_fn(|i| half.0.get(i).copied().unwrap_or(u8::MAX)))
    }

    #[inline(always)]
    fn lower_half(one: ByteArray<32>) -> ByteArray<16> {
        ByteArray(std::array::from_fn(|i| one.0[i]))
    }
}

impl<const N: usize> ByteArray<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(u8, u8) -> u8) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    /// Lane `i` gets lane `i + by`, or `outside` where there is none.
    #[inline(always)]
    fn shifted(self, by: i32, outside: u8) -> Self {
        Self(std::array::from_fn(|i| {
            usize::try_from(i as i32 + by).ok().and_then(|i| self.0.get(i)).copied().unwrap_or(outside)
        }))
    }
}

impl<const N: usize> Bytes for ByteArray<N> {
    const LANES: usize = N;
    type Token = Arrays;
    type First = u8;

    #[inline(always)]
    fn splat(_: Arrays, value: u8) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn splat_first(first: u8) -> Self {
        Self([first; N])
    }

    #[inline(always)]
    unsafe fn load(_: Arrays, from: *const u8) -> Self {
        // SAFETY: an array of bytes has no alignment, and the caller vouches for `N` readable
        // bytes.
        Self(unsafe { from.cast::<[u8; N]>().read() })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u8) {
        // SAFETY: an array of bytes has no alignment, and the caller vouches for `N` writable
        // bytes.
        unsafe { to.cast::<[u8; N]>().write(self.0) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, u8::min)
    }

    #[inline(always)]
    fn saturating_add(self, other: Self) -> Self {
        self.zip(other, u8::saturating_add)
    }

    #[inline(always)]
    fn saturating_sub(self, other: Self) -> Self {
        self.zip(other, u8::saturating_sub)
    }

    #[inline(always)]
    fn average(self, other: Self) -> Self {
        self.zip(other, |a, b| a.midpoint(b) + ((a ^ b) & 1))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.zip(other, |a, b| a | b)
    }

    #[inline(always)]
    fn preceded_by(self, before: Self) -> Self {
        self.shifted(-1, before.0[N - 1])
    }

    #[inline(always)]
    fn followed_by(self, next: Self) -> Self {
        self.shifted(1, next.0[0])
    }

    #[inline(always)]
    unsafe fn three_shifts(self, by: i32) -> [Self; 3] {
        [self.shifted(by - 1, u8::MAX), self.shifted(by, u8::MAX), self.shifted(by + 1, u8::MAX)]
    }

    #[inline(always)]
    fn first(self) -> u8 {
        self.0[0]
    }

    #[inline(always)]
    fn minima(four: [Self; 4], to: &mut [u8; 4]) -> u8 {
        *to = four.map(|v| v.0.iter().fold(u8::MAX, |least, lane| least.min(*lane)));
        to[0]
    }

    #[inline(always)]
    unsafe fn store_weighted_sums(eightfold: Self, twofold: Self, [a, b]: [Self; 2], to: *mut u16) {
        let word = |v: Self, i: usize| u16::from(v.0[i]);
        let sum = |i: usize| 8 * word(eightfold, i) + 2 * word(twofold, i) + word(a, i) + word(b, i);
        // SAFETY: the caller vouches for `N` writable words and for their alignment.
        unsafe { to.cast::<[u16; N]>().write(std::array::from_fn(sum)) }
    }
}
