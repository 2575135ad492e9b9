//! Lanes in an array, on every machine.

use super::lanes::{Block, InstructionSet, LANES, Lanes, total};

/// Plain Rust.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain;

/// Lanes in an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlainLanes([f32; LANES]);

impl InstructionSet for Plain {
    type Lanes = PlainLanes;

    const PARTS: usize = 1;

    #[inline(always)]
    fn load(self, from: &Block, _: usize) -> PlainLanes {
        PlainLanes(from.0)
    }

    #[inline(always)]
    fn splat(self, value: f32) -> PlainLanes {
        PlainLanes([value; LANES])
    }

    #[inline(always)]
    fn prefetch<T>(self, _: &T) {}

    #[inline(always)]
    fn mask(self, bits: u16, _: usize) -> [bool; LANES] {
        std::array::from_fn(|i| bits >> i & 1 == 1)
    }

    #[inline(always)]
    fn totals(self, lanes: [PlainLanes; 16], _: usize, _: &mut [Block; 16]) -> [f32; 16] {
        lanes.map(|lanes| total(&Block(lanes.0)))
    }
}

impl PlainLanes {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Lanes for PlainLanes {
    type Mask = [bool; LANES];

    #[inline(always)]
    fn store(self, to: &mut Block, _: usize) {
        to.0 = self.0;
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].mul_add(factor.0[i], term.0[i])))
    }

    #[inline(always)]
    fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        Self(std::array::from_fn(|i| (-self.0[i]).mul_add(factor.0[i], term.0[i])))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> [bool; LANES] {
        std::array::from_fn(|i| self.0[i] <= other.0[i])
    }

    #[inline(always)]
    fn both(a: [bool; LANES], b: [bool; LANES]) -> [bool; LANES] {
        std::array::from_fn(|i| a[i] && b[i])
    }

    #[inline(always)]
    fn or_else(self, mask: [bool; LANES], other: Self) -> Self {
        Self(std::array::from_fn(|i| if mask[i] { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn only(self, mask: [bool; LANES]) -> Self {
        Self(std::array::from_fn(|i| if mask[i] { self.0[i] } else { 0.0 }))
    }

    #[inline(always)]
    fn any(mask: [bool; LANES]) -> bool {
        mask.contains(&true)
    }

    #[inline(always)]
    fn bits(mask: [bool; LANES], _: usize) -> u16 {
        (0..LANES).fold(0, |bits, i| bits | u16::from(mask[i]) << i)
    }

    #[inline(always)]
    fn scaled(self, shifted: Self) -> Self {
        self.zip(shifted, |a, s| f32::from_bits(a.to_bits().wrapping_add(s.to_bits() << 23)))
    }
}
