//! Lanes in an array, on every machine.

use super::lanes::{Block, InstructionSet, LANES, Lanes};

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
    fn totals(self, blocks: &[Block; 16]) -> [f32; 16] {
        std::array::from_fn(|k| {
            let v = &blocks[k].0;
            let e: [f32; 8] = std::array::from_fn(|i| v[i] + v[i + 8]);
            ((e[0] + e[1]) + (e[2] + e[3])) + ((e[4] + e[5]) + (e[6] + e[7]))
        })
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
    fn only_first(a: [bool; LANES], b: [bool; LANES]) -> [bool; LANES] {
        std::array::from_fn(|i| a[i] && !b[i])
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
    fn count(mask: [bool; LANES]) -> u32 {
        mask.iter().map(|&set| u32::from(set)).sum()
    }

    #[inline(always)]
    fn scaled(self, shifted: Self) -> Self {
        self.zip(shifted, |a, s| f32::from_bits(a.to_bits().wrapping_add(s.to_bits() << 23)))
    }
}
