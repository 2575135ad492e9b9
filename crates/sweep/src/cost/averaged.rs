//! How many pairs of views are averaged, by the noise of the images.
//!
//! The best pair alone needs a single source that sees the point on a similar date. Where noise
//! hides the texture it needs nothing but luck: the least of several noisy costs is low at many
//! heights. The noise of a mean falls with the root of the number of pairs.

use numeric::order_statistic;

use crate::view::ViewLevel;

/// Ratio of signal to noise, in the mean of the differences of neighbouring pixels, that pairs are
/// added for.
const SIGNAL_TO_NOISE: f32 = 1.8;

/// Returns how many of the pairs of a reference and its sources bring the ratio of signal to noise
/// to [`SIGNAL_TO_NOISE`]: one at least, and all but one at most, because any point may be hidden
/// from a source. Among several sources one that is broken does not count: their median does.
pub(crate) fn averaged_pairs(reference: &ViewLevel<'_>, sources: &[ViewLevel<'_>]) -> usize {
    let mut of_sources: Vec<f32> = sources.iter().map(noise_to_signal).collect();
    let middle = of_sources.len().saturating_sub(1) / 2;
    let source = order_statistic(&mut of_sources, middle).unwrap_or(0.0);
    let pairs = SIGNAL_TO_NOISE.powi(2) * (noise_to_signal(reference) + source) / 2.0;
    (pairs.round() as usize).clamp(1, sources.len().max(2) - 1)
}

/// Returns the ratio of the variances of noise and signal; huge for an image of noise alone.
///
/// The contrast is the median of the greater of two differences, which is their standard deviation
/// (1.002 of it for white noise). The variance of a difference holds that of the noise twice.
fn noise_to_signal(view: &ViewLevel<'_>) -> f32 {
    let noise = view.noise.powi(2);
    noise / (view.contrast.powi(2) - 2.0 * noise).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::camera::leaning_camera;
    use crate::view::SweepView;
    use numeric::SplitMix64;
    use raster::Grid;

    const SIDE: usize = 200;

    /// Returns a view of squares of two by two pixels with noise of 10 grey values.
    fn view(squares: f32) -> SweepView {
        let mut random = SplitMix64::new(1);
        let texture: Vec<f32> = (0..SIDE * SIDE / 4).map(|_| squares * random.normal() as f32).collect();
        let value = |i: usize| texture[i / SIDE / 2 * (SIDE / 2) + i % SIDE / 2] + 10.0 * random.normal() as f32;
        SweepView::new(
            leaning_camera(SIDE, [0.0; 2]),
            Grid::from_vec(SIDE, SIDE, (0..SIDE * SIDE).map(value).collect()).unwrap(),
        )
    }

    #[test]
    fn the_noisier_the_images_the_more_pairs_are_averaged() {
        let pairs = |squares: [f32; 5]| {
            let views = squares.map(view);
            let levels: Vec<ViewLevel<'_>> = views.iter().enumerate().map(|(i, v)| v.on_level(i, 0)).collect();
            averaged_pairs(&levels[0], &levels[1..])
        };
        assert_eq!(pairs([100.0; 5]), 1);
        assert_eq!(pairs([32.0; 5]), 2);
        assert_eq!(pairs([0.0; 5]), 3, "a point may be hidden from one source");
        assert_eq!(pairs([100.0, 0.0, 100.0, 100.0, 100.0]), 1, "a broken source is no reason");
    }
}
