//! Vectors of bytes and of 16-bit words: AVX2 and AVX-512 registers where the machine has them,
//! arrays elsewhere. Both give the same results, bit by bit.
//!
//! # Contract
//! A register type executes instructions that not every machine has. Its values are made only from
//! a token ([`Avx2`], `Avx512`), and only run-time detection makes tokens. A register at hand
//! therefore proves that the machine has the instructions, and its methods are safe. Methods that
//! take a pointer stay `unsafe`: the caller vouches for the memory.
//!
//! The compiler emits the instructions in line only inside a function that is compiled for them.
//! The `run` method of a token enters such a function with a [`Kernel`].
//!
//! # Miri
//! Miri detects no vector instructions, so that it runs the array types through the same kernels:
//!
//! ```text
//! export MIRIFLAGS=-Zmiri-disable-isolation
//! cargo +nightly miri test -p skysweep-sweep --lib -- \
//!     simd aggregation readout cost::census cost::shift cost::transpose
//! ```

#[cfg(target_arch = "x86_64")]
mod avx2;
mod byte_array;
pub(crate) mod bytes;
pub(crate) mod prefetch;
mod tokens;
pub(crate) mod wide;
pub(crate) mod wide_kernel;
#[cfg(target_arch = "x86_64")]
mod wide_registers;

pub(crate) use bytes::{Bytes, Instructions};
#[cfg(target_arch = "x86_64")]
pub(crate) use tokens::Avx2;
pub(crate) use tokens::{Arrays, Kernel};

#[cfg(test)]
mod tests;
