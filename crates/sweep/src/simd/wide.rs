//! What the census and the sub-pixel shift need of a register of bytes and of 16-bit words.

#![allow(unsafe_code)]

/// A register that is read as bytes or as half as many 16-bit words.
///
/// Methods without a token are safe because a value exists only where its token did.
pub(crate) trait Wide: Copy {
    /// Length of the register, bytes.
    const BYTES: usize;
    /// Proof that the machine has the instructions.
    type Token: Copy;
    /// The register of 32 bytes that the same token allows.
    type Short: Wide;

    /// Returns the token of [`Self::Short`].
    fn short_token(token: Self::Token) -> <Self::Short as Wide>::Token;

    /// Reads a register from any address.
    ///
    /// # Safety
    /// [`Self::BYTES`] bytes from `from` on can be read.
    unsafe fn load<T>(token: Self::Token, from: *const T) -> Self;

    /// Writes the register to any address.
    ///
    /// # Safety
    /// [`Self::BYTES`] bytes from `to` on can be written.
    unsafe fn store<T>(self, to: *mut T);

    /// Copies a byte to all lanes.
    fn splat(token: Self::Token, byte: i8) -> Self;

    /// Copies a word to all lanes.
    fn splat_word(token: Self::Token, word: i16) -> Self;

    /// Bitwise and.
    fn and(self, other: Self) -> Self;

    /// Bitwise exclusive or.
    fn xor(self, other: Self) -> Self;

    /// Minima of unsigned bytes.
    fn min(self, other: Self) -> Self;

    /// Maxima of unsigned bytes.
    fn max(self, other: Self) -> Self;

    /// Differences of unsigned bytes, cut at 0.
    fn saturating_sub(self, other: Self) -> Self;

    /// Sums of unsigned bytes, cut at 255.
    fn saturating_add(self, other: Self) -> Self;

    /// Halves of the sums of unsigned bytes, rounded up.
    fn average(self, other: Self) -> Self;

    /// Sums of words, wrapping.
    fn wrapping_add_words(self, other: Self) -> Self;

    /// Sums of words, cut at the ends of their range.
    fn saturating_add_words(self, other: Self) -> Self;

    /// Differences of words, cut at the ends of their range.
    fn saturating_sub_words(self, other: Self) -> Self;

    /// Products of words in 2¹⁵ths, rounded.
    fn multiply_words(self, other: Self) -> Self;

    /// Words shifted right by a number of bits.
    fn shift_words_right(self, bits: i32) -> Self;

    /// Words of two registers as signed bytes, cut at the ends of their range.
    ///
    /// The instruction works in parts of 16 bytes, so that eight bytes of `self` and eight of
    /// `next` take turns; [`Wide::in_order`] brings them into the order of the words.
    fn pack(self, next: Self) -> Self;

    /// Brings the bytes of [`Wide::pack`] into the order of the words.
    fn in_order(self) -> Self;
}
