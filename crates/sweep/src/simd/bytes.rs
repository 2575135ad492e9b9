//! What the aggregation needs of a vector of unsigned bytes.

#![allow(unsafe_code)]

/// Farthest that [`Bytes::three_shifts`] may shift: no lane of the longest vector is left then.
pub(crate) const SHIFT_MAX: i32 = 33;

/// A vector of unsigned bytes.
///
/// Methods without a token are safe because a value exists only where its token did.
pub(crate) trait Bytes: Copy {
    /// Number of bytes.
    const LANES: usize;
    /// Proof that the machine has the instructions.
    type Token: Copy;
    /// A byte kept where [`Bytes::splat_first`] can copy it to all lanes.
    type First: Copy;

    /// Copies a byte to all lanes.
    fn splat(token: Self::Token, value: u8) -> Self;

    /// Copies a byte to all lanes.
    fn splat_first(first: Self::First) -> Self;

    /// Reads a vector from any address.
    ///
    /// # Safety
    /// [`Self::LANES`] bytes from `from` on can be read.
    unsafe fn load(token: Self::Token, from: *const u8) -> Self;

    /// Writes the vector to any address.
    ///
    /// # Safety
    /// [`Self::LANES`] bytes from `to` on can be written.
    unsafe fn store(self, to: *mut u8);

    /// Minima lane by lane.
    fn min(self, other: Self) -> Self;

    /// Sums lane by lane, cut at 255.
    fn saturating_add(self, other: Self) -> Self;

    /// Differences lane by lane, cut at 0.
    fn saturating_sub(self, other: Self) -> Self;

    /// Halves of the sums lane by lane, rounded up.
    fn average(self, other: Self) -> Self;

    /// Bitwise or.
    fn or(self, other: Self) -> Self;

    /// Lane `i` gets lane `i − 1`; the first lane gets the last one of `before`.
    fn preceded_by(self, before: Self) -> Self;

    /// Lane `i` gets lane `i + 1`; the last lane gets the first one of `next`.
    fn followed_by(self, next: Self) -> Self;

    /// Three vectors, in which lane `i` gets lane `i + by − 1`, `i + by` and `i + by + 1`; lanes
    /// from outside the vector are 255.
    ///
    /// # Safety
    /// `by` lies within ±[`SHIFT_MAX`].
    unsafe fn three_shifts(self, by: i32) -> [Self; 3];

    /// The first lane.
    fn first(self) -> Self::First;

    /// Writes the least lane of each of four vectors, and returns that of the first one.
    fn minima(four: [Self; 4], to: &mut [u8; 4]) -> Self::First;

    /// Writes `8 · eightfold + 2 · twofold + single[0] + single[1]`, lane by lane, as 16-bit words.
    ///
    /// # Safety
    /// [`Self::LANES`] words from `to` on can be written, and `to` is aligned for words.
    unsafe fn store_weighted_sums(eightfold: Self, twofold: Self, single: [Self; 2], to: *mut u16);
}

/// A token with the two vector lengths that the aggregation works with.
pub(crate) trait Instructions: Copy {
    /// A byte kept for copying to all lanes.
    type First: Copy;
    /// Vectors of 16 bytes.
    type Half: Bytes<Token = Self, First = Self::First>;
    /// Vectors of 32 bytes.
    type One: Bytes<Token = Self, First = Self::First>;

    /// Widens a vector; the new lanes are 255.
    fn widen(half: Self::Half) -> Self::One;

    /// Returns the first half of the lanes.
    fn lower_half(one: Self::One) -> Self::Half;
}
