//! Seeded randomness without state: every value is a hash of (seed, position), so that it does not depend on the order of
//! evaluation or on the number of threads.
//!
//! The mixer is SplitMix64's finaliser (Steele, Lea, Flood 2014). [`Stream`] walks it for the few places that draw one
//! value after another.

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser of SplitMix64: a bijection whose output bits all depend on all input bits.
pub(crate) const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A seed for one purpose, independent of the seeds for others.
pub(crate) const fn derived(seed: u64, purpose: u64) -> u64 {
    mix(seed.wrapping_add(purpose.wrapping_add(1).wrapping_mul(GOLDEN)))
}

/// A value in [0, 1) that belongs to a cell of an integer lattice.
pub(crate) const fn lattice(seed: u64, i: i64, j: i64) -> f64 {
    let row = seed ^ (j as u64).wrapping_mul(0xd6e8_feb8_6659_fd93);
    unit(mix(row.wrapping_add((i as u64).wrapping_mul(GOLDEN))))
}

/// The upper 53 bits as a value in [0, 1).
const fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// A sequence of values.
#[derive(Debug, Clone)]
pub(crate) struct Stream {
    state: u64,
}

impl Stream {
    pub(crate) const fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mix(self.state)
    }

    /// Uniform in [`low`, `high`).
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * unit(self.next())
    }

    /// True with the given probability.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform(0.0, 1.0) < probability
    }

    /// Standard normal (Box and Muller 1958; the second value of the pair is not used).
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(0.0, 1.0)).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform(0.0, 1.0)).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_values_have_mean_zero_and_variance_one() {
        let mut stream = Stream::new(3);
        let values: Vec<f64> = (0..20_000).map(|_| stream.normal()).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "mean {mean}, variance {variance}");
    }

    #[test]
    fn purposes_have_seeds_of_their_own() {
        assert_ne!(derived(1, 0), derived(1, 1));
        assert_ne!(derived(1, 0), derived(2, 0));
    }
}
