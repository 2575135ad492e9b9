//! One view of a scene: rays through the pixels, Lambertian shading with cast shadows, and the
//! point-spread function.
//!
//! Radiance = reflectance · (sky + (1 − sky) · max(0, n·s) · lit). It is sampled on a regular
//! lattice finer than the pixels and weighted by the point-spread function. Bands of rows are
//! independent. The samples at their edges are computed twice, so that the image is the same for
//! any number of threads.

use camera::ImagePoint;
use nalgebra::Vector3;
use raster::Grid;
use rayon::prelude::*;

use crate::SceneRay;
use crate::scene::Scene;
use crate::sensor::PointSpread;
use crate::sight::SightLines;
use crate::sun::Sun;
use crate::texture::Texture;
use numeric::Progress;

/// Share of the light that comes from the whole sky and so reaches shadows.
const SKY: f64 = 0.3;
/// Rows of a band.
pub(crate) const BAND: usize = 32;
/// Radiance where a line of sight leaves the scene.
const BEYOND: f64 = 0.1;

/// The lines of sight of an image.
pub(crate) trait Rays: Sync {
    /// Returns the ray of an image position.
    fn ray(&self, at: ImagePoint) -> SceneRay;

    /// Returns the parameter at which a ray ends.
    fn end(&self) -> f64;
}

impl Rays for SightLines {
    fn ray(&self, at: ImagePoint) -> SceneRay {
        self.ray(at)
    }

    fn end(&self) -> f64 {
        1.0
    }
}

/// A scene with its light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LitScene<'a> {
    scene: &'a Scene,
    texture: Texture,
    to_sun: Vector3<f64>,
}

impl<'a> LitScene<'a> {
    pub(crate) fn new(scene: &'a Scene, texture: Texture, sun: &Sun) -> Self {
        Self { scene, texture, to_sun: sun.direction() }
    }

    /// Returns the radiance of `width × height` pixels, in units of a white surface under full
    /// light.
    pub(crate) fn image(
        &self,
        rays: &impl Rays,
        spread: &PointSpread,
        (width, height): (usize, usize),
        progress: &dyn Progress,
    ) -> Grid<f32> {
        let mut image = Grid::filled(width, height, 0f32);
        image.data_mut().par_chunks_mut(BAND * width).enumerate().for_each(|(band, rows)| {
            self.band(rays, spread, width, band * BAND, rows);
            progress.step();
        });
        image
    }

    /// Renders the rows from `first` on.
    fn band(&self, rays: &impl Rays, spread: &PointSpread, width: usize, first: usize, rows: &mut [f32]) {
        let (n, taps) = (spread.subpixels, spread.weights.len());
        let at = |k: usize| (k as f64 - spread.reach as f64 + 0.5) / n as f64 - 0.5;
        let count = rows.len() / width;
        let mut samples = vec![0f64; n * width + 2 * spread.reach];
        // Rows of samples, already weighted along the row.
        let mut lines = vec![0f64; (n * count + 2 * spread.reach) * width];
        for (k, line) in lines.chunks_exact_mut(width).enumerate() {
            let y = first as f64 + at(k);
            for (i, sample) in samples.iter_mut().enumerate() {
                *sample = self.radiance(&rays.ray(ImagePoint::new(at(i), y)), rays.end());
            }
            for (column, value) in line.iter_mut().enumerate() {
                *value = weighted(&samples[column * n..column * n + taps], &spread.weights);
            }
        }
        for (row, out) in rows.chunks_exact_mut(width).enumerate() {
            for (column, pixel) in out.iter_mut().enumerate() {
                let sum: f64 = (0..taps).map(|k| lines[(row * n + k) * width + column] * spread.weights[k]).sum();
                *pixel = sum as f32;
            }
        }
    }

    /// Returns the radiance that comes along a ray, which ends at a parameter.
    pub(crate) fn radiance(&self, ray: &SceneRay, end: f64) -> f64 {
        let Some(hit) = self.scene.first_hit(ray, end) else { return BEYOND };
        let facing = hit.normal.dot(&self.to_sun);
        let lit = facing > 0.0 && !self.scene.in_shadow(&hit.point, &hit.normal, &self.to_sun);
        let sunlight = if lit { facing } else { 0.0 };
        self.texture.reflectance(self.scene, &hit) * (SKY + (1.0 - SKY) * sunlight)
    }
}

fn weighted(samples: &[f64], weights: &[f64]) -> f64 {
    samples.iter().zip(weights).map(|(s, w)| s * w).sum()
}
