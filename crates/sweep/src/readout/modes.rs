//! Heights from aggregated costs: a soft-argmin over a window, with its spread.
//!
//! The weights are `exp(−(S − min S) / T)` inside a window around the best hypothesis, so that a
//! second mode does not pull the mean. The minimum is subtracted first, so that the exponent is
//! never positive.
//!
//! The temperature T follows the mode. For costs `a (k − k₀)²` the weights are a normal density
//! with the deviation `√(T / 2a)`. Its mean over whole hypotheses equals k₀ to a thousandth only if
//! the deviation is near one step. A fixed temperature is too cold for sharp modes and locks
//! heights to the lattice.

use super::least::LeastSum;

/// Pixels whose modes are read together: a multiple of the lanes of every kind of register.
pub(crate) const TOGETHER: usize = 32;
/// Hypotheses on each side of the best one that belong to its mode.
const WINDOW: usize = 3;
/// Deviation of the weights for a parabolic mode, hypotheses. It is the smallest one that keeps the
/// mean unbiased, so that the window holds nearly all of the weight.
const DEVIATION: f32 = 0.8;
/// Marks a missing sum. No sum of path costs exceeds another one by as much.
const NONE: u16 = u16::MAX;

/// Aggregated costs of a run of pixels around their best hypotheses.
pub(crate) struct Modes {
    /// Index of the best hypothesis.
    best: [u16; TOGETHER],
    /// Excess of the sums before and behind the best one over it, the nearest first; [`NONE`]
    /// outside the window.
    excess: [[[u16; TOGETHER]; WINDOW]; 2],
    /// Excess of the best sum outside the window; [`NONE`] if there is none.
    outside: [u16; TOGETHER],
}

/// Heights of a run of pixels.
pub(crate) struct Estimates {
    /// Position of the height, in hypotheses from the first; NaN if all hypotheses are equally
    /// good.
    pub(crate) index: [f32; TOGETHER],
    /// Standard deviation of the position, in hypotheses.
    pub(crate) spread: [f32; TOGETHER],
    /// Excess of the best hypothesis outside the window, relative to the cost scale, 0 to 1.
    pub(crate) margin: [f32; TOGETHER],
}

impl Modes {
    /// Returns modes to be filled.
    pub(crate) fn new() -> Self {
        Self { best: [0; TOGETHER], excess: [[[NONE; TOGETHER]; WINDOW]; 2], outside: [NONE; TOGETHER] }
    }

    /// Takes over the sums of pixel `i`: the first `count` of `sums`, of which the one at `best` is
    /// the first of the least.
    #[inline(always)]
    pub(crate) fn put<S: LeastSum>(
        &mut self,
        token: S,
        i: usize,
        (sums, count): (&[u16], usize),
        (least, best): (u16, usize),
    ) {
        // If the range's end cut the window on one side only, it would pull the mean inward.
        let reach = WINDOW.min(best).min(count - 1 - best);
        self.best[i] = best as u16;
        let outside = token.least_outside(sums, count, best - reach, best + reach + 1);
        self.outside[i] = if outside == u16::MAX { NONE } else { outside - least };
        let [before, behind] = &mut self.excess;
        if reach == WINDOW {
            // The usual case needs one check of bounds.
            let window = &sums[best - WINDOW..][..2 * WINDOW + 1];
            for k in 0..WINDOW {
                before[k][i] = window[WINDOW - 1 - k] - least;
                behind[k][i] = window[WINDOW + 1 + k] - least;
            }
        } else {
            for k in 0..WINDOW {
                let inside = k < reach;
                before[k][i] = if inside { sums[best - 1 - k] - least } else { NONE };
                behind[k][i] = if inside { sums[best + 1 + k] - least } else { NONE };
            }
        }
    }

    /// Estimates the heights of all pixels of the run.
    ///
    /// `scale` is the sum of a hypothesis of worst cost. `noise` is the deviation of a cost
    /// relative to the scale; it turns the curvature of the mode into the deviation of its
    /// position.
    #[inline(always)]
    pub(crate) fn estimates(&self, scale: f32, noise: f32) -> Estimates {
        let mut out = Estimates { index: [0.0; TOGETHER], spread: [0.0; TOGETHER], margin: [0.0; TOGETHER] };
        let [before, behind] = &self.excess;
        for i in 0..TOGETHER {
            let outside = if self.outside[i] == NONE { scale } else { f32::from(self.outside[i]) };
            let margin = (outside / scale).min(1.0);
            // Either both neighbours are there or none is.
            let slopes = if before[0][i] == NONE { 0.0 } else { f32::from(before[0][i]) + f32::from(behind[0][i]) };
            let curvature = 0.5 * slopes;
            let cold = 1.0 / (2.0 * curvature * DEVIATION * DEVIATION);
            let (mut weight, mut first) = (1.0f32, 0.0f32);
            for k in 0..WINDOW {
                let weigh = |excess: u16| if excess == NONE { 0.0 } else { exp(-f32::from(excess) * cold) };
                let (before, behind) = (weigh(before[k][i]), weigh(behind[k][i]));
                weight += before + behind;
                first += (k + 1) as f32 * (behind - before);
            }
            let spread = (noise * scale / (2.0 * curvature)).sqrt().min(WINDOW as f32);
            let best = f32::from(self.best[i]);
            let nothing = if margin == 0.0 { f32::NAN } else { best };
            out.index[i] = if curvature == 0.0 { nothing } else { best + first / weight };
            out.spread[i] = if curvature == 0.0 { WINDOW as f32 } else { spread };
            out.margin[i] = margin;
        }
        out
    }
}

/// Computes `e^x` for x ≤ 0 to a relative error of 4e-6: a power of two times a polynomial of the
/// rest of the exponent. Unlike the library's function it is vectorised.
#[inline(always)]
fn exp(x: f32) -> f32 {
    // Smaller weights do not count, and their exponents would leave the bits of an f32.
    let t = (x * std::f32::consts::LOG2_E).max(-100.0);
    // Adding 1.5 · 2²³ rounds to an integer and leaves it in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let rounded = t + ROUND;
    let u = (t - (rounded - ROUND)) * std::f32::consts::LN_2;
    let series = 1.0 + u * (1.0 + u * (1.0 / 2.0 + u * (1.0 / 6.0 + u * (1.0 / 24.0 + u * (1.0 / 120.0)))));
    series * f32::from_bits(rounded.to_bits().wrapping_add(127) << 23)
}

#[cfg(test)]
mod tests {
    use super::super::least::WORDS;
    use super::*;
    use crate::simd::Arrays;
    use crate::testing::random::random;
    use proptest::prelude::*;

    /// One pixel's position, deviation and margin.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct Estimate {
        index: f32,
        spread: f32,
        margin: f32,
    }

    fn put(modes: &mut Modes, i: usize, sums: &[u16]) {
        let sums = [sums, &[0; WORDS]].concat();
        let own = (&sums[..], sums.len() - WORDS);
        modes.put(Arrays, i, own, Arrays.least(own.0, own.1));
    }

    fn estimate(modes: &Modes, i: usize, scale: f32, noise: f32) -> Option<Estimate> {
        let Estimates { index, spread, margin } = modes.estimates(scale, noise);
        let own = Estimate { index: index[i], spread: spread[i], margin: margin[i] };
        (!own.index.is_nan()).then_some(own)
    }

    /// Returns the estimate of a pixel that is alone in its run.
    fn read(sums: &[u16], scale: f32, noise: f32) -> Option<Estimate> {
        let mut modes = Modes::new();
        put(&mut modes, 0, sums);
        estimate(&modes, 0, scale, noise)
    }

    #[test]
    fn a_pixel_says_the_same_among_others_as_alone() {
        let mut random = random();
        let pixels: Vec<Vec<u16>> =
            (0..TOGETHER).map(|_| (0..1 + random(24)).map(|_| random(900) as u16).collect()).collect();
        let mut modes = Modes::new();
        pixels.iter().enumerate().for_each(|(i, sums)| put(&mut modes, i, sums));
        for (i, sums) in pixels.iter().enumerate() {
            assert_eq!(estimate(&modes, i, 1016.0, 0.02), read(sums, 1016.0, 0.02), "pixel {i}");
        }
    }

    #[test]
    fn equal_costs_say_nothing() {
        assert_eq!(read(&[500; 9], 1016.0, 0.05), None);
        let at_the_end = read(&[100, 500, 500], 1016.0, 0.05).unwrap();
        assert!(at_the_end.index == 0.0 && at_the_end.spread == WINDOW as f32);
    }

    proptest! {
        /// Whatever the costs are, the height lies among the hypotheses, deviation and margin are
        /// finite, and a common addend changes nothing.
        #[test]
        fn any_costs_give_a_number_or_nothing(
            sums in prop::collection::vec(prop_oneof![0..1016u16, 60_000..=60_100u16, Just(0u16)], 1..40),
            addend in 0..5000u16,
        ) {
            let found = read(&sums, 1016.0, 0.02);
            if let Some(e) = found {
                prop_assert!(e.index >= 0.0 && e.index <= (sums.len() - 1) as f32, "{e:?}");
                prop_assert!(e.spread > 0.0 && e.spread <= WINDOW as f32, "{e:?}");
                prop_assert!((0.0..=1.0).contains(&e.margin), "{e:?}");
            }
            let raised: Vec<u16> = sums.iter().map(|s| s + addend).collect();
            prop_assert_eq!(read(&raised, 1016.0, 0.02), found);
        }
    }

    proptest! {
        /// The definition, evaluated hypothesis by hypothesis with the library's exponential.
        #[test]
        fn the_mean_is_that_of_the_definition(sums in prop::collection::vec(0..900u16, 1..30)) {
            let (count, least) = (sums.len(), *sums.iter().min().unwrap());
            let best = sums.iter().position(|s| *s == least).unwrap();
            let reach = WINDOW.min(best).min(count - 1 - best);
            let above = |i: usize| f64::from(sums[i] - least);
            let curvature = if reach == 0 { 0.0 } else { 0.5 * (above(best - 1) + above(best + 1)) };
            let weight = |i: usize| match curvature {
                0.0 => f64::from(u8::from(i == best)),
                _ => (-above(i) / (2.0 * curvature * f64::from(DEVIATION).powi(2))).exp(),
            };
            let window = best - reach..best + reach + 1;
            let mean = window.clone().map(|i| weight(i) * i as f64).sum::<f64>() / window.map(weight).sum::<f64>();
            if let Some(e) = read(&sums, 1016.0, 0.02) {
                prop_assert!((f64::from(e.index) - mean).abs() < 1e-4, "{} for {mean}", e.index);
            }
        }
    }

    #[test]
    fn a_parabola_is_read_between_hypotheses_without_locking() {
        for tenth in -5..=5 {
            let truth = 10.0 + f32::from(tenth as i8) / 10.0;
            let sums: Vec<u16> = (0..21).map(|k| (60.0 * (k as f32 - truth).powi(2)).min(900.0) as u16).collect();
            let e = read(&sums, 1016.0, 0.02).unwrap();
            assert!((e.index - truth).abs() < 0.03, "{} for {truth}", e.index);
        }
    }

    #[test]
    fn a_second_mode_does_not_pull_the_mean() {
        let mut sums = [900u16; 40];
        sums[9..12].copy_from_slice(&[120, 100, 120]);
        sums[30] = 110;
        let e = read(&sums, 1016.0, 0.02).unwrap();
        assert!((e.index - 10.0).abs() < 1e-3, "{e:?}");
        assert!(e.margin < 0.02);
    }

    #[test]
    fn huge_costs_do_not_overflow() {
        assert_eq!(read(&[u16::MAX - 1, 0, u16::MAX - 1], 1016.0, 0.01).unwrap().index, 1.0);
    }

    #[test]
    fn the_exponential_is_that_of_the_library() {
        for i in 0..4000 {
            let x = -0.01 * i as f32;
            assert!((exp(x) - x.exp()).abs() <= 4e-6 * x.exp(), "e^{x} = {}", exp(x));
        }
    }
}
