//! Bytes and words side by side: AVX2 where the machine has it, AVX-512 where that gains something, plain arrays elsewhere, with the
//! same results.
//!
//! The only unsafe module of the crate.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
pub(crate) mod bytes;
pub(crate) mod prefetch;
#[cfg(target_arch = "x86_64")]
pub(crate) mod wide;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
pub(crate) use bytes::{Anywhere, Bytes, Instructions};
