//! Where pictures have no value, and which costs that concerns.

use multiversion::multiversion;

use super::kernels::INVALID;
use super::part::{CENSUS_REACH, Part};
use super::raise::raise;

/// Marks of what holds a void: [`INVALID`] there, 0 elsewhere; none at all where there is no void.
#[derive(Default)]
pub(super) struct Voids {
    marks: Vec<u8>,
    stride: usize,
    /// Rows with a mark.
    rows: Vec<bool>,
}

impl Voids {
    /// Marks every place of a picture in rows of `stride` from which a square of `side` to the right and below holds a void.
    pub(super) fn mark(&mut self, values: &[f32], stride: usize, side: usize, has_voids: bool) {
        self.marks.clear();
        self.rows.clear();
        self.stride = stride;
        if has_voids {
            self.marks.extend(values.iter().map(|v| if v.is_nan() { INVALID } else { 0 }));
            spread(&mut self.marks, stride, side);
            self.rows.extend(self.marks.chunks(stride).map(|row| row.iter().fold(0, |any, v| any | v) != 0));
        }
    }

    /// Raises the costs of a part, whose first pixel's mark is at `(x, y)`, to `worst` where it is marked; tells whether a row is.
    pub(super) fn hide(&self, (x, y): (usize, usize), part: Part, worst: u8, costs: &mut [u8]) -> bool {
        let (width, height) = (part.width - 2 * CENSUS_REACH, part.height - 2 * CENSUS_REACH);
        let Some(rows) = self.rows.get(y..y + height).filter(|rows| rows.contains(&true)) else { return false };
        let first = CENSUS_REACH * part.width + CENSUS_REACH;
        let marks = (&self.marks[y * self.stride + x..], self.stride);
        raise((&mut costs[first..], part.width), marks, rows, width, worst);
        true
    }
}

/// Marks every place from which a square of `side` to the right and below holds a marked one.
#[multiversion(targets("x86_64+avx2"))]
fn spread(voids: &mut [u8], stride: usize, side: usize) {
    for row in voids.chunks_exact_mut(stride) {
        for _ in 1..side {
            (1..stride).for_each(|x| row[x - 1] |= row[x]);
        }
    }
    let mut rest = voids;
    while let Some((row, below)) = rest.split_at_mut_checked(stride) {
        for other in below.chunks(stride).take(side - 1) {
            row.iter_mut().zip(other).for_each(|(v, other)| *v |= other);
        }
        rest = below;
    }
}
