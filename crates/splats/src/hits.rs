//! Splats on the ray of a pixel, and their weights.
//!
//! The constants are those of Kerbl et al. 2023: nothing below 1/255, at most 0.99, an end below a
//! transmittance of 10⁻⁴.
//!
//! Splats are taken front to back by their depths on the ray. Splats that follow one another within
//! [`SAME_SURFACE_M`] are parts of one surface: which of them is in front is chance, or a tilt of
//! millimetres. They are mixed in proportion to their opacities, wᵢ = T (1 − Π (1 − αⱼ)) αᵢ / Σ αⱼ.
//! What is behind them sees the same transmittance in any order. If the order decided, each splat
//! would cover the one behind it, and every seam of a plane would be drawn away from the sensor.

/// Side of a tile, pixels.
pub(super) const TILE: usize = 16;

/// Least opacity that counts.
pub(super) const ALPHA_MIN: f32 = 1.0 / 255.0;
const ALPHA_MAX: f32 = 0.99;
const TRANSMITTANCE_MIN: f32 = 1e-4;
/// Depths within which splats belong to one surface, metres: the default bound on the distance of
/// heights from a splat's plane.
const SAME_SURFACE_M: f32 = 0.25;

/// A splat on the ray of a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Index in the tile's list.
    pub(super) slot: u32,
    pub(super) alpha: f32,
    pub(super) depth: f32,
    /// Local height at which the ray meets the splat.
    pub(super) height: f32,
}

/// Returns the distance, in standard deviations, at which the opacity falls below the least one
/// that counts.
pub(super) fn reach(opacity: f32) -> f64 {
    (2.0 * (f64::from(opacity) / f64::from(ALPHA_MIN)).ln()).max(0.0).sqrt()
}

/// Adds a hit to those of a pixel, which are in the order of their depths.
pub(super) fn insert(hits: &mut Vec<Hit>, hit: Hit) {
    let behind = hits.iter().rev().take_while(|known| known.depth > hit.depth).count();
    hits.insert(hits.len() - behind, hit);
}

/// Calls `add` with the hits of a pixel and their weights, front to back.
pub(super) fn weigh(hits: &[Hit], mut add: impl FnMut(&Hit, f32)) {
    let mut transmittance = 1.0f32;
    let mut rest = hits;
    while let Some(first) = rest.first() {
        if transmittance < TRANSMITTANCE_MIN {
            return;
        }
        let count = rest.iter().take_while(|hit| hit.depth <= first.depth + SAME_SURFACE_M).count().max(1);
        let (surface, behind) = rest.split_at(count);
        let alpha = |hit: &Hit| hit.alpha.min(ALPHA_MAX);
        let through: f32 = surface.iter().map(|hit| 1.0 - alpha(hit)).product();
        let share = transmittance * (1.0 - through) / surface.iter().map(alpha).sum::<f32>();
        surface.iter().for_each(|hit| add(hit, share * alpha(hit)));
        transmittance *= through;
        rest = behind;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn weights(hits: &[(f32, f32)]) -> Vec<f32> {
        let mut sorted = Vec::new();
        for (slot, &(depth, alpha)) in (0..).zip(hits) {
            insert(&mut sorted, Hit { slot, alpha, depth, height: 0.0 });
        }
        let mut weights = vec![0.0; hits.len()];
        weigh(&sorted, |hit, weight| weights[hit.slot as usize] += weight);
        weights
    }

    #[test]
    fn surfaces_hide_what_is_behind_and_their_own_splats_share() {
        assert_eq!(weights(&[(9.0, 0.5), (3.0, 0.75)]), [0.125, 0.75]);
        let [near, also, far] = weights(&[(3.1, 0.5), (3.0, 0.25), (8.0, 0.5)])[..] else { unreachable!() };
        assert!((near - 2.0 * also).abs() < 1e-6 && (near + also - 0.625).abs() < 1e-6);
        assert!((far - 0.5 * 0.375).abs() < 1e-6);
    }

    proptest! {
        /// The weights add up to what front-to-back composition stops, in any order of the hits.
        #[test]
        fn weights_add_up(hits in prop::collection::vec((0.0..4.0f32, 0.01..0.95f32), 1..12)) {
            let found = weights(&hits);
            let through: f32 = hits.iter().map(|(_, alpha)| 1.0 - alpha).product();
            prop_assert!((found.iter().sum::<f32>() - (1.0 - through)).abs() < 2e-4, "{found:?}");
            let mut turned = hits.clone();
            turned.reverse();
            let mut other = weights(&turned);
            other.reverse();
            prop_assert!(found.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-5));
        }
    }
}
