//! Heights from aggregated costs: windowed soft-argmin with its spread.
//!
//! The weights are `exp(−(S − min S) / T)` inside a window around the best hypothesis, so that a second mode does not pull
//! the mean; the minimum is subtracted first, so the exponent is never positive whatever the costs are.
//!
//! The temperature follows the mode: for costs `a (k − k₀)²` the weights are a normal density of deviation `√(T / 2a)`,
//! and its mean over whole hypotheses is k₀ to a thousandth only if that deviation is near a step. A fixed temperature
//! is too cold for sharp modes and locks heights to the lattice.

use super::least::Sums;

/// Pixels whose modes are read together: whole registers of any kind.
pub(crate) const TOGETHER: usize = 32;
/// Hypotheses on each side of the best that belong to its mode.
const WINDOW: usize = 3;
/// Deviation of the weights for a parabolic mode, hypotheses: the least that keeps the mean unbiased, so that the
/// window holds all of it.
const DEVIATION: f32 = 0.8;
/// Stands for what is not there; no sum of path costs is as much above another.
const NONE: u16 = u16::MAX;

/// What the aggregated costs of a run of pixels say around their best hypotheses.
pub(crate) struct Modes {
    /// Places of the best hypotheses.
    best: [u16; TOGETHER],
    /// How far the sums before and behind the best are above it, the nearest first.
    above: [[[u16; TOGETHER]; WINDOW]; 2],
    /// How far the best sum outside of the window is above it.
    outside: [u16; TOGETHER],
}

/// What they say of the heights.
pub(crate) struct Estimates {
    /// Positions of the heights, in hypotheses from the first; NaN where all hypotheses are as good, which says nothing.
    pub(crate) index: [f32; TOGETHER],
    /// Standard deviations of the positions, in hypotheses.
    pub(crate) spread: [f32; TOGETHER],
    /// How much worse the best hypothesis outside the window is, relative to the cost scale, 0 to 1.
    pub(crate) margin: [f32; TOGETHER],
}

impl Modes {
    pub(crate) fn new() -> Self {
        Self { best: [0; TOGETHER], above: [[[NONE; TOGETHER]; WINDOW]; 2], outside: [NONE; TOGETHER] }
    }

    /// Takes the `count` sums of the pixel at `i`, of which that at `best` is the first of the least, with those of others behind
    /// them.
    #[inline(always)]
    pub(crate) fn put<S: Sums>(&mut self, i: usize, (sums, count): (&[u16], usize), (least, best): (u16, usize)) {
        // A window cut on one side by the range's end would pull the mean inward: both sides are cut alike.
        let reach = WINDOW.min(best).min(count - 1 - best);
        self.best[i] = best as u16;
        let outside = S::least_outside(sums, count, best - reach, best + reach + 1);
        self.outside[i] = if outside == u16::MAX { NONE } else { outside - least };
        let [before, behind] = &mut self.above;
        if reach == WINDOW {
            // Most are: one check of bounds.
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

    /// Reads all pixels of the run. `scale` is the sum that a worst-cost hypothesis would have; `noise` is the deviation of a cost
    /// relative to it, which turns the mode's curvature into the deviation of its position.
    #[inline(always)]
    pub(crate) fn estimates(&self, scale: f32, noise: f32) -> Estimates {
        let mut out = Estimates { index: [0.0; TOGETHER], spread: [0.0; TOGETHER], margin: [0.0; TOGETHER] };
        let [before, behind] = &self.above;
        for i in 0..TOGETHER {
            let outside = if self.outside[i] == NONE { scale } else { f32::from(self.outside[i]) };
            let margin = (outside / scale).min(1.0);
            // Both are there or none is.
            let slopes = if before[0][i] == NONE { 0.0 } else { f32::from(before[0][i]) + f32::from(behind[0][i]) };
            let curvature = 0.5 * slopes;
            let cold = 1.0 / (2.0 * curvature * DEVIATION * DEVIATION);
            let (mut weight, mut first) = (1.0f32, 0.0f32);
            for k in 0..WINDOW {
                let weigh = |above: u16| if above == NONE { 0.0 } else { exp(-f32::from(above) * cold) };
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

/// `e^x` for x ≤ 0 to a relative 4e-6: a power of two, and a polynomial for what is left of the exponent. The library's
/// took a third of the read-out's time.
#[inline(always)]
fn exp(x: f32) -> f32 {
    // Below this, weights count nothing, and the exponent would leave its bits.
    let t = (x * std::f32::consts::LOG2_E).max(-100.0);
    // Adding 1.5 · 2²³ rounds to a whole number, and leaves it in the lowest bits.
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
    use crate::simd::Anywhere;
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
        modes.put::<Anywhere>(i, own, Anywhere::least(own.0, own.1));
    }

    fn estimate(modes: &Modes, i: usize, scale: f32, noise: f32) -> Option<Estimate> {
        let Estimates { index, spread, margin } = modes.estimates(scale, noise);
        let own = Estimate { index: index[i], spread: spread[i], margin: margin[i] };
        (!own.index.is_nan()).then_some(own)
    }

    /// Reads a pixel alone.
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
        /// Whatever the costs are, the height lies among the hypotheses, its deviation and margin are numbers, and a
        /// common addend changes nothing.
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
        /// Hypothesis by hypothesis, with the library's exponential.
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
