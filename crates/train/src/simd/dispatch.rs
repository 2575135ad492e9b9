//! Chooses the instruction set.

use super::lanes::Kernel;
use super::plain::Plain;

/// The registers that a rasteriser works with. Every choice gives the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Registers {
    /// The longest that the machine has.
    #[default]
    Longest,
    /// At most 256 bits, to measure what longer ones gain.
    AtMost256,
    /// None: plain Rust, against which the others are tested.
    Plain,
}

/// Asks for memory that is read soon, where the architecture has an instruction for it.
#[inline(always)]
pub(crate) fn prefetch<T>(soon: &T) {
    #[cfg(target_arch = "x86_64")]
    super::avx2::prefetch(soon);
    let _ = soon;
}

/// Runs a kernel with the wanted registers, or with shorter ones where the machine lacks them.
pub(crate) fn dispatch<K: Kernel>(registers: Registers, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        let longest = (registers == Registers::Longest).then(super::avx512::Avx512::detect).flatten();
        if let Some(isa) = longest {
            return isa.run(kernel);
        }
        let shorter = (registers != Registers::Plain).then(super::avx2::Avx2::detect).flatten();
        if let Some(isa) = shorter {
            return isa.run(kernel);
        }
    }
    let _ = registers;
    kernel.run(Plain)
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Block, InstructionSet, Lanes, exp2};
    use super::*;

    /// The bits of every operation on some numbers.
    #[derive(Clone, Copy)]
    struct All<'a>(&'a [Block; 16]);

    impl Kernel for All<'_> {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<I: InstructionSet>(self, isa: I) -> Vec<u32> {
            let blocks = self.0;
            let (mut kept, mut totals) = ([Block::ZERO; 16], [0.0; 16]);
            let mut results = [Block::ZERO; 12];
            let (mut marked, mut again) = (0, 0);
            for part in 0..I::PARTS {
                let mut lanes = [isa.splat(0.0); 16];
                for (lanes, block) in lanes.iter_mut().zip(blocks) {
                    *lanes = isa.load(block, part);
                }
                totals = isa.totals(lanes, part, &mut kept);
                let [a, b, c] = [0, 1, 2].map(|i| isa.load(&blocks[i], part));
                let mask = a.at_most(b);
                let other = b.at_most(c);
                let made = [
                    a.add(b),
                    a.sub(b),
                    a.mul(b),
                    a.div(b),
                    a.mul_add(b, c),
                    a.neg_mul_add(b, c),
                    a.min(b),
                    a.max(b),
                    a.or_else(mask, b),
                    a.only(I::Lanes::both(mask, other)),
                    exp2(isa, a.min(isa.splat(-0.25)).mul(isa.splat(9.0))),
                ];
                for (result, lanes) in results.iter_mut().zip(made) {
                    lanes.store(result, part);
                }
                marked |= I::Lanes::bits(mask, part);
                again |= I::Lanes::bits(isa.mask(0xb16d, part), part);
            }
            let mut bits: Vec<u32> = totals.map(f32::to_bits).into();
            bits.extend([u32::from(marked), u32::from(again)]);
            bits.extend(results.iter().flat_map(|block| block.0.map(f32::to_bits)));
            bits
        }
    }

    #[test]
    fn registers_of_every_length_give_the_bits_of_plain_code() {
        // Made once: a sine that the compiler works out may differ from the library's in a bit.
        let all = All(&std::array::from_fn(|k| Block(std::array::from_fn(|i| ((k * 16 + i) as f32).sin() * 3.0))));
        let plain = dispatch(Registers::Plain, all);
        assert_eq!(dispatch(Registers::AtMost256, all), plain);
        assert_eq!(dispatch(Registers::Longest, all), plain);
    }

    struct Exp2(f32);

    impl Kernel for Exp2 {
        type Output = f32;

        #[inline(always)]
        fn run<I: InstructionSet>(self, isa: I) -> f32 {
            let mut out = Block::ZERO;
            exp2(isa, isa.splat(self.0)).store(&mut out, 0);
            out.0[0]
        }
    }

    #[test]
    fn the_exponential_is_precise() {
        for i in 0..=12_000 {
            let x = -i as f32 / 100.0;
            let (found, truth) = (f64::from(dispatch(Registers::Longest, Exp2(x))), f64::from(x).exp2());
            assert!((found / truth - 1.0).abs() < 3e-7, "2^{x} = {truth}, found {found}");
        }
    }
}
