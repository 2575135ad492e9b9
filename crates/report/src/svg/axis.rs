//! Axis of a plot: its range, its ticks, and the positions of values.

/// Linear or logarithmic axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    label: String,
    low: f64,
    high: f64,
    logarithmic: bool,
    /// Whether values grow to the left or downwards, as the lines of an image do.
    reversed: bool,
    /// Ticks with their texts. They are computed if there are none.
    names: Vec<(f64, String)>,
}

impl Axis {
    /// Returns an axis from `low` to `high`. An empty or invalid range becomes 0 to 1.
    pub fn linear(label: &str, low: f64, high: f64) -> Self {
        let usable = low.is_finite() && high.is_finite() && high > low;
        let (low, high) = if usable { (low, high) } else { (0.0, 1.0) };
        Self { label: label.to_owned(), low, high, logarithmic: false, reversed: false, names: Vec::new() }
    }

    /// Returns a logarithmic axis that holds all positive values, with some margin.
    pub fn logarithmic(label: &str, values: impl Iterator<Item = f64>) -> Self {
        let positive = values.filter(|v| v.is_finite() && *v > 0.0);
        let (low, high) = positive.fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = if low <= high { (low / 1.3, high * 1.3) } else { (1.0, 10.0) };
        Self { logarithmic: true, ..Self::linear(label, low, high) }
    }

    /// Returns an axis of names. The i-th name stands at i + ½.
    pub fn names(label: &str, names: impl Iterator<Item = String>) -> Self {
        let names: Vec<(f64, String)> = names.enumerate().map(|(i, name)| (i as f64 + 0.5, name)).collect();
        Self { names: names.clone(), ..Self::linear(label, 0.0, names.len().max(1) as f64) }
    }

    /// Returns the axis with its values growing the other way.
    pub fn reversed(self) -> Self {
        Self { reversed: !self.reversed, ..self }
    }

    pub(super) fn label(&self) -> &str {
        &self.label
    }

    /// Returns the position of a value from 0 to 1. Values outside the range are moved to its ends.
    pub(super) fn fraction(&self, value: f64) -> f64 {
        let place = if self.logarithmic {
            (value.max(self.low) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        let place = if place.is_nan() { 0.0 } else { place.clamp(0.0, 1.0) };
        if self.reversed { 1.0 - place } else { place }
    }

    /// Returns the ticks with their texts, in rising order.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        if !self.names.is_empty() {
            return self.names.clone();
        }
        let all = if self.logarithmic { self.decades() } else { self.steps() };
        all.into_iter().map(|v| (v, text(v))).collect()
    }

    fn steps(&self) -> Vec<f64> {
        let step = eval::round_up((self.high - self.low) / 6.0);
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        (first..=last.min(first + 20)).map(|i| i as f64 * step).collect()
    }

    fn decades(&self) -> Vec<f64> {
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let digits: &[f64] =
            if self.high / self.low < 8.0 { &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0] } else { &[1.0, 2.0, 5.0] };
        let all = (first..=last).flat_map(|decade| digits.iter().map(move |digit| digit * 10f64.powi(decade)));
        all.filter(|v| (self.low..=self.high).contains(v)).collect()
    }
}

/// Formats a number without the rounding noise of its computation.
fn text(value: f64) -> String {
    let rounded = format!("{value:.4}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.replace('-', "\u{2212}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let texts = |axis: Axis| axis.ticks().into_iter().map(|(_, text)| text).collect::<Vec<_>>();
        assert_eq!(texts(Axis::linear("", -1.0, 1.0)), ["\u{2212}1", "\u{2212}0.5", "0", "0.5", "1"]);
        assert_eq!(texts(Axis::linear("", 0.0, 100.0)), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(texts(Axis::logarithmic("", [0.9, 30.0].into_iter())), ["1", "2", "5", "10", "20"]);
        assert_eq!(texts(Axis::logarithmic("", [0.6, 1.4].into_iter())), ["0.5", "0.6", "0.8", "1", "1.5"]);
        assert_eq!(texts(Axis::names("", ["a", "b"].map(String::from).into_iter())), ["a", "b"]);
    }

    #[test]
    fn a_reversed_axis_grows_the_other_way() {
        let axis = Axis::linear("line", 0.0, 8.0).reversed();
        assert_eq!([0.0, 2.0, 8.0, 99.0].map(|value| axis.fraction(value)), [1.0, 0.75, 0.0, 0.0]);
    }

    #[test]
    fn values_outside_and_values_that_are_none_stay_on_the_axis() {
        let axis = Axis::logarithmic("", [f64::NAN, 0.0].into_iter());
        for value in [f64::NAN, -3.0, 0.0, f64::INFINITY, 1e9] {
            assert!((0.0..=1.0).contains(&axis.fraction(value)));
        }
        assert_eq!(Axis::linear("", f64::NAN, 3.0).fraction(0.5), 0.5);
    }
}
