//! Heights from aggregated costs: windowed soft-argmin with its spread.
//!
//! The weights are `exp(−(S − min S) / T)` inside a window around the best hypothesis, so that a second mode does not pull
//! the mean; the minimum is subtracted first, so the exponent is never positive whatever the costs are.

/// What a pixel's aggregated costs say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    /// Position of the height, in hypotheses from the first.
    pub(crate) index: f32,
    /// Spread of the mode, in hypotheses.
    pub(crate) spread: f32,
    /// How much worse the best hypothesis outside the window is, relative to the cost scale, 0 to 1.
    pub(crate) margin: f32,
}

/// Hypotheses on each side of the best that belong to its mode.
const WINDOW: usize = 3;

/// Reads one pixel's sums; `scale` is the sum that a worst-cost hypothesis would have, `temperature` relative to it.
pub(crate) fn soft_argmin(sums: &[u16], scale: f32, temperature: f32) -> Option<Estimate> {
    let (best, &least) = sums.iter().enumerate().min_by_key(|&(_, s)| *s)?;
    let (from, to) = (best.saturating_sub(WINDOW), (best + WINDOW + 1).min(sums.len()));
    // A window cut on one side by the range's end would pull the mean inward: cut the other side alike.
    let reach = (best - from).min(to - 1 - best);
    let (from, to) = (best - reach, best + reach + 1);
    let (mut weight, mut first, mut second) = (0.0f32, 0.0f32, 0.0f32);
    for (i, &s) in sums.iter().enumerate().take(to).skip(from) {
        let w = (-f32::from(s - least) / (scale * temperature)).exp();
        let d = i as f32 - best as f32;
        weight += w;
        first += w * d;
        second += w * d * d;
    }
    let mean = first / weight;
    let outside = sums[..from].iter().chain(&sums[to..]).min().map_or(scale, |&s| f32::from(s - least));
    Some(Estimate {
        index: best as f32 + mean,
        spread: (second / weight - mean * mean).max(0.0).sqrt(),
        margin: (outside / scale).min(1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_costs_have_a_finite_answer_and_no_margin() {
        let e = soft_argmin(&[500; 9], 1016.0, 0.05).unwrap();
        assert!(e.index.is_finite() && e.spread.is_finite());
        assert_eq!(e.margin, 0.0_f32.max(e.margin.min(0.0)));
    }

    #[test]
    fn a_second_mode_does_not_pull_the_mean() {
        let mut sums = [900u16; 40];
        sums[9..12].copy_from_slice(&[120, 100, 120]);
        sums[30] = 110;
        let e = soft_argmin(&sums, 1016.0, 0.02).unwrap();
        assert!((e.index - 10.0).abs() < 1e-3, "{e:?}");
        assert!(e.margin < 0.02);
    }

    #[test]
    fn huge_costs_do_not_overflow_and_no_hypothesis_gives_nothing() {
        assert!(soft_argmin(&[u16::MAX, 0, u16::MAX], 1016.0, 0.01).unwrap().index.is_finite());
        assert!(soft_argmin(&[], 1016.0, 0.01).is_none());
    }
}
