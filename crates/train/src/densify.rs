//! Surfels are split where the image pulls at them and removed where no view needs them, within a
//! budget (Kerbl et al., "3D Gaussian Splatting", SIGGRAPH 2023).

use crate::adam::Moments;
use crate::config::DensifyConfig;
use crate::order::spatial_order;
use crate::state::TrainingState;
use crate::surfel::Surfel;

/// Distance of the two halves of a surfel from its centre, and their size, in its standard
/// deviations. Together they have about the spread of the whole.
const HALF_OFFSET: f32 = 0.6;
const HALF_SIZE: f32 = 0.7;

/// Numbers of surfels in a round.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DensifyCounts {
    /// Surfels that were split into two.
    pub split: usize,
    /// Surfels that were removed.
    pub removed: usize,
}

/// Splits and removes surfels, and brings the rest into the order of space.
pub(crate) fn densify(state: &mut TrainingState, config: &DensifyConfig) -> DensifyCounts {
    let mean_pull = |number: usize| {
        let [sum, count] = state.pulls[number];
        sum / count.max(1.0)
    };
    let kept = |number: &usize| {
        let drawn = state.pulls[*number][1] > 0.0;
        drawn && state.surfels[*number].opacity() >= config.least_opacity
    };
    let kept: Vec<usize> = (0..state.surfels.len()).filter(kept).collect();
    let mut pulled: Vec<usize> = kept.iter().copied().filter(|&n| f64::from(mean_pull(n)) > config.gradient).collect();
    // The strongest first; the order of equals is that of their numbers.
    pulled.sort_by(|&a, &b| mean_pull(b).total_cmp(&mean_pull(a)).then(a.cmp(&b)));
    pulled.truncate(config.budget.saturating_sub(kept.len()));
    let counts = DensifyCounts { split: pulled.len(), removed: state.surfels.len() - kept.len() };
    let mut is_split = vec![false; state.surfels.len()];
    pulled.iter().for_each(|&number| is_split[number] = true);

    // The surfel that each one comes from, and whether it is still the same.
    let mut sources: Vec<(usize, bool)> = Vec::with_capacity(kept.len() + pulled.len());
    let mut made: Vec<(Surfel, Moments<{ Surfel::PARAMETERS }>)> = Vec::with_capacity(sources.capacity());
    for number in kept {
        if is_split[number] {
            made.extend(halves(&state.surfels[number]).map(|half| (half, Moments::default())));
            sources.extend([(number, false); 2]);
        } else {
            made.push((state.surfels[number], state.moments[number]));
            sources.push((number, true));
        }
    }
    let surfels: Vec<Surfel> = made.iter().map(|(surfel, _)| *surfel).collect();
    let order = spatial_order(&surfels);
    state.surfels = order.iter().map(|&number| made[number as usize].0).collect();
    state.moments = order.iter().map(|&number| made[number as usize].1).collect();
    let sources: Vec<(usize, bool)> = order.iter().map(|&number| sources[number as usize]).collect();
    state.harmonics.rearrange(&sources);
    state.pulls = vec![[0.0; 2]; state.surfels.len()];
    counts
}

/// Brings the opacities down to at most `most`, so that surfels which no view needs stay
/// transparent and are removed (3DGS). The steps of the optimiser begin anew.
pub(crate) fn reset_opacities(state: &mut TrainingState, most: f64) {
    let most = (most / (1.0 - most)).ln() as f32;
    for (surfel, moments) in state.surfels.iter_mut().zip(&mut state.moments) {
        surfel.opacity_logit = surfel.opacity_logit.min(most);
        moments.mean[Surfel::OPACITY] = 0.0;
        moments.square[Surfel::OPACITY] = 0.0;
    }
}

/// Returns the halves of a surfel, cut across its longer axis.
fn halves(surfel: &Surfel) -> [Surfel; 2] {
    let longer = usize::from(surfel.log_scale[1] > surfel.log_scale[0]);
    let (axis, scale) = (surfel.axes()[longer], surfel.scale_m()[longer]);
    [-1.0f32, 1.0].map(|side| {
        let mut half = *surfel;
        for (coordinate, along) in half.position.iter_mut().zip(axis) {
            *coordinate += side * HALF_OFFSET * (scale * along) as f32;
        }
        half.log_scale[longer] += HALF_SIZE.ln();
        half
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harmonics::LearnedHarmonics;

    #[test]
    fn surfels_are_split_and_removed_within_the_budget() {
        let surfel = |x: f32, logit: f32| Surfel {
            position: [x, 0.0, 0.0],
            rotation: [1.0, 0.0, 0.0, 0.0],
            log_scale: [0.0, -1.0],
            opacity_logit: logit,
            colour: [0.5; 3],
        };
        let surfels =
            vec![surfel(0.0, 2.0), surfel(10.0, 2.0), surfel(20.0, -9.0), surfel(30.0, 2.0), surfel(40.0, 2.0)];
        let mut state = TrainingState::new(surfels, 1);
        let numbered = (0..45).map(|k| (k / 9) as f32).collect();
        state.harmonics = LearnedHarmonics::of(&gaussian::SplatHarmonics::new(1, numbered).unwrap(), 5);
        // Weak, strong, transparent, unseen, stronger.
        state.pulls = vec![[1e-5, 1.0], [3e-3, 2.0], [1.0, 1.0], [0.0, 0.0], [8e-3, 2.0]];
        let config = DensifyConfig { budget: 4, ..DensifyConfig::default() };
        let counts = densify(&mut state, &config);
        assert_eq!(counts, DensifyCounts { split: 1, removed: 2 });
        let mut x: Vec<f32> = state.surfels.iter().map(|s| s.position[0]).collect();
        x.sort_by(f32::total_cmp);
        assert_eq!(x, [0.0, 10.0, 39.4, 40.6]);
        assert_eq!((state.moments.len(), state.pulls.len()), (4, 4));
        // Halves have the harmonics of the whole, and all are in the order of the surfels.
        let source = |number: usize| state.harmonics.to_splats().unwrap().of(number, 2)[0];
        let own = |number: usize| (state.surfels[number].position[0] / 10.0).round();
        assert!((0..4).all(|number| source(number) == own(number)));
        state.surfels[1].opacity_logit = -7.0;
        state.moments[0].square = [1.0; Surfel::PARAMETERS];
        reset_opacities(&mut state, 0.01);
        let opacity = |number: usize| state.surfels[number].opacity();
        assert!((opacity(0) - 0.01).abs() < 1e-6 && (opacity(1) - 1.0 / (1.0 + 7f64.exp())).abs() < 1e-6);
        assert_eq!((state.moments[0].square[8], state.moments[0].square[9]), (1.0, 0.0));
    }
}
