//! What a kernel may do with lanes.

/// Pixels of a block.
pub(crate) const LANES: usize = 16;

/// One value for each pixel of a block. The alignment is that of the longest register.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Block(pub(crate) [f32; LANES]);

impl Block {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);
}

/// Returns the sum of a block in the order of [`InstructionSet::totals`].
pub(crate) fn total(block: &Block) -> f32 {
    let v = &block.0;
    let e: [f32; 8] = std::array::from_fn(|i| v[i] + v[i + 8]);
    ((e[0] + e[1]) + (e[2] + e[3])) + ((e[4] + e[5]) + (e[6] + e[7]))
}

/// Makes lanes. Having a value of such a type proves that the machine has its instructions.
pub(crate) trait InstructionSet: Copy {
    /// The lanes of one register, which hold a part of a block.
    type Lanes: Lanes;

    /// Registers that a block takes: 1 or 2.
    const PARTS: usize;

    /// Loads a part of a block.
    fn load(self, from: &Block, part: usize) -> Self::Lanes;

    /// Copies a value to all lanes.
    fn splat(self, value: f32) -> Self::Lanes;

    /// Asks for memory that is read soon.
    fn prefetch<T>(self, soon: &T);

    /// Returns the mask of a part whose lanes are the bits of a block, as [`Lanes::bits`] gives
    /// them.
    fn mask(self, bits: u16, part: usize) -> <Self::Lanes as Lanes>::Mask;

    /// Returns the sums of sixteen blocks, whose parts come one after another: the sums with the
    /// last part, any values before it. `kept` holds the parts that came. Lanes that are 8, then 1,
    /// 2 and 4 apart are added in turn.
    fn totals(self, lanes: [Self::Lanes; 16], part: usize, kept: &mut [Block; 16]) -> [f32; 16];
}

/// The lanes of one register.
pub(crate) trait Lanes: Copy {
    /// One truth value per lane.
    type Mask: Copy;

    /// Stores into a part of a block.
    fn store(self, to: &mut Block, part: usize);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// Returns `self · factor + term`, rounded once.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// Returns `term − self · factor`, rounded once.
    fn neg_mul_add(self, factor: Self, term: Self) -> Self;
    /// Returns the smaller value, and `other` where either is NaN.
    fn min(self, other: Self) -> Self;
    /// Returns the larger value, and `other` where either is NaN.
    fn max(self, other: Self) -> Self;
    /// Returns where `self ≤ other`; false where either is NaN.
    fn at_most(self, other: Self) -> Self::Mask;
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Takes `self` where the mask is set and `other` elsewhere.
    fn or_else(self, mask: Self::Mask, other: Self) -> Self;
    /// Takes `self` where the mask is set and 0 elsewhere.
    fn only(self, mask: Self::Mask) -> Self;
    /// Returns whether any lane of the mask is set.
    fn any(mask: Self::Mask) -> bool;
    /// Returns the lanes of the mask as the bits that they have in a block.
    fn bits(mask: Self::Mask, part: usize) -> u16;
    /// Multiplies by 2ⁿ, where the lowest bits of `shifted` hold the integer n, |n| < 120.
    fn scaled(self, shifted: Self) -> Self;
}

/// Work that is written once for every instruction set.
///
/// `run` and everything that it calls with lanes must be `#[inline(always)]`, so that the whole
/// becomes one function compiled for the instruction set.
pub(crate) trait Kernel {
    type Output;

    fn run<I: InstructionSet>(self, isa: I) -> Self::Output;
}

/// Returns 2ˣ for −120 ≤ x ≤ 0 with a relative error below 3e-7. The values of other x are any.
///
/// x = n + f with |f| ≤ 1/2, and 2ᶠ by a polynomial of degree 5 with the least relative error
/// (9e-8) among those that are 1 at 0.
#[inline(always)]
pub(crate) fn exp2<I: InstructionSet>(isa: I, x: I::Lanes) -> I::Lanes {
    // Adding 1.5 · 2²³ rounds to an integer, which is then in the lowest bits.
    let shifter = isa.splat(12_582_912.0);
    let shifted = x.add(shifter);
    let f = x.sub(shifted.sub(shifter));
    let mut p = isa.splat(1.326_473_7e-3);
    for c in [9.671_517e-3, 5.550_733_6e-2, 0.240_222_42, 0.693_147_06, 1.0] {
        p = p.mul_add(f, isa.splat(c));
    }
    p.scaled(shifted)
}
