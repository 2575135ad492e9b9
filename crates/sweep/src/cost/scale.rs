//! The unit of grey values in which the census is graded.

use crate::view::{QUANTISATION_VARIANCE, ViewLevel};

/// The difference that counts fully, in typical differences of the image: half of them then take part in full. Measured
/// on simulated towns of one and of several dates and on the LiDAR truth of JAX_068, where 0.3 to 0.7 are alike.
const FULL_DIFFERENCE: f32 = 0.5;

/// Brings differences of grey values to the unit that counts fully: of the image's contrast, or of its noise where that is more.
pub(crate) fn census_scale(view: &ViewLevel<'_>) -> f32 {
    1.0 / (FULL_DIFFERENCE * view.contrast).max(view.noise).max(QUANTISATION_VARIANCE.sqrt())
}
