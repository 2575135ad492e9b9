//! Sums over the square around every cell.

use std::iter::Sum;
use std::ops::{AddAssign, SubAssign};

/// Sums over the square of half width `reach` around every value of rows of `width`, as much of it as there is. Running sums:
/// exact for integers, to rounding for others.
pub(crate) fn window_sums<T>(values: &[T], width: usize, reach: usize) -> Vec<T>
where
    T: Copy + Default + AddAssign + SubAssign + Sum<T>,
{
    let mut rows = vec![T::default(); values.len()];
    if values.is_empty() {
        return rows;
    }
    let height = values.len() / width;
    for (to, from) in rows.chunks_exact_mut(width).zip(values.chunks_exact(width)) {
        let mut sum: T = from[..reach.min(width)].iter().copied().sum();
        for (x, to) in to.iter_mut().enumerate() {
            sum += from.get(x + reach).copied().unwrap_or_default();
            *to = sum;
            sum -= x.checked_sub(reach).map_or(T::default(), |left| from[left]);
        }
    }
    let row = |y: usize| &rows[y * width..(y + 1) * width];
    let mut sums = vec![T::default(); width];
    (0..reach.min(height)).for_each(|y| sums.iter_mut().zip(row(y)).for_each(|(s, v)| *s += *v));
    let mut out = vec![T::default(); values.len()];
    for (y, to) in out.chunks_exact_mut(width).enumerate() {
        if y + reach < height {
            sums.iter_mut().zip(row(y + reach)).for_each(|(s, v)| *s += *v);
        }
        to.copy_from_slice(&sums);
        if let Some(above) = y.checked_sub(reach) {
            sums.iter_mut().zip(row(above)).for_each(|(s, v)| *s -= *v);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_the_window() {
        let sums = window_sums(&(0..15).map(f64::from).collect::<Vec<_>>(), 5, 1);
        assert_eq!((sums[0], sums[5 + 2], sums[2 * 5 + 4]), (12.0, 63.0, 44.0));
        assert_eq!(window_sums(&[1u16, 2, 3], 3, 7), [6, 6, 6]);
    }
}
