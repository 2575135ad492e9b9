//! One view of a scene: rays through the pixels, Lambertian shading with cast shadows, and the sensor.
//!
//! Radiance = reflectance · (sky + (1 − sky) · max(0, n·s) · lit), averaged over a square of sub-pixel positions: the
//! pixel's own box is the modulation transfer function. Every pixel depends on itself only, so that the image is the
//! same for any number of threads.

use camera::ImagePoint;
use nalgebra::Vector3;
use raster::Grid;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::scene::Scene;
use crate::sensor::Sensor;
use crate::sight::Sight;
use crate::texture::Texture;

/// Share of the light that comes from the whole sky and reaches shadows too.
const SKY: f64 = 0.3;
/// Sub-pixel positions along each side of a pixel.
const SUBPIXELS: usize = 3;

/// Where the light comes from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sun {
    /// Height above the horizon, degrees; at least [`Sun::LOWEST_DEG`].
    pub elevation_deg: f64,
    /// Direction towards it, degrees clockwise from north.
    pub azimuth_deg: f64,
}

impl Sun {
    /// Below this elevation the terrain would throw shadows, which the renderer leaves out.
    pub const LOWEST_DEG: f64 = 30.0;

    /// Unit vector towards the sun (east, north, up).
    pub fn direction(&self) -> Vector3<f64> {
        let (up, level) = self.elevation_deg.to_radians().sin_cos();
        let (east, north) = self.azimuth_deg.to_radians().sin_cos();
        Vector3::new(level * east, level * north, up)
    }
}

/// A scene in its light.
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

    /// The image of `width × height` pixels, in digital numbers; `seed` is that of the noise.
    pub(crate) fn image(
        &self,
        sight: &Sight,
        sensor: &Sensor,
        (width, height): (usize, usize),
        seed: u64,
    ) -> Grid<u16> {
        let mut image = Grid::filled(width, height, 0u16);
        image.data_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(row, line)| {
            for (column, pixel) in line.iter_mut().enumerate() {
                *pixel = sensor.quantise(self.pixel(sight, column, row), seed, column, row);
            }
        });
        image
    }

    fn pixel(&self, sight: &Sight, column: usize, row: usize) -> f64 {
        let offset = |k: usize| (k as f64 + 0.5) / SUBPIXELS as f64 - 0.5;
        let mut sum = 0.0;
        for j in 0..SUBPIXELS {
            for i in 0..SUBPIXELS {
                let at = ImagePoint::new(column as f64 + offset(i), row as f64 + offset(j));
                sum += self.radiance(sight, at);
            }
        }
        sum / (SUBPIXELS * SUBPIXELS) as f64
    }

    /// Radiance at an image position, in units of a white surface under full light.
    fn radiance(&self, sight: &Sight, at: ImagePoint) -> f64 {
        let Some(hit) = self.scene.first_hit(&sight.ray(at), 1.0) else { return 0.0 };
        let normal = self.scene.normal(&hit);
        let facing = normal.dot(&self.to_sun);
        let lit = facing > 0.0 && !self.scene.in_shadow(&hit.point, &normal, &self.to_sun);
        let sunlight = if lit { facing } else { 0.0 };
        self.texture.reflectance(self.scene, &hit) * (SKY + (1.0 - SKY) * sunlight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::Terrain;

    #[test]
    fn the_terrain_is_gentler_than_the_lowest_sun() {
        assert!(Terrain::slope_bound() < Sun::LOWEST_DEG.to_radians().tan());
    }
}
