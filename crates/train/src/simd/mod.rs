//! Sixteen f32 values side by side: AVX-512, AVX2 with fused multiply-add, or plain arrays.
//!
//! A kernel is written once, generic over an [`InstructionSet`]. The value of that type is a token,
//! which only detection can make, and lanes are only made from a token. So no safe function reaches
//! an instruction that the machine lacks. All sets round in the same way: products that are added
//! are fused everywhere, divisions are exact, and totals are added in one order. The same scene
//! therefore gives the same bits with each of them.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod dispatch;
mod lanes;
mod plain;

pub use dispatch::Registers;
pub(crate) use dispatch::{dispatch, prefetch};
pub(crate) use lanes::{Block, InstructionSet, Kernel, LANES, Lanes, exp2};
