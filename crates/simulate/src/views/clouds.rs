//! Clouds over an image, with a chosen share and extent. Every view has its own, because clouds
//! move between views.

use raster::Grid;

use crate::config::CloudsConfig;
use crate::surface::noise::value_noise;

/// Radiance of a thick cloud.
pub(crate) const CLOUD_RADIANCE: f32 = 0.9;
/// Width of the edge of a cloud, in units of the noise.
const EDGE: f64 = 0.06;
/// Stride of the pixels from which the threshold for the share is found.
const STRIDE: usize = 4;

/// Returns the opacity of the clouds at each pixel, 0 to 1. `None` if there are none.
pub(crate) fn opacity(
    config: &CloudsConfig,
    seed: u64,
    gsd_m: f64,
    (width, height): (usize, usize),
) -> Option<Grid<f32>> {
    if config.share == 0.0 {
        return None;
    }
    let density = |column: usize, row: usize| {
        let (x, y) = (column as f64 * gsd_m, row as f64 * gsd_m);
        let octave =
            |k: u64| value_noise(seed ^ k, config.extent_m / f64::from(1u32 << k), x, y) / f64::from(1u32 << k);
        (0..4).map(octave).sum::<f64>()
    };
    let mut some: Vec<f64> = (0..height)
        .step_by(STRIDE)
        .flat_map(|row| (0..width).step_by(STRIDE).map(move |column| (column, row)))
        .map(|(column, row)| density(column, row))
        .collect();
    some.sort_unstable_by(f64::total_cmp);
    let hidden = (config.share * some.len() as f64).round() as usize;
    let threshold = some.get(some.len().saturating_sub(hidden)).copied().unwrap_or(f64::INFINITY);
    let opacity = |index: usize| {
        let above = (density(index % width, index / width) - threshold) / EDGE;
        above.clamp(0.0, 1.0) as f32
    };
    Grid::from_vec(width, height, (0..width * height).map(opacity).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_hide_their_share() {
        for share in [0.05, 0.4, 1.0] {
            let config = CloudsConfig { share, extent_m: 60.0, masked: true };
            let cover = opacity(&config, 3, 0.5, (300, 240)).unwrap();
            let hidden = cover.data().iter().filter(|o| **o > 0.0).count() as f64 / cover.data().len() as f64;
            assert!((hidden - share).abs() < 0.02, "{hidden} hidden of {share}");
        }
        assert!(opacity(&CloudsConfig { share: 0.0, extent_m: 60.0, masked: true }, 3, 0.5, (30, 24)).is_none());
    }
}
