//! Correlation of grey values, each at a pixel of its own, with an image at all shifts of whole
//! pixels. Patches of neighbouring pixels are those of `masked_patch`.

use multiversion::multiversion;
use raster::Grid;

/// Returns the correlation of grey values with those of an image, row by row over the shifts of up
/// to `reach` pixels. `known` has each value with the index of the pixel where it is expected. A
/// shift has `None` where fewer than half of the pixels have a value, or where one side is flat.
///
/// ```
/// use raster::Grid;
///
/// let image = Grid::from_vec(9, 9, (0..81).map(|i| (i * i % 17) as f32).collect()).unwrap();
/// // Grey values of a row, which lie one pixel to the right of where they are expected.
/// let known: Vec<(f64, usize)> = (2..6).map(|x| (f64::from(image[(x + 1, 4)]), 4 * 9 + x)).collect();
/// let found = sweep::pointing::correlations_at_shifts(&known, &image, 2);
/// assert!((found[2 * 5 + 3].unwrap() - 1.0).abs() < 1e-9);
/// ```
///
/// # Panics
/// If a shift leads beyond the first or the last pixel of the image.
pub fn correlations_at_shifts(known: &[(f64, usize)], image: &Grid<f32>, reach: usize) -> Vec<Option<f64>> {
    let side = 2 * reach + 1;
    let mut out = Vec::with_capacity(side * side);
    for row in 0..side {
        // Sums over the pixels that have a value: their number, the known values and their squares,
        // those of the image and their squares, and the products of the two.
        let mut sums: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; side]);
        for (own, pixel) in known {
            let first = pixel + row * image.width() - reach * (image.width() + 1);
            add(&mut sums, *own, &image.data()[first..first + side]);
        }
        let [counts, own, own_squares, seen, seen_squares, products] = &sums;
        out.extend((0..side).map(|at| {
            let (n, f, g) = (counts[at], own[at], seen[at]);
            let (vf, vg) = (own_squares[at] - f * f / n, seen_squares[at] - g * g / n);
            let is_seen = 2.0 * n >= known.len() as f64;
            (is_seen && vf > 0.0 && vg > 0.0).then(|| (products[at] - f * g / n) / (vf * vg).sqrt())
        }));
    }
    out
}

/// Adds a grey value and those of a line of pixels to the sums of each shift along the line. Pixels
/// without a value add nothing.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add([counts, owns, own_squares, seen, seen_squares, products]: &mut [Vec<f64>; 6], own: f64, line: &[f32]) {
    let side = line.len();
    let (counts, owns, own_squares) = (&mut counts[..side], &mut owns[..side], &mut own_squares[..side]);
    let (seen, seen_squares, products) = (&mut seen[..side], &mut seen_squares[..side], &mut products[..side]);
    for x in 0..side {
        let is_known = line[x].is_finite();
        let (one, own) = if is_known { (1.0, own) } else { (0.0, 0.0) };
        let value = if is_known { f64::from(line[x]) } else { 0.0 };
        counts[x] += one;
        owns[x] += own;
        own_squares[x] += own * own;
        seen[x] += value;
        seen_squares[x] += value * value;
        products[x] += own * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_without_values_or_contrast_have_no_correlation() {
        let mut image = Grid::from_vec(12, 5, (0..60).map(|i| (i * 7 % 11) as f32).collect()).unwrap();
        let known: Vec<(f64, usize)> = (0..4).map(|i| (f64::from(i as u8), 2 * 12 + 4 + i)).collect();
        // Columns 6 to 9 are void: three, two and one of the four values meet a known pixel.
        (0..5).for_each(|row| image.row_mut(row)[6..10].fill(f32::NAN));
        let found = correlations_at_shifts(&known, &image, 1);
        assert_eq!(found.iter().map(Option::is_some).collect::<Vec<bool>>(), [true, true, false].repeat(3));
        (0..5).for_each(|row| image.row_mut(row).fill(3.0));
        assert!(correlations_at_shifts(&known, &image, 1).iter().all(Option::is_none));
    }
}
