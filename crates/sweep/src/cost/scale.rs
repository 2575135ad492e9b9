//! The unit of grey values in which the census is graded.

use crate::view::{QUANTISATION_VARIANCE, ViewLevel};

/// Difference of grey values that counts fully, in typical differences of the image. Half of the
/// differences then count fully. Chosen on simulated towns of one and of several dates and on the
/// LiDAR truth of JAX_068, where values from 0.3 to 0.7 do equally well.
const FULL_DIFFERENCE: f32 = 0.5;

/// Returns the factor that brings differences of grey values to the unit of the census: the
/// difference that counts fully becomes 1. It depends on the image's contrast, or on its noise
/// where that is larger.
pub(crate) fn census_scale(view: &ViewLevel<'_>) -> f32 {
    1.0 / (FULL_DIFFERENCE * view.contrast).max(view.noise).max(QUANTISATION_VARIANCE.sqrt())
}
