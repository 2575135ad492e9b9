//! Seeds and random numbers of the scene by purpose and by place, so that none depends on the order
//! of evaluation or on the number of threads.

use numeric::random::{GOLDEN_GAMMA, mix64, splitmix64_at, unit_interval};

/// Returns a seed for one purpose. Seeds for different purposes are unrelated.
pub(crate) const fn derived(seed: u64, purpose: u64) -> u64 {
    splitmix64_at(seed, purpose)
}

/// Returns a number in [0, 1) that belongs to the node (i, j) of an integer lattice.
pub(crate) const fn lattice(seed: u64, i: i64, j: i64) -> f64 {
    let row = seed ^ (j as u64).wrapping_mul(0xd6e8_feb8_6659_fd93);
    unit_interval(mix64(row.wrapping_add((i as u64).wrapping_mul(GOLDEN_GAMMA))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn purposes_have_seeds_of_their_own() {
        assert_ne!(derived(1, 0), derived(1, 1));
        assert_ne!(derived(1, 0), derived(2, 0));
    }
}
