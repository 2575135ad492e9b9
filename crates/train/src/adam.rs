//! Adam (Kingma and Ba, "Adam: A Method for Stochastic Optimization", ICLR 2015).

/// Decay of the means.
const DECAY: [f32; 2] = [0.9, 0.999];
/// Keeps the division from 0.
const EPSILON: f32 = 1e-15;

/// Running means of a group of parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moments<const N: usize> {
    pub(crate) mean: [f32; N],
    pub(crate) square: [f32; N],
    /// Number of steps so far.
    pub(crate) steps: u32,
}

impl<const N: usize> Default for Moments<N> {
    fn default() -> Self {
        Self { mean: [0.0; N], square: [0.0; N], steps: 0 }
    }
}

impl<const N: usize> Moments<N> {
    /// Takes a step down a gradient. A gradient that is not finite is left out.
    pub(crate) fn step(&mut self, parameters: &mut [f32; N], gradient: &[f32; N], rates: &[f32; N]) {
        if gradient.iter().all(|g| g.is_finite()) {
            self.steps = self.steps.saturating_add(1);
            update([parameters, &mut self.mean, &mut self.square], gradient, self.steps, |i| rates[i]);
        }
    }
}

/// Takes a step of parameters with running means of their own, which have taken `steps` with this
/// one. A gradient that is not finite is left out.
pub(crate) fn step_all(moments: [&mut [f32]; 3], gradient: &[f32], steps: u32, rate: f32) {
    if gradient.iter().all(|g| g.is_finite()) {
        update(moments, gradient, steps.max(1), |_| rate);
    }
}

/// Moves parameters and their running means by a gradient, each at its own rate.
#[inline]
fn update([parameters, mean, square]: [&mut [f32]; 3], gradient: &[f32], steps: u32, rate: impl Fn(usize) -> f32) {
    let steps = i32::try_from(steps).unwrap_or(i32::MAX);
    let unbiased = DECAY.map(|decay| 1.0 - decay.powi(steps));
    let all = parameters.iter_mut().zip(mean).zip(square).zip(gradient);
    for (i, (((parameter, mean), square), gradient)) in all.enumerate() {
        *mean = DECAY[0] * *mean + (1.0 - DECAY[0]) * gradient;
        *square = DECAY[1] * *square + (1.0 - DECAY[1]) * gradient * gradient;
        *parameter -= rate(i) * (*mean / unbiased[0]) / ((*square / unbiased[1]).sqrt() + EPSILON);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_has_its_minimum_found() {
        let (mut moments, mut at) = (Moments::<2>::default(), [3.0f32, -1.0]);
        for _ in 0..2000 {
            let gradient = [2.0 * (at[0] - 1.0), 200.0 * (at[1] - 2.0)];
            moments.step(&mut at, &gradient, &[0.01, 0.01]);
        }
        assert!((at[0] - 1.0).abs() < 1e-2 && (at[1] - 2.0).abs() < 1e-2, "{at:?}");
        moments.step(&mut at, &[f32::NAN, 0.0], &[0.01, 0.01]);
        assert!(at[0].is_finite());
    }
}
