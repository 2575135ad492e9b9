//! How likely a straight edge comes about by chance.
//!
//! The gradient of an image that holds nothing has any direction, each as likely as the others. A
//! sample of such a direction agrees with that of an edge by
//!
//! ```text
//! agreement = max(|cos a| − |sin a|, 0)
//! ```
//!
//! where `a` is the angle between the gradient and the normal of the edge: 1 for a perfect edge, 0
//! from 45° on. By chance, P(agreement > t) = (2 / π) (arccos(t / √2) − π / 4). The agreement of
//! `n` independent samples is a sum of `n` such numbers, whose distribution is computed once
//! by convolution on steps of 1 / 32. Samples are rounded down, and the distribution is
//! rounded up, so that no edge gets a smaller probability than it has (Desolneux, Moisan and Morel
//! 2000; Xue et al. 2018 for junctions).

use std::f64::consts::{FRAC_PI_4, PI, SQRT_2};

/// Steps of the agreement between 0 and 1.
pub(crate) const STEPS: usize = 32;

/// Returns the agreement of a gradient with an edge whose unit normal has the given scalar and
/// vector product with the unit gradient, in whole steps.
pub(crate) fn agreement(along_normal: f32, across: f32) -> u16 {
    ((along_normal.abs() - across.abs()).max(0.0) * STEPS as f32) as u16
}

/// Logarithms of the probabilities of sums of agreements.
#[derive(Debug)]
pub(crate) struct ChanceTable {
    /// For each number of samples, the logarithm (base 10) of the probability that the sum is at
    /// least so many steps.
    tails: Vec<Vec<f32>>,
}

impl ChanceTable {
    /// Computes the probabilities of sums of up to `samples` agreements.
    pub(crate) fn new(samples: usize) -> Self {
        let above = |t: f64| (2.0 / PI * ((t / SQRT_2).min(1.0).acos() - FRAC_PI_4)).max(0.0);
        // Share of agreements in each step; the highest step holds only the value 1.
        let mut one: Vec<f64> =
            (0..STEPS).map(|k| above(k as f64 / STEPS as f64) - above((k + 1) as f64 / STEPS as f64)).collect();
        one[0] += 0.5;
        let mut sum = vec![1.0];
        let mut tails = vec![vec![0.0]];
        for _ in 0..samples {
            let mut next = vec![0.0; sum.len() + STEPS - 1];
            for (at, share) in sum.iter().enumerate() {
                for (step, p) in one.iter().enumerate() {
                    next[at + step] += share * p;
                }
            }
            sum = next;
            let mut tail = 0.0;
            let mut logs: Vec<f32> = sum
                .iter()
                .rev()
                .map(|p| {
                    tail += p;
                    f64::log10(tail) as f32
                })
                .collect();
            logs.reverse();
            tails.push(logs);
        }
        Self { tails }
    }

    /// Returns the logarithm (base 10) of the probability that `samples` agreements sum up to at
    /// least `steps` by chance.
    pub(crate) fn log_probability(&self, samples: usize, steps: usize) -> f32 {
        let tails = &self.tails[samples.min(self.tails.len() - 1)];
        tails[steps.min(tails.len() - 1)]
    }
}
