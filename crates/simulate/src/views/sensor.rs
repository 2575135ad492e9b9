//! The sensor: point-spread function, photon and read noise, gain, gamma and offset, quantisation
//! to 8 to 12 bits.
//!
//! `DN = offset + gain · (electrons / electrons_at_white)^gamma`, where the electrons have the
//! variance `signal + read noise²`. The modulation transfer is the one of the pixel's box times a
//! Gaussian. The width of the Gaussian follows from the transfer at the Nyquist frequency: `m =
//! sinc(1/2) · exp(−π² σ² / 2)`, σ in pixels.

use serde::{Deserialize, Serialize};

use crate::config::SensorConfig;
use crate::random::lattice;
use crate::views::date::Date;
use numeric::SplitMix64;

/// Modulation transfer of the pixel's box at the Nyquist frequency.
pub(crate) const BOX_AT_NYQUIST: f64 = std::f64::consts::FRAC_2_PI;
/// Half width of the Gaussian, in units of its σ.
const REACH_SIGMA: f64 = 3.5;

/// The radiometry of one view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sensor {
    /// Largest digital number. 0 is reserved for no-data.
    pub dn_max: u16,
    /// Digital numbers between a black surface and a white one under full light.
    pub gain: f64,
    /// Digital number of a black surface: path radiance and dark current.
    pub offset: f64,
    /// Exponent of the radiance.
    pub gamma: f64,
    /// Electrons of a white surface under full light.
    pub electrons_at_white: f64,
    /// Standard deviation of the read noise, electrons.
    pub read_noise_electrons: f64,
}

impl Sensor {
    /// Makes the sensor on a date.
    pub(crate) fn new(config: &SensorConfig, date: &Date) -> Self {
        let dn_max = ((1u32 << config.bits) - 1) as u16;
        let range = f64::from(dn_max);
        Self {
            dn_max,
            gain: config.white_share * range * date.gain,
            offset: (config.offset_share + date.offset) * range,
            gamma: date.gamma,
            electrons_at_white: config.electrons_at_white,
            read_noise_electrons: config.read_noise_electrons,
        }
    }

    /// Returns the digital number of a pixel. The noise depends on (seed, column, row) only.
    pub(crate) fn quantise(&self, radiance: f64, seed: u64, column: usize, row: usize) -> u16 {
        let electrons = radiance.max(0.0) * self.electrons_at_white;
        let sigma = (electrons + self.read_noise_electrons * self.read_noise_electrons).sqrt();
        let own = lattice(seed, column as i64, row as i64).to_bits();
        let noisy = ((electrons + sigma * SplitMix64::new(own).normal()) / self.electrons_at_white).max(0.0);
        let signal = if self.gamma == 1.0 { noisy } else { noisy.powf(self.gamma) };
        (self.offset + self.gain * signal).round().clamp(1.0, f64::from(self.dn_max)) as u16
    }
}

/// Weights of the samples around a pixel along one axis. The point-spread function is separable.
#[derive(Debug, Clone)]
pub(crate) struct PointSpread {
    /// Samples per pixel.
    pub(crate) subpixels: usize,
    /// Number of samples before the first one inside the pixel.
    pub(crate) reach: usize,
    pub(crate) weights: Vec<f64>,
}

impl PointSpread {
    pub(crate) fn new(config: &SensorConfig) -> Self {
        let n = config.subpixels;
        let sigma = (-2.0 * (config.mtf_at_nyquist / BOX_AT_NYQUIST).ln()).max(0.0).sqrt() / std::f64::consts::PI;
        let reach = (REACH_SIGMA * sigma * n as f64).ceil() as usize;
        let offset = |k: usize| (k as f64 - reach as f64 + 0.5) / n as f64 - 0.5;
        // The box of the pixel, blurred by the Gaussian.
        let weight = |k: usize| {
            let inside = (reach..reach + n).map(|b| (offset(k) - offset(b)) / sigma.max(1e-9));
            inside.map(|d| (-0.5 * d * d).exp()).sum::<f64>()
        };
        let weights: Vec<f64> = (0..n + 2 * reach).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        Self { subpixels: n, reach, weights: weights.into_iter().map(|w| w / sum).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSOR: Sensor = Sensor {
        dn_max: 2047,
        gain: 2000.0,
        offset: 100.0,
        gamma: 1.0,
        electrons_at_white: 30_000.0,
        read_noise_electrons: 25.0,
    };

    #[test]
    fn noise_has_the_stated_variance() {
        let values: Vec<f64> = (0..10_000).map(|k| f64::from(SENSOR.quantise(0.3, 7, k % 100, k / 100))).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        let per_dn: f64 = 30_000.0 / 2000.0;
        let expected = (9000.0 + 25.0 * 25.0) / per_dn.powi(2) + 1.0 / 12.0;
        assert!((mean - 700.0).abs() < 0.3, "{mean}");
        assert!((variance / expected - 1.0).abs() < 0.05, "{variance}, expected {expected}");
        assert_eq!(SENSOR.quantise(50.0, 7, 0, 0), 2047);
        assert_eq!(Sensor { offset: 0.0, ..SENSOR }.quantise(-50.0, 7, 1, 0), 1);
    }

    #[test]
    fn gamma_bends_between_black_and_white() {
        let bent = Sensor { gamma: 0.8, dn_max: 4095, ..SENSOR };
        assert!((f64::from(bent.quantise(1.0, 1, 1, 1)) - 2100.0).abs() < 60.0);
        assert!(f64::from(bent.quantise(0.25, 1, 1, 1)) > 100.0 + 2000.0 * 0.3);
    }

    #[test]
    fn the_transfer_at_nyquist_is_the_asked_one() {
        for (mtf_at_nyquist, subpixels) in [(0.1, 3), (0.2, 3), (0.2, 4), (0.35, 4)] {
            let spread = PointSpread::new(&SensorConfig { mtf_at_nyquist, subpixels, ..SensorConfig::default() });
            let position = |k: usize| (k as f64 - spread.reach as f64 + 0.5) / subpixels as f64 - 0.5;
            let transfer: f64 =
                spread.weights.iter().enumerate().map(|(k, w)| w * (std::f64::consts::PI * position(k)).cos()).sum();
            assert!((transfer - mtf_at_nyquist).abs() < 0.02, "{transfer}, asked for {mtf_at_nyquist}");
        }
    }
}
