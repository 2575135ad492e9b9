//! Rows of bytes turned into columns.

#![allow(unsafe_code)]

use multiversion::multiversion;
use multiversion::target::match_target;

/// Columns that are turned together.
pub(crate) const COLUMNS: usize = 16;
/// Rows that are turned together.
pub(crate) const ROWS: usize = 32;

/// The first columns of rows that begin `stride` apart: `rows` of them in groups of [`ROWS`], the last of which is filled up
/// with what follows. There are `columns.len() / depth` columns, in groups of [`COLUMNS`], of `depth` groups each.
///
/// # Panics
/// Fewer bytes, or groups of fewer columns.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn transpose(bytes: &[u8], stride: usize, rows: usize, depth: usize, columns: &mut [[u8; ROWS]]) {
    for (x, columns) in columns.chunks_exact_mut(COLUMNS * depth).enumerate() {
        for group in 0..rows.div_ceil(ROWS).min(depth) {
            let from = &bytes[group * ROWS * stride + x * COLUMNS..][..(ROWS - 1) * stride + COLUMNS];
            match_target! {
                "x86_64+avx2" => registers::turn(from, stride, depth, &mut columns[group..]),
                _ => turn(from, stride, depth, &mut columns[group..]),
            }
        }
    }
}

#[cfg_attr(target_arch = "x86_64", allow(dead_code, reason = "for machines without AVX2"))]
#[inline(always)]
fn turn(from: &[u8], stride: usize, depth: usize, columns: &mut [[u8; ROWS]]) {
    for (y, row) in from.chunks(stride).take(ROWS).enumerate() {
        (0..COLUMNS).for_each(|x| columns[x * depth][y] = row[x]);
    }
}

/// For functions that are compiled for AVX2, and nowhere else.
#[cfg(target_arch = "x86_64")]
mod registers {
    use super::{COLUMNS, ROWS};
    use std::arch::x86_64::*;

    #[inline(always)]
    pub(super) fn turn(from: &[u8], stride: usize, depth: usize, columns: &mut [[u8; ROWS]]) {
        assert!(from.len() >= (ROWS - 1) * stride + COLUMNS && columns.len() > (COLUMNS - 1) * depth);
        // SAFETY: the instructions are those of AVX2, for whose functions alone this is; every register that is read or written
        // lies in the slices, whose lengths are checked.
        unsafe {
            let mut m = [_mm256_setzero_si256(); COLUMNS];
            for (y, m) in m.iter_mut().enumerate() {
                let upper = _mm_loadu_si128(from.as_ptr().add(y * stride).cast());
                let lower = _mm_loadu_si128(from.as_ptr().add((y + ROWS / 2) * stride).cast());
                *m = _mm256_inserti128_si256::<1>(_mm256_castsi128_si256(upper), lower);
            }
            // Laying row i beside row i + 8, byte by byte, moves one bit of the row's number into the column's.
            for _ in 0..4 {
                let before = m;
                for i in 0..COLUMNS / 2 {
                    m[2 * i] = _mm256_unpacklo_epi8(before[i], before[i + COLUMNS / 2]);
                    m[2 * i + 1] = _mm256_unpackhi_epi8(before[i], before[i + COLUMNS / 2]);
                }
            }
            for (x, m) in m.into_iter().enumerate() {
                _mm256_storeu_si256(columns.as_mut_ptr().add(x * depth).cast(), m);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_become_rows() {
        let (stride, depth) = (37, 3);
        let bytes: Vec<u8> = (0..64 * stride).map(|i| (i * 7 % 251) as u8).collect();
        let mut columns = [[0; ROWS]; 2 * COLUMNS * 3];
        transpose(&bytes, stride, 50, depth, &mut columns);
        let mut plain = [[0; ROWS]; COLUMNS];
        turn(&bytes, stride, 1, &mut plain);
        for x in 0..2 * COLUMNS {
            let column = columns[x * depth..][..depth].as_flattened();
            assert!((0..64).all(|y| column[y] == bytes[y * stride + x]) && column[64..] == [0; ROWS]);
            assert!(x >= COLUMNS || plain[x] == column[..ROWS]);
        }
    }
}
