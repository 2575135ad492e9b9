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
use crate::surface::scene::{Hit, Scene};
use crate::surface::texture::Texture;
use crate::views::sensor::PointSpread;
use crate::views::sight::SightLines;
use crate::views::spectrum::{BANDS, Spectrum};
use crate::views::sun::Sun;
use numeric::Progress;

/// Share of the light that comes from the whole sky and so reaches shadows.
const SKY: f64 = 0.3;
/// The same in blue, green, red and near infrared: the sky is blue.
const SKY_OF: [f64; BANDS] = [0.42, 0.34, 0.27, 0.18];
/// Largest reflectance in a band.
const BRIGHTEST: f64 = 0.95;
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
        size: (usize, usize),
        progress: &dyn Progress,
    ) -> Grid<f32> {
        let radiance = |ray: &SceneRay| [self.radiance(ray, rays.end())];
        rendered(rays, spread, size, &radiance, progress).map(|[value]| *value)
    }

    /// Returns the radiance of `width × height` pixels in each band, in units of a surface that is
    /// white in all bands under full light.
    pub(crate) fn spectral_image(
        &self,
        spectrum: &Spectrum,
        rays: &impl Rays,
        spread: &PointSpread,
        size: (usize, usize),
        progress: &dyn Progress,
    ) -> Grid<[f32; BANDS]> {
        rendered(rays, spread, size, &|ray: &SceneRay| self.spectral_radiance(spectrum, ray, rays.end()), progress)
    }

    /// Returns the radiance that comes along a ray, which ends at a parameter.
    pub(crate) fn radiance(&self, ray: &SceneRay, end: f64) -> f64 {
        let Some(hit) = self.scene.first_hit(ray, end) else { return BEYOND };
        self.texture.reflectance(self.scene, &hit) * (SKY + (1.0 - SKY) * self.sunlight(&hit))
    }

    /// Returns the radiance that comes along a ray in each band.
    fn spectral_radiance(&self, spectrum: &Spectrum, ray: &SceneRay, end: f64) -> [f64; BANDS] {
        let Some(hit) = self.scene.first_hit(ray, end) else { return [BEYOND; BANDS] };
        let (grey, tint, sunlight) =
            (self.texture.reflectance(self.scene, &hit), spectrum.tint(self.scene, &hit), self.sunlight(&hit));
        std::array::from_fn(|k| (grey * tint[k]).min(BRIGHTEST) * (SKY_OF[k] + (1.0 - SKY_OF[k]) * sunlight))
    }

    /// Returns the cosine of the sun's direction with the surface at a hit; 0 in shadow.
    fn sunlight(&self, hit: &Hit) -> f64 {
        let facing = hit.normal.dot(&self.to_sun);
        let lit = facing > 0.0 && !self.scene.in_shadow(&hit.point, &hit.normal, &self.to_sun);
        if lit { facing } else { 0.0 }
    }
}

/// Renders an image of N bands.
fn rendered<const N: usize>(
    rays: &impl Rays,
    spread: &PointSpread,
    (width, height): (usize, usize),
    radiance: &(impl Fn(&SceneRay) -> [f64; N] + Sync),
    progress: &dyn Progress,
) -> Grid<[f32; N]> {
    let mut image = Grid::filled(width, height, [0f32; N]);
    image.data_mut().par_chunks_mut(BAND * width).enumerate().for_each(|(band, rows)| {
        render_rows(rays, spread, (width, band * BAND), radiance, rows);
        progress.step();
    });
    image
}

/// Renders rows of a width from the row `first` on.
fn render_rows<const N: usize>(
    rays: &impl Rays,
    spread: &PointSpread,
    (width, first): (usize, usize),
    radiance: &impl Fn(&SceneRay) -> [f64; N],
    rows: &mut [[f32; N]],
) {
    let (n, taps) = (spread.subpixels, spread.weights.len());
    let at = |k: usize| (k as f64 - spread.reach as f64 + 0.5) / n as f64 - 0.5;
    let count = rows.len() / width;
    let mut samples = vec![[0f64; N]; n * width + 2 * spread.reach];
    // Rows of samples, already weighted along the row.
    let mut lines = vec![[0f64; N]; (n * count + 2 * spread.reach) * width];
    for (k, line) in lines.chunks_exact_mut(width).enumerate() {
        let y = first as f64 + at(k);
        for (i, sample) in samples.iter_mut().enumerate() {
            *sample = radiance(&rays.ray(ImagePoint::new(at(i), y)));
        }
        for (column, value) in line.iter_mut().enumerate() {
            *value = weighted(samples[column * n..column * n + taps].iter(), &spread.weights);
        }
    }
    for (row, out) in rows.chunks_exact_mut(width).enumerate() {
        for (column, pixel) in out.iter_mut().enumerate() {
            let below = (0..taps).map(|k| &lines[(row * n + k) * width + column]);
            *pixel = weighted(below, &spread.weights).map(|sum| sum as f32);
        }
    }
}

fn weighted<'a, const N: usize>(samples: impl Iterator<Item = &'a [f64; N]>, weights: &[f64]) -> [f64; N] {
    let mut sums = [0.0; N];
    for (sample, weight) in samples.zip(weights) {
        sums.iter_mut().zip(sample).for_each(|(sum, s)| *sum += s * weight);
    }
    sums
}
