//! Seeded random numbers that are the same on every machine: SplitMix64 (Steele, Lea and Flood
//! 2014, "Fast splittable pseudorandom number generators", OOPSLA).
//!
//! Output number `i` of seed `s` is `mix64(s + (i + 1) · γ)` modulo 2⁶⁴ with the golden gamma `γ` =
//! [`GOLDEN_GAMMA`]. So there are two forms:
//!
//! * [`SplitMix64`] draws one number after another.
//! * [`splitmix64_at`] and [`RandomByIndex`] compute any number of a sequence directly. The result
//!   does not depend on the order of the calls, so threads may share the work in any way.
//!
//! The generator is not cryptographic.

/// Increment of the state of SplitMix64: 2⁶⁴ divided by the golden ratio, made odd.
pub const GOLDEN_GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// Mixes 64 bits with the finaliser of SplitMix64, a bijection. Each output bit depends on all
/// input bits. It maps 0 to 0.
///
/// ```
/// assert_eq!(numeric::random::mix64(0), 0);
/// assert_eq!(numeric::random::mix64(1), 0x5692_161d_100b_05e5);
/// ```
#[inline]
pub const fn mix64(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Returns output number `index`, counted from 0, of the SplitMix64 sequence of `seed`.
///
/// ```
/// use numeric::random::{SplitMix64, splitmix64_at};
///
/// let mut sequence = SplitMix64::new(7);
/// assert_eq!(splitmix64_at(7, 0), sequence.next_u64());
/// assert_eq!(splitmix64_at(7, 1), sequence.next_u64());
/// ```
#[inline]
pub const fn splitmix64_at(seed: u64, index: u64) -> u64 {
    mix64(seed.wrapping_add(index.wrapping_add(1).wrapping_mul(GOLDEN_GAMMA)))
}

/// Hashes a number: neighbouring numbers get unrelated hashes. It is the first output of the
/// sequence with this seed.
///
/// ```
/// assert_eq!(numeric::random::hash64(0), 0xe220_a839_7b1d_cdaf);
/// ```
#[inline]
pub const fn hash64(value: u64) -> u64 {
    splitmix64_at(value, 0)
}

/// Converts the upper 53 bits to a number in [0, 1).
///
/// ```
/// assert_eq!(numeric::random::unit_interval(1 << 63), 0.5);
/// ```
#[inline]
pub const fn unit_interval(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Draws the numbers of a seed one after another.
///
/// ```
/// let mut random = numeric::SplitMix64::new(1_234_567);
/// assert_eq!(random.next_u64(), 6_457_827_717_110_365_317);
/// assert!((0.0..1.0).contains(&random.uniform()));
/// assert!(random.below(6) < 6);
/// ```
#[derive(Debug, Clone)]
pub struct SplitMix64 {
    state: u64,
}

impl SplitMix64 {
    /// Returns the sequence of a seed.
    #[inline]
    pub const fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// Draws 64 bits.
    #[inline]
    pub const fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN_GAMMA);
        mix64(self.state)
    }

    /// Draws a number from the uniform distribution on [0, 1).
    #[inline]
    pub const fn uniform(&mut self) -> f64 {
        unit_interval(self.next_u64())
    }

    /// Draws a number from the uniform distribution on [`low`, `high`).
    #[inline]
    pub const fn uniform_in(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Draws an integer from 0 to `count` − 1. Returns 0 if `count` is 0.
    #[inline]
    pub fn below(&mut self, count: usize) -> usize {
        ((self.uniform() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// Returns true with the given probability.
    #[inline]
    pub const fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Draws a number from the normal distribution with mean 0 and standard deviation 1 (Box and
    /// Muller 1958). It takes two uniform numbers and drops the second normal number of the pair.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// Computes the numbers of a seed and a purpose by their index, in any order.
///
/// ```
/// use numeric::RandomByIndex;
///
/// let (heights, widths) = (RandomByIndex::new(7, 0), RandomByIndex::new(7, 1));
/// let backwards: Vec<f64> = (0..3).rev().map(|i| heights.uniform(i)).collect();
/// assert_eq!(backwards[2], heights.uniform(0));
/// assert_ne!(heights.uniform(0), widths.uniform(0));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct RandomByIndex {
    seed: u64,
}

impl RandomByIndex {
    /// Returns the numbers that belong to `seed` and `purpose`. Different purposes of one seed give
    /// unrelated numbers.
    pub const fn new(seed: u64, purpose: u64) -> Self {
        Self { seed: splitmix64_at(hash64(seed), purpose) }
    }

    /// Returns number `index` of the uniform distribution on [0, 1).
    #[inline]
    pub const fn uniform(self, index: u64) -> f64 {
        unit_interval(splitmix64_at(self.seed, index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        // Outputs of the reference implementation, http://prng.di.unimi.it/splitmix64.c.
        let mut random = SplitMix64::new(1_234_567);
        let expected = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        assert_eq!([0; 5].map(|_| random.next_u64()), expected);
        assert_eq!([0, 1, 2, 3, 4].map(|i| splitmix64_at(1_234_567, i)), expected);
        let mut random = SplitMix64::new(0);
        assert_eq!([0; 2].map(|_| random.next_u64()), [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4]);
    }

    #[test]
    fn uniform_numbers_lie_between_their_limits() {
        assert_eq!((unit_interval(0), unit_interval(1 << 11)), (0.0, 2f64.powi(-53)));
        assert_eq!(unit_interval(u64::MAX), 1.0 - 2f64.powi(-53));
        let mut random = SplitMix64::new(5);
        assert!((0..1000).all(|_| (-3.0..4.5).contains(&random.uniform_in(-3.0, 4.5))));
        assert!((0..1000).all(|_| random.below(7) < 7));
        assert_eq!(random.below(0), 0);
        let hits = (0..10_000).filter(|_| random.chance(0.3)).count();
        // Six standard deviations of a binomial count.
        assert!((2725..3275).contains(&hits), "{hits}");
    }

    #[test]
    fn normal_numbers_have_the_moments_of_the_normal_distribution() {
        let mut random = SplitMix64::new(1);
        let values: Vec<f64> = (0..20_000).map(|_| random.normal()).collect();
        let moment = |k: i32| values.iter().map(|v| v.powi(k)).sum::<f64>() / values.len() as f64;
        assert!(moment(1).abs() < 0.03 && (moment(2) - 1.0).abs() < 0.05 && (moment(4) - 3.0).abs() < 0.3);
    }

    #[test]
    fn numbers_by_index_are_even_and_purposes_are_unrelated() {
        let (a, b) = (RandomByIndex::new(7, 0), RandomByIndex::new(7, 1));
        let n = 20_000;
        let mean = (0..n).map(|i| a.uniform(i)).sum::<f64>() / n as f64;
        let both = (0..n).map(|i| (a.uniform(i) - 0.5) * (b.uniform(i) - 0.5)).sum::<f64>() / n as f64;
        // Standard errors are 0.0020 and 0.0006.
        assert!((mean - 0.5).abs() < 0.01 && both.abs() < 0.003, "{mean} {both}");
        assert!((0..n).all(|i| (0.0..1.0).contains(&a.uniform(i))));
    }
}
