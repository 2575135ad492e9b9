//! Sums and means over the square around every cell, by running sums.

use std::iter::Sum;
use std::ops::{AddAssign, SubAssign};

/// Returns the sums over the square of half width `reach` around each of `count` values in rows of
/// `width`. `value` returns the value at an index; values outside count as 0.
///
/// The running sums are exact for integers, and correct up to rounding for floating-point numbers.
pub(crate) fn window_sums<T>(count: usize, width: usize, reach: usize, value: impl Fn(usize) -> T) -> Vec<T>
where
    T: Copy + Default + AddAssign + SubAssign + Sum<T>,
{
    if count == 0 {
        return Vec::new();
    }
    let height = count / width;
    let mut values = vec![T::default(); width];
    let mut sum_row = |y: usize, to: &mut [T]| {
        values.iter_mut().enumerate().for_each(|(x, v)| *v = value(y * width + x));
        let mut sum: T = values[..reach.min(width)].iter().copied().sum();
        for (x, to) in to.iter_mut().enumerate() {
            sum += values.get(x + reach).copied().unwrap_or_default();
            *to = sum;
            sum -= x.checked_sub(reach).map_or(T::default(), |left| values[left]);
        }
    };
    // Ring buffer of the rows that a square covers: the next row replaces the first.
    let turns = (2 * reach + 1).min(height);
    let mut rows = vec![T::default(); turns * width];
    let place = |y: usize| (y % turns) * width..(y % turns + 1) * width;
    let mut sums = vec![T::default(); width];
    let mut enter = |y: usize, rows: &mut [T], sums: &mut [T]| {
        sum_row(y, &mut rows[place(y)]);
        sums.iter_mut().zip(&rows[place(y)]).for_each(|(s, v)| *s += *v);
    };
    (0..reach.min(height)).for_each(|y| enter(y, &mut rows, &mut sums));
    let mut out = Vec::with_capacity(count);
    for y in 0..height {
        if y + reach < height {
            enter(y + reach, &mut rows, &mut sums);
        }
        out.extend_from_slice(&sums);
        if let Some(above) = y.checked_sub(reach) {
            sums.iter_mut().zip(&rows[place(above)]).for_each(|(s, v)| *s -= *v);
        }
    }
    out
}

/// Returns the means over the same squares, of the values inside the grid.
pub(crate) fn window_means(count: usize, width: usize, reach: usize, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let sums = window_sums(count, width, reach, value);
    let height = count.checked_div(width).unwrap_or(0);
    let within = |at: usize, end: usize| (at + reach + 1).min(end) - at.saturating_sub(reach);
    let mean = |(i, sum): (usize, f64)| sum / (within(i % width, width) * within(i / width, height)) as f64;
    sums.into_iter().enumerate().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_the_values_inside() {
        let means = window_means(15, 5, 1, |i| i as f64);
        assert_eq!((means[0], means[5 + 2], means[2 * 5 + 4]), (3.0, 7.0, 11.0));
        assert!(window_means(0, 0, 7, |i| i as f64).is_empty());
    }

    #[test]
    fn sums_are_those_of_the_window() {
        let sums = window_sums(15, 5, 1, |i| i as f64);
        assert_eq!((sums[0], sums[5 + 2], sums[2 * 5 + 4]), (12.0, 63.0, 44.0));
        assert_eq!(window_sums(3, 3, 7, |i| i as u16 + 1), [6, 6, 6]);
        assert!(window_sums(0, 3, 7, |i| i as u16).is_empty());
        // More rows than the ring buffer holds.
        let (width, height) = (7i64, 23i64);
        let value = |i: usize| ((i * i * 31) % 101) as i64;
        for (i, sum) in window_sums((width * height) as usize, width as usize, 2, value).iter().enumerate() {
            let (x, y) = (i as i64 % width, i as i64 / width);
            let square = (y - 2..=y + 2).flat_map(|v| (x - 2..=x + 2).map(move |u| (u, v)));
            let inside = square.filter(|(u, v)| (0..width).contains(u) && (0..height).contains(v));
            assert_eq!(*sum, inside.map(|(u, v)| value((v * width + u) as usize)).sum::<i64>(), "at ({x}, {y})");
        }
    }
}
