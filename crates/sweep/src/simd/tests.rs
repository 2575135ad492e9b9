//! Arrays and registers compared, method by method.

#![allow(unsafe_code)]

use proptest::prelude::*;

use super::byte_array::ByteArray;
use super::bytes::{Bytes, Instructions, SHIFT_MAX};
use super::tokens::Arrays;

/// Results of every method of `V` on some bytes.
fn results<V: Bytes>(token: V::Token, bytes: &[u8], by: i32) -> (Vec<Vec<u8>>, Vec<u16>, [u8; 4]) {
    let n = V::LANES;
    // SAFETY: the slice has as many bytes as the vector has lanes.
    let load = |i: usize| unsafe { V::load(token, bytes[i * n..][..n].as_ptr()) };
    let four: [V; 4] = std::array::from_fn(load);
    let [a, b, c, d] = four;
    let mut minima = [0; 4];
    let least = V::splat_first(V::minima(four, &mut minima));
    let made = [
        a.min(b),
        a.saturating_add(b),
        a.saturating_sub(b),
        c.or(d),
        a.preceded_by(b),
        a.followed_by(b),
        V::splat(token, bytes[0]),
        a.average(b),
    ];
    // SAFETY: the tests draw `by` from within ±SHIFT_MAX.
    let shifted = unsafe { a.three_shifts(by) };
    let all = made.into_iter().chain(shifted).chain([V::splat_first(a.first()), least]);
    let stored = all.map(|v| {
        let mut out = vec![0; n];
        // SAFETY: `out` has as many bytes as the vector has lanes.
        unsafe { v.store(out.as_mut_ptr()) };
        out
    });
    let mut sums = vec![0; n];
    // SAFETY: `sums` has as many words as the vector has lanes.
    unsafe { V::store_weighted_sums(a, b, [c, d], sums.as_mut_ptr()) };
    (stored.collect(), sums, minima)
}

/// The lower half of a vector, and a half widened.
fn halves<I: Instructions>(token: I, bytes: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let (mut half, mut one) = (vec![0; 16], vec![0; 32]);
    // SAFETY: all slices are as long as the vectors.
    unsafe {
        I::lower_half(I::One::load(token, bytes[..32].as_ptr())).store(half.as_mut_ptr());
        I::widen(I::Half::load(token, bytes[..16].as_ptr())).store(one.as_mut_ptr());
    }
    (half, one)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: if cfg!(miri) { 4 } else { 256 }, ..ProptestConfig::default() })]

    #[test]
    fn registers_do_what_arrays_do(bytes in prop::collection::vec(any::<u8>(), 128), by in -SHIFT_MAX..=SHIFT_MAX) {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = super::tokens::Avx2::detect() {
            use super::avx2::{Bytes16, Bytes32};
            prop_assert_eq!(results::<Bytes16>(avx2, &bytes, by), results::<ByteArray<16>>(Arrays, &bytes, by));
            prop_assert_eq!(results::<Bytes32>(avx2, &bytes, by), results::<ByteArray<32>>(Arrays, &bytes, by));
            prop_assert_eq!(halves(avx2, &bytes), halves(Arrays, &bytes));
        }
        let (stored, sums, minima) = results::<ByteArray<16>>(Arrays, &bytes, by);
        prop_assert_eq!(stored[1][3], bytes[3].saturating_add(bytes[19]));
        prop_assert_eq!((stored[4][0], stored[4][5], stored[5][15]), (bytes[31], bytes[4], bytes[16]));
        let [a, b, c, d] = [5, 21, 37, 53].map(|i| u16::from(bytes[i]));
        prop_assert_eq!((u16::from(stored[7][5]), sums[5]), ((a + b).div_ceil(2), 8 * a + 2 * b + c + d));
        for (four, least) in bytes.chunks(16).zip(minima) {
            prop_assert_eq!(four.iter().min(), Some(&least));
        }
        prop_assert_eq!((stored[11][7], stored[12][7]), (bytes[0], minima[0]));
        for (shifted, by) in stored[8..11].iter().zip(by - 1..=by + 1) {
            let at = usize::try_from(by + 4).ok().filter(|at| *at < 16);
            prop_assert_eq!(shifted[4], at.map_or(u8::MAX, |at| bytes[at]));
        }
    }
}
