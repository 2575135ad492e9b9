//! Random numbers by position: the i-th number of a stream does not depend on who asked for the others, so that threads may
//! share the work in any way. A number is SplitMix64's finaliser (Steele et al. 2014) over seed, stream and index.

/// A sequence of random numbers that can be asked for in any order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stream {
    key: u64,
}

impl Stream {
    /// The stream of a purpose.
    pub(crate) fn new(seed: u64, purpose: u64) -> Self {
        Self { key: mix(mix(seed).wrapping_add(purpose.wrapping_mul(0x9e37_79b9_7f4a_7c15))) }
    }

    /// The number at an index, in [0, 1).
    pub(crate) fn unit(self, index: u64) -> f64 {
        let bits = mix(self.key.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }
}

fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_even_and_streams_differ() {
        let (a, b) = (Stream::new(7, 0), Stream::new(7, 1));
        let n = 20_000;
        let mean = (0..n).map(|i| a.unit(i)).sum::<f64>() / n as f64;
        let both = (0..n).map(|i| (a.unit(i) - 0.5) * (b.unit(i) - 0.5)).sum::<f64>() / n as f64;
        // Standard errors are 0.0020 and 0.0006.
        assert!((mean - 0.5).abs() < 0.01 && both.abs() < 0.003, "{mean} {both}");
        assert!((0..n).all(|i| (0.0..1.0).contains(&a.unit(i))));
    }
}
