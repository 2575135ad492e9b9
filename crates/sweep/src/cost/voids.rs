//! Where images have no value, and which costs that makes invalid.

use multiversion::multiversion;

use super::kernels::INVALID;
use super::part::{MARGIN, Part};
use super::raise::{RaiseMarked, raise_marked};

/// Marks of the places whose neighbourhood holds a void. There are none if the image has no void.
#[derive(Default)]
pub(super) struct Voids {
    /// [`INVALID`] at marked places, 0 elsewhere.
    marks: Vec<u8>,
    /// Columns of the image.
    stride: usize,
    /// Whether each row has a mark.
    rows: Vec<bool>,
}

impl Voids {
    /// Marks every place of an image of `stride` columns from which a square of `side` pixels to
    /// the right and below holds a NaN. `has_voids` tells whether there is one.
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

    /// Raises the costs of a part to at least `worst` at marked pixels, where the mark of its first
    /// inner pixel is at `(x, y)`. Returns whether any row of the part has a mark.
    pub(super) fn hide(&self, (x, y): (usize, usize), part: Part, worst: u8, costs: &mut [u8]) -> bool {
        let (width, height) = (part.width - 2 * MARGIN, part.height - 2 * MARGIN);
        let Some(rows) = self.rows.get(y..y + height).filter(|rows| rows.contains(&true)) else { return false };
        let first = MARGIN * part.width + MARGIN;
        raise_marked(RaiseMarked {
            costs: &mut costs[first..],
            stride: part.width,
            marks: &self.marks[y * self.stride + x..],
            marks_stride: self.stride,
            rows,
            width,
            worst,
        });
        true
    }
}

/// Marks every place from which a square of `side` pixels to the right and below holds a mark.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_marked_pixels_are_raised() {
        for inner in [5, 32, 47, 64] {
            let part = Part { within: [0; 2], width: inner + 2 * MARGIN, height: 3 + 2 * MARGIN };
            let stride = inner + 7;
            let cost = |i: usize| (i * 37 % 256) as u8;
            let is_void = |i: usize| i / stride != 1 && i % 5 < 2;
            let values: Vec<f32> = (0..3 * stride).map(|i| if is_void(i) { f32::NAN } else { 1.0 }).collect();
            let mut voids = Voids::default();
            voids.mark(&values, stride, 1, true);
            let mut costs: Vec<u8> = (0..part.area()).map(cost).collect();
            assert!(voids.hide((0, 0), part, 112, &mut costs));
            for (i, found) in costs.into_iter().enumerate() {
                let (x, y) = (i % part.width, i / part.width);
                let inside = (MARGIN..inner + MARGIN).contains(&x) && (MARGIN..3 + MARGIN).contains(&y);
                let is_raised = inside && is_void((y - MARGIN) * stride + x - MARGIN);
                assert_eq!(found, if is_raised { cost(i).max(112) } else { cost(i) });
            }
        }
    }
}
