//! Rows of bytes turned into columns: planes of costs into the costs of each pixel.

#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
use crate::simd::Avx2;
use crate::simd::{Arrays, Kernel};

/// Columns that are turned together.
pub(super) const COLUMNS: usize = 16;
/// Rows that are turned together.
pub(super) const ROWS: usize = 32;

/// Turns the first columns of rows that begin `stride` bytes apart.
///
/// `columns` holds `depth` groups of [`ROWS`] bytes for each column, and a multiple of [`COLUMNS`]
/// columns. The last group of rows is filled up with what follows them in `bytes`.
///
/// # Panics
/// Panics if `bytes` is too short for whole groups.
pub(super) fn transpose(bytes: &[u8], stride: usize, rows: usize, depth: usize, columns: &mut [[u8; ROWS]]) {
    let kernel = Transpose { bytes, stride, rows, depth, columns };
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = Avx2::detect() {
        return avx2.run(kernel);
    }
    kernel.run(Arrays);
}

/// Arguments of [`transpose`].
struct Transpose<'a> {
    bytes: &'a [u8],
    stride: usize,
    rows: usize,
    depth: usize,
    columns: &'a mut [[u8; ROWS]],
}

impl Transpose<'_> {
    /// Calls `turn` for each group of rows and columns, with the bytes from its corner on and the
    /// destination of its first column.
    #[inline(always)]
    fn for_each_group(self, mut turn: impl FnMut(&[u8], &mut [[u8; ROWS]])) {
        let Self { bytes, stride, rows, depth, columns } = self;
        for (x, columns) in columns.chunks_exact_mut(COLUMNS * depth).enumerate() {
            for group in 0..rows.div_ceil(ROWS).min(depth) {
                let from = &bytes[group * ROWS * stride + x * COLUMNS..][..(ROWS - 1) * stride + COLUMNS];
                turn(from, &mut columns[group..]);
            }
        }
    }
}

impl Kernel<Arrays> for Transpose<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, _: Arrays) {
        let (stride, depth) = (self.stride, self.depth);
        self.for_each_group(|from, columns| turn(from, stride, depth, columns));
    }
}

#[inline(always)]
fn turn(from: &[u8], stride: usize, depth: usize, columns: &mut [[u8; ROWS]]) {
    for (y, row) in from.chunks(stride).take(ROWS).enumerate() {
        (0..COLUMNS).for_each(|x| columns[x * depth][y] = row[x]);
    }
}

#[cfg(target_arch = "x86_64")]
mod registers {
    use std::arch::x86_64::*;

    use super::{COLUMNS, ROWS, Transpose};
    use crate::simd::{Avx2, Kernel};

    impl Kernel<Avx2> for Transpose<'_> {
        type Output = ();

        #[inline(always)]
        fn run(self, token: Avx2) {
            let (stride, depth) = (self.stride, self.depth);
            self.for_each_group(|from, columns| turn(token, from, stride, depth, columns));
        }
    }

    #[inline(always)]
    fn turn(_: Avx2, from: &[u8], stride: usize, depth: usize, columns: &mut [[u8; ROWS]]) {
        assert!(from.len() >= (ROWS - 1) * stride + COLUMNS && columns.len() > (COLUMNS - 1) * depth);
        // SAFETY: the token proves that the machine has AVX2. Each of the 32 rows is read for 16
        // bytes from `y * stride` on, and each of the 16 columns is written whole at `x * depth`;
        // the lengths of both slices have just been checked.
        unsafe {
            let mut m = [_mm256_setzero_si256(); COLUMNS];
            for (y, m) in m.iter_mut().enumerate() {
                let upper = _mm_loadu_si128(from.as_ptr().add(y * stride).cast());
                let lower = _mm_loadu_si128(from.as_ptr().add((y + ROWS / 2) * stride).cast());
                *m = _mm256_inserti128_si256::<1>(_mm256_castsi128_si256(upper), lower);
            }
            // Laying row i beside row i + 8, byte by byte, moves one bit of the row's number into
            // the column's.
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
