//! The multispectral image of a view: blue, green, red and near infrared on coarser pixels, taken
//! with the panchromatic image from the same place at the same time.
//!
//! A pixel covers `ratio × ratio` panchromatic ones. Its digital number is `offset + gain · E ·
//! radiance`, where E is the sunlight of the band relative to the panchromatic one, so that numbers
//! of two bands are not reflectances on one scale, as in delivered images. The offset is that of
//! the path radiance, which is strongest in blue. The RPC is the panchromatic one on the coarser
//! pixels, with the same pointing error.

use camera::{ImagePoint, Rpc};
use raster::Grid;

use crate::SceneRay;
use crate::config::{CloudsConfig, MultispectralConfig, SensorConfig};
use crate::random::derived;
use crate::views::clouds::CLOUD_RADIANCE;
use crate::views::render::{LitScene, Rays};
use crate::views::sensor::{PointSpread, Sensor};
use crate::views::sight::SightLines;
use crate::views::spectrum::{BANDS, Spectrum};
use numeric::Progress;

/// A band of the multispectral images.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SpectralBand {
    /// Name, as band descriptions have it.
    pub name: &'static str,
    /// Wavelength at the centre of the band, micrometres.
    pub centre_um: f64,
    /// Width of the band at half of its maximum, micrometres.
    pub width_um: f64,
    /// Sunlight in the band relative to that in the panchromatic one.
    sunlight: f64,
    /// Path radiance and dark current relative to that of the panchromatic band.
    haze: f64,
}

/// The bands in the order of the images. Wavelengths and sunlight are those of WorldView-2.
pub const SPECTRAL_BANDS: [SpectralBand; BANDS] = [
    SpectralBand { name: "blue", centre_um: 0.480, width_um: 0.060, sunlight: 1.25, haze: 1.6 },
    SpectralBand { name: "green", centre_um: 0.545, width_um: 0.070, sunlight: 1.17, haze: 1.0 },
    SpectralBand { name: "red", centre_um: 0.660, width_um: 0.060, sunlight: 0.99, haze: 0.6 },
    SpectralBand { name: "nir", centre_um: 0.833, width_um: 0.125, sunlight: 0.68, haze: 0.25 },
];

/// Samples along each side of a pixel.
const SUBPIXELS: usize = 6;

/// The multispectral image of a view.
#[derive(Debug, Clone)]
pub struct SpectralImage {
    /// Digital numbers of [`SPECTRAL_BANDS`]. 0 is no-data.
    pub bands: [Grid<u16>; BANDS],
    /// The delivered RPC, with the pointing error of the view.
    pub rpc: Rpc,
}

/// What a multispectral image is made with.
pub(crate) struct SpectralCamera<'a> {
    pub(crate) config: &'a MultispectralConfig,
    pub(crate) optics: SensorConfig,
    pub(crate) sensor: &'a Sensor,
    pub(crate) clouds: &'a CloudsConfig,
    pub(crate) sight: &'a SightLines,
    /// Columns and rows of the panchromatic image.
    pub(crate) size: (usize, usize),
    /// Seed of the noise.
    pub(crate) seed: u64,
}

/// The rays of pixels that are wider than those of the lines of sight.
struct CoarseRays<'a> {
    sight: &'a SightLines,
    ratio: f64,
}

impl Rays for CoarseRays<'_> {
    fn ray(&self, at: ImagePoint) -> SceneRay {
        let fine = |c: f64| (c + 0.5) * self.ratio - 0.5;
        self.sight.ray(ImagePoint::new(fine(at.sample), fine(at.line)))
    }

    fn end(&self) -> f64 {
        self.sight.end()
    }
}

impl SpectralCamera<'_> {
    /// Returns the number of rows of the image.
    pub(crate) fn rows(&self) -> usize {
        (self.size.1 / self.config.ratio).max(1)
    }

    /// Takes the image. `rpc` is the delivered one of the panchromatic image, whose clouds have an
    /// opacity.
    pub(crate) fn image(
        &self,
        scene: &LitScene<'_>,
        spectrum: &Spectrum,
        rpc: &Rpc,
        opacity: Option<&Grid<f32>>,
        progress: &dyn Progress,
    ) -> SpectralImage {
        let ratio = self.config.ratio;
        let size = ((self.size.0 / ratio).max(1), self.rows());
        let rays = CoarseRays { sight: self.sight, ratio: ratio as f64 };
        let spread = PointSpread::new(&SensorConfig { subpixels: SUBPIXELS, ..self.optics });
        let radiance = scene.spectral_image(spectrum, &rays, &spread, size, progress);
        let hidden = opacity.map(|cover| coarse(cover, ratio, size));
        let bands = std::array::from_fn(|band| self.band(band, &radiance, hidden.as_ref()));
        SpectralImage { bands, rpc: rpc.rescaled(1.0 / ratio as f64) }
    }

    /// Returns the digital numbers of a band.
    fn band(&self, band: usize, radiance: &Grid<[f32; BANDS]>, hidden: Option<&Grid<f32>>) -> Grid<u16> {
        let SpectralBand { sunlight, haze, .. } = SPECTRAL_BANDS[band];
        let own = Sensor { gain: sunlight * self.sensor.gain, offset: haze * self.sensor.offset, ..*self.sensor };
        let seed = derived(self.seed, band as u64);
        let width = radiance.width();
        let mut numbers = Grid::filled(width, radiance.height(), 0u16);
        for (index, (number, clear)) in numbers.data_mut().iter_mut().zip(radiance.data()).enumerate() {
            let hidden = hidden.map_or(0.0, |cover| cover.data()[index]);
            if hidden == 0.0 || !self.clouds.masked {
                let seen = clear[band] + hidden * (CLOUD_RADIANCE - clear[band]);
                *number = own.quantise(f64::from(seen), seed, index % width, index / width);
            }
        }
        numbers
    }
}

/// Returns the means of squares of cells.
fn coarse(fine: &Grid<f32>, ratio: usize, (width, height): (usize, usize)) -> Grid<f32> {
    let mut means = Grid::filled(width, height, 0f32);
    for (index, mean) in means.data_mut().iter_mut().enumerate() {
        let (left, top) = (index % width * ratio, index / width * ratio);
        let rows = top..(top + ratio).min(fine.height());
        let cells = rows.flat_map(|y| (left..(left + ratio).min(fine.width())).map(move |x| fine[(x, y)]));
        *mean = cells.sum::<f32>() / (ratio * ratio) as f32;
    }
    means
}
