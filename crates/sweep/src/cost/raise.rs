//! Costs raised where pixels are marked as void.

#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
use crate::simd::Avx2;
use crate::simd::{Arrays, Kernel};

/// Rows of costs of which marked ones are raised.
pub(super) struct RaiseMarked<'a> {
    /// Costs from the first pixel on.
    pub(super) costs: &'a mut [u8],
    /// Number of costs from one row to the next.
    pub(super) stride: usize,
    /// Marks from the first pixel on: 255 or 0.
    pub(super) marks: &'a [u8],
    /// Number of marks from one row to the next.
    pub(super) marks_stride: usize,
    /// Whether each row has a mark.
    pub(super) rows: &'a [bool],
    /// Pixels per row.
    pub(super) width: usize,
    /// Value that marked costs are raised to at least.
    pub(super) worst: u8,
}

/// Raises the marked costs.
///
/// # Panics
/// Panics if the costs or the marks are too short.
pub(super) fn raise_marked(kernel: RaiseMarked<'_>) {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = Avx2::detect() {
        return avx2.run(kernel);
    }
    kernel.run(Arrays);
}

impl RaiseMarked<'_> {
    /// Calls `raise` with the costs, the marks and the value of each row that has a mark.
    #[inline(always)]
    fn for_each_row(self, mut raise: impl FnMut(&mut [u8], &[u8], u8)) {
        let Self { costs, stride, marks, marks_stride, rows, width, worst } = self;
        for (y, _) in rows.iter().enumerate().filter(|(_, is_marked)| **is_marked) {
            raise(&mut costs[y * stride..][..width], &marks[y * marks_stride..][..width], worst);
        }
    }
}

impl Kernel<Arrays> for RaiseMarked<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, _: Arrays) {
        self.for_each_row(raise_row);
    }
}

#[inline(always)]
fn raise_row(costs: &mut [u8], marks: &[u8], worst: u8) {
    costs.iter_mut().zip(marks).for_each(|(cost, mark)| *cost = (*cost).max(mark & worst));
}

#[cfg(target_arch = "x86_64")]
mod registers {
    use std::arch::x86_64::*;

    use super::RaiseMarked;
    use crate::simd::{Avx2, Kernel};

    /// Bytes in a register: half of the longest one, as rows are often short.
    const LANES: usize = 16;

    impl Kernel<Avx2> for RaiseMarked<'_> {
        type Output = ();

        #[inline(always)]
        fn run(self, token: Avx2) {
            self.for_each_row(|costs, marks, worst| raise_row(token, costs, marks, worst));
        }
    }

    #[inline(always)]
    fn raise_row(_: Avx2, costs: &mut [u8], marks: &[u8], worst: u8) {
        let Some(last) = costs.len().min(marks.len()).checked_sub(LANES) else {
            return super::raise_row(costs, marks, worst);
        };
        let mut x = 0;
        loop {
            // SAFETY: the token proves that the machine has AVX2. `x` is at most `last`, from which
            // on both slices hold `LANES` bytes.
            unsafe {
                let mark = _mm_loadu_si128(marks.as_ptr().add(x).cast());
                let mark = _mm_and_si128(mark, _mm_set1_epi8(worst as i8));
                let at = costs.as_mut_ptr().add(x).cast();
                _mm_storeu_si128(at, _mm_max_epu8(_mm_loadu_si128(at), mark));
            }
            if x == last {
                return;
            }
            // The last register may overlap the one before: raising a cost twice changes nothing.
            x = (x + LANES).min(last);
        }
    }
}
