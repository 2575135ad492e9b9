//! No-data values that a file of heights does not declare.
//!
//! Such a value is a whole number beyond the heights of the Earth, and far from all others.
//! Outliers of a surface model have fractions.

use std::ops::RangeInclusive;

/// Heights of the Earth, metres. The sea is deeper in a few trenches only, where [`GAP_M`] tells a
/// depth from a no-data value.
const EARTH_M: RangeInclusive<f32> = -9000.0..=9000.0;
/// Least distance of a no-data value from all heights, metres.
const GAP_M: f32 = 400.0;

/// A value at one end of all values.
struct End {
    value: f32,
    cells: usize,
    /// The value next to it; infinite when there is none.
    next: f32,
}

impl End {
    /// Finds the least of `values`, and the greatest when they are negated.
    fn of(values: impl Iterator<Item = f32>) -> Self {
        let mut end = Self { value: f32::INFINITY, cells: 0, next: f32::INFINITY };
        for value in values.filter(|value| value.is_finite()) {
            if value < end.value {
                end = Self { value, cells: 1, next: end.value };
            } else if value == end.value {
                end.cells += 1;
            } else if value < end.next {
                end.next = value;
            }
        }
        end
    }

    fn is_no_data(&self) -> bool {
        self.value.is_finite() && self.value.fract() == 0.0 && self.next - self.value > GAP_M
    }
}

/// Returns a value that looks like no-data among heights in metres, and the number of its cells.
/// Voids are NaN.
pub fn undeclared_no_data(heights: &[f32]) -> Option<(f32, usize)> {
    let low = End::of(heights.iter().copied());
    if low.is_no_data() && low.value < *EARTH_M.start() {
        return Some((low.value, low.cells));
    }
    let high = End::of(heights.iter().map(|height| -height));
    (high.is_no_data() && -high.value > *EARTH_M.end()).then_some((-high.value, high.cells))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lone_whole_numbers_beyond_all_heights_are_no_data() {
        let town = |i: usize| 180.0 + (i % 70) as f32 * 0.37;
        let with = |value: f32| -> Vec<f32> { (0..500).map(|i| if i % 9 == 0 { value } else { town(i) }).collect() };
        for value in [-9999.0, -32768.0, -1e6, f32::MIN, 9999.0, 32767.0, 1e20] {
            assert_eq!(undeclared_no_data(&with(value)), Some((value, 56)), "{value}");
        }
        for value in [0.0, -433.0, 8849.0, -999.0, f32::NAN, -9612.3, 9412.7] {
            assert_eq!(undeclared_no_data(&with(value)), None, "{value}");
        }
        assert_eq!(undeclared_no_data(&[-9999.0; 4]), Some((-9999.0, 4)));
        assert_eq!(undeclared_no_data(&[]), None);
        // The floor of a trench goes down step by step.
        let sea: Vec<f32> = (0..550).map(|i| -(i as f32) * 20.0).collect();
        assert_eq!(undeclared_no_data(&sea), None);
    }
}
