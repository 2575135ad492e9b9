//! Bytes raised where others are marked.

#![allow(unsafe_code)]

use multiversion::multiversion;
use multiversion::target::match_target;

/// Bytes in a register, half of the largest: rows are often short.
const LANES: usize = 16;

/// Raises `width` bytes of each row that `is_marked` to `worst` where `marks` has 255, not 0; rows begin as far apart as is said.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn raise(
    (bytes, bytes_stride): (&mut [u8], usize),
    (marks, marks_stride): (&[u8], usize),
    is_marked: &[bool],
    width: usize,
    worst: u8,
) {
    for (y, _) in is_marked.iter().enumerate().filter(|(_, is_marked)| **is_marked) {
        let (bytes, marks) = (&mut bytes[y * bytes_stride..][..width], &marks[y * marks_stride..][..width]);
        match_target! {
            "x86_64+avx2" => registers::raise_row(bytes, marks, worst),
            _ => raise_row(bytes, marks, worst),
        };
    }
}

#[inline(always)]
fn raise_row(bytes: &mut [u8], marks: &[u8], worst: u8) {
    bytes.iter_mut().zip(marks).for_each(|(byte, mark)| *byte = (*byte).max(mark & worst));
}

/// For functions that are compiled for AVX2, and nowhere else.
#[cfg(target_arch = "x86_64")]
mod registers {
    use super::LANES;
    use std::arch::x86_64::*;

    #[inline(always)]
    pub(super) fn raise_row(bytes: &mut [u8], marks: &[u8], worst: u8) {
        let Some(last) = bytes.len().min(marks.len()).checked_sub(LANES) else {
            return super::raise_row(bytes, marks, worst);
        };
        let mut x = 0;
        loop {
            // SAFETY: the instructions are those of AVX2, for whose functions alone this is; both slices hold a register from
            // `last` on.
            unsafe {
                let mark = _mm_and_si128(_mm_loadu_si128(marks.as_ptr().add(x).cast()), _mm_set1_epi8(worst as i8));
                let at = bytes.as_mut_ptr().add(x).cast();
                _mm_storeu_si128(at, _mm_max_epu8(_mm_loadu_si128(at), mark));
            }
            if x == last {
                return;
            }
            // Raising a byte again changes nothing.
            x = (x + LANES).min(last);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_marked_is_raised() {
        for width in [5, 32, 47, 64] {
            let (bytes_stride, marks_stride) = (width + 2, width + 7);
            let byte = |i: usize| (i * 37 % 256) as u8;
            let marks: Vec<u8> = (0..3 * marks_stride).map(|i| if i % 5 < 2 { 255 } else { 0 }).collect();
            let mut bytes: Vec<u8> = (0..3 * bytes_stride).map(byte).collect();
            raise((&mut bytes, bytes_stride), (&marks, marks_stride), &[true, false, true], width, 112);
            for (i, found) in bytes.into_iter().enumerate() {
                let (x, y) = (i % bytes_stride, i / bytes_stride);
                let is_raised = x < width && y != 1 && marks[y * marks_stride + x] == 255;
                assert_eq!(found, if is_raised { byte(i).max(112) } else { byte(i) });
            }
        }
    }
}
