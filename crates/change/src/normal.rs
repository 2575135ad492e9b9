//! The tail of the normal distribution, in logarithms, because regions of strong change have
//! probabilities that no float can hold.

/// Returns the natural logarithm of the probability that a standard normal number exceeds `t` in
/// magnitude. The relative error is below 1 % for all `t`.
///
/// Near 0 it uses formula 26.2.17 of Abramowitz and Stegun, and far out the continued fraction.
pub(crate) fn ln_two_sided(t: f64) -> f64 {
    let t = t.abs();
    let ln_density = -0.5 * t * t - 0.5 * std::f64::consts::TAU.ln();
    let ln_tail = if t < 4.0 {
        let k = 1.0 / (1.0 + 0.231_641_9 * t);
        let series =
            k * (0.319_381_530 + k * (-0.356_563_782 + k * (1.781_477_937 + k * (-1.821_255_978 + k * 1.330_274_429))));
        ln_density + series.ln()
    } else {
        let fraction = (1..=12).rev().fold(t, |below, n| t + f64::from(n) / below);
        ln_density - fraction.ln()
    };
    ln_tail + std::f64::consts::LN_2
}

/// Returns the `t` that a standard normal number exceeds in magnitude with the probability `p`.
pub(crate) fn two_sided_quantile(p: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if ln_two_sided(middle) > p.ln() { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_and_quantiles_are_those_of_tables() {
        for (t, p) in [(0.0, 1.0), (1.0, 0.317_310_5), (1.959_964, 0.05), (3.0, 2.699_796e-3), (5.0, 5.733_031e-7)] {
            let found = ln_two_sided(t).exp();
            assert!((found / p - 1.0).abs() < 1e-2, "{t}: {found}");
        }
        assert!((ln_two_sided(40.0) - (-804.608_442_f64 + std::f64::consts::LN_2)).abs() < 0.01);
        assert!((two_sided_quantile(0.05) - 1.96).abs() < 1e-2);
    }
}
