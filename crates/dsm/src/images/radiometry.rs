//! The noise and contrast of an image, which all parts of it share.

use numeric::upper_median;
use serde::{Deserialize, Serialize};
use sweep::SweepView;

/// Noise and contrast of one image, as measured in the windows of it that were read.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ImageRadiometry {
    /// Standard deviation of the noise at full resolution, grey values, one per window.
    pub noise: Vec<f32>,
    /// Typical difference of neighbouring pixels, grey values, by level and window.
    pub contrast: Vec<Vec<f32>>,
    /// Whether some window has pixels of different values.
    pub has_contrast: bool,
}

impl ImageRadiometry {
    /// Adds the measures of a window.
    pub(crate) fn add_window(&mut self, view: &SweepView) {
        self.has_contrast |= !is_blank(view);
        self.noise.push(view.noise);
        self.contrast.resize(self.contrast.len().max(view.contrast.len()), Vec::new());
        self.contrast.iter_mut().zip(&view.contrast).for_each(|(all, c)| all.push(*c));
    }

    /// Returns whether windows were read and none has contrast.
    pub(crate) fn is_blank(&self) -> bool {
        !self.noise.is_empty() && !self.has_contrast
    }

    /// Gives a view of a part of the image the noise and contrast of the whole: the medians over
    /// the windows.
    pub(crate) fn give_to(&self, view: &mut SweepView) {
        if let Some(noise) = median(&self.noise) {
            view.noise = noise;
        }
        for (own, all) in view.contrast.iter_mut().zip(&self.contrast) {
            *own = median(all).unwrap_or(*own);
        }
    }
}

/// Returns whether all valid pixels of a view have one value.
fn is_blank(view: &SweepView) -> bool {
    let mut values = view.levels[0].data().iter().filter(|v| v.is_finite());
    let first = values.next();
    values.all(|v| Some(v) == first)
}

fn median(values: &[f32]) -> Option<f32> {
    upper_median(&mut values.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_is_blank_when_windows_were_seen_and_none_has_contrast() {
        let seen =
            |noise: &[f32], has_contrast| ImageRadiometry { noise: noise.to_vec(), has_contrast, ..Default::default() };
        assert!(!seen(&[], false).is_blank() && seen(&[0.0, 0.0], false).is_blank() && !seen(&[0.0], true).is_blank());
        assert_eq!((median(&[9.0, 1.0, 2.0]), median(&[])), (Some(2.0), None));
    }
}
