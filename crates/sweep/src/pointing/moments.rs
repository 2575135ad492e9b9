//! Means and deviations of all patches of an image. NaN marks invalid pixels and spreads to every
//! patch that touches one.

use multiversion::multiversion;
use raster::Grid;

/// Subtracts the mean of the valid values, which keeps f32 sums of squares well conditioned.
pub(crate) fn remove_mean(v: &mut [f32]) {
    let (mut sum, mut n) = (0.0f64, 0u32);
    for x in v.iter().filter(|x| x.is_finite()) {
        sum += f64::from(*x);
        n += 1;
    }
    if n > 0 {
        let mean = (sum / f64::from(n)) as f32;
        v.iter_mut().for_each(|x| *x -= mean);
    }
}

/// Computes sums over windows of `side` columns: `out[x] = Σ_{i < side} v[x + i]`.
#[inline(always)]
fn slide(v: &[f32], side: usize, out: &mut [f32]) {
    let n = out.len();
    out.copy_from_slice(&v[..n]);
    for i in 1..side {
        let s = &v[i..i + n];
        for x in 0..n {
            out[x] += s[x];
        }
    }
}

/// Computes the mean and `1 / sqrt(variance + floor)` of every `side × side` patch of an image of
/// `width` columns. `line` is a scratch buffer of two rows.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn patch_moments(
    tile: &[f32],
    width: usize,
    side: usize,
    floor: f32,
    line: &mut [f32],
    mean: &mut [f32],
    inverse_deviation: &mut [f32],
) {
    let core = width + 1 - side;
    let rows = mean.len() / core;
    let inv_n = 1.0 / (side * side) as f32;
    let (sum, square) = line[..2 * width].split_at_mut(width);
    for y in 0..rows {
        let first = &tile[y * width..(y + 1) * width];
        for x in 0..width {
            sum[x] = first[x];
            square[x] = first[x] * first[x];
        }
        for j in 1..side {
            let r = &tile[(y + j) * width..(y + j + 1) * width];
            for x in 0..width {
                sum[x] += r[x];
                square[x] += r[x] * r[x];
            }
        }
        let m = &mut mean[y * core..(y + 1) * core];
        let s = &mut inverse_deviation[y * core..(y + 1) * core];
        slide(sum, side, m);
        slide(square, side, s);
        for x in 0..core {
            m[x] *= inv_n;
            let variance = (s[x] * inv_n - m[x] * m[x]).max(0.0) + floor;
            // `max` drops a NaN; adding 0 · mean restores it.
            s[x] = 1.0 / variance.sqrt() + 0.0 * m[x];
        }
    }
}

/// Computes `1 / deviation` of every whole `side × side` patch of an image, `floor` added to the
/// variance; NaN where the patch is invalid or no stronger than the noise.
pub(crate) fn inverse_deviations(image: &Grid<f32>, side: usize, noise: f32, floor: f32) -> Grid<f32> {
    if image.width() < side || image.height() < side {
        return Grid::filled(0, 0, f32::NAN);
    }
    let (w, h) = (image.width() + 1 - side, image.height() + 1 - side);
    let mut mean = vec![0.0; w * h];
    let mut out = Grid::filled(w, h, f32::NAN);
    let mut line = vec![0.0; 2 * image.width()];
    patch_moments(image.data(), image.width(), side, floor, &mut line, &mut mean, out.data_mut());
    out.data_mut().iter_mut().filter(|v| **v * noise >= 1.0 || v.is_infinite()).for_each(|v| *v = f32::NAN);
    out
}
