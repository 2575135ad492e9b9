//! A patch of one image searched for in another, bent by the local map between them.

use raster::{Grid, bicubic};

/// A zero-mean, unit-norm patch of `2 · radius + 1` pixels.
pub(crate) struct Patch {
    radius: i32,
    values: Vec<f32>,
}

impl Patch {
    /// The patch around a pixel; `None` when it leaves the image, holds invalid pixels, or is flatter than the noise.
    pub(crate) fn around(image: &Grid<f32>, [x, y]: [f64; 2], radius: i32, noise: f32) -> Option<Self> {
        let mut values = Vec::with_capacity(((2 * radius + 1) * (2 * radius + 1)) as usize);
        for j in -radius..=radius {
            for i in -radius..=radius {
                let value = bicubic(image, x + f64::from(i), y + f64::from(j));
                if value.is_nan() {
                    return None;
                }
                values.push(value);
            }
        }
        let n = values.len() as f32;
        let mean = values.iter().sum::<f32>() / n;
        values.iter_mut().for_each(|v| *v -= mean);
        let square: f32 = values.iter().map(|v| v * v).sum();
        if square <= n * noise * noise {
            return None;
        }
        let scale = square.sqrt().recip();
        values.iter_mut().for_each(|v| *v *= scale);
        Some(Self { radius, values })
    }

    /// The values, row after row.
    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Zero-mean normalised cross-correlation with the part of a picture (of mean near 0) that begins at `(x, y)`; `None`
    /// where that holds invalid pixels or is flatter than the noise.
    pub(crate) fn correlation_at(&self, picture: &Grid<f32>, (x, y): (usize, usize), noise: f32) -> Option<f32> {
        let side = 2 * self.radius as usize + 1;
        let (mut sum, mut square, mut product) = (0.0f32, 0.0f32, 0.0f32);
        for (j, own) in self.values.chunks_exact(side).enumerate() {
            for (a, b) in own.iter().zip(&picture.row(y + j)[x..x + side]) {
                sum += b;
                square += b * b;
                product += a * b;
            }
        }
        let n = self.values.len() as f32;
        let spread = square - sum * sum / n;
        (spread > n * noise * noise).then(|| product / spread.sqrt())
    }
}

/// Offset in [−0.5, 0.5] of the peak of a parabola through values at −1, 0, 1; 0 where there is no peak.
pub(crate) fn parabola_peak(left: f32, middle: f32, right: f32) -> f64 {
    let curvature = f64::from(left) - 2.0 * f64::from(middle) + f64::from(right);
    if curvature >= 0.0 {
        return 0.0;
    }
    (0.5 * (f64::from(left) - f64::from(right)) / curvature).clamp(-0.5, 0.5)
}
