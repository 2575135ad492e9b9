//! From radiance to digital numbers: gain, offset, photon and read noise, 11-bit quantisation.

use serde::{Deserialize, Serialize};

use crate::random::{Stream, lattice};

/// Largest digital number of an 11-bit sensor.
pub const DN_MAX: u16 = 2047;

/// The radiometry of one view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sensor {
    /// Digital numbers per unit of radiance (reflectance under full light).
    pub gain: f64,
    /// Digital number of a black surface: path radiance and dark current.
    pub offset: f64,
    /// Electrons per digital number: photon noise has the variance `signal / electrons_per_dn`.
    pub electrons_per_dn: f64,
    /// Standard deviation of the read noise, digital numbers.
    pub read_noise: f64,
}

impl Sensor {
    /// The digital number of a pixel; the noise belongs to (seed, column, row). Zero is kept for no-data.
    pub(crate) fn quantise(&self, radiance: f64, seed: u64, column: usize, row: usize) -> u16 {
        let signal = self.offset + self.gain * radiance;
        let sigma = (signal.max(0.0) / self.electrons_per_dn + self.read_noise * self.read_noise).sqrt();
        let own = lattice(seed, column as i64, row as i64).to_bits();
        let noisy = signal + sigma * Stream::new(own).normal();
        noisy.round().clamp(1.0, f64::from(DN_MAX)) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_stated_variance() {
        let sensor = Sensor { gain: 1000.0, offset: 100.0, electrons_per_dn: 12.0, read_noise: 2.0 };
        let values: Vec<f64> = (0..10_000).map(|k| f64::from(sensor.quantise(0.3, 7, k % 100, k / 100))).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        // Quantisation adds 1/12 to 400/12 + 2².
        assert!((mean - 400.0).abs() < 0.3, "{mean}");
        assert!((variance / (400.0 / 12.0 + 4.0 + 1.0 / 12.0) - 1.0).abs() < 0.05, "{variance}");
        assert_eq!(sensor.quantise(50.0, 7, 0, 0), DN_MAX);
        assert_eq!(sensor.quantise(-50.0, 7, 0, 0), 1);
    }
}
