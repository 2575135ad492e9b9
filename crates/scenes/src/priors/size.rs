//! How large a dataset gets, which is said before the work begins.

use super::config::{PriorsConfig, PriorsImages};

/// Bytes of a pixel in the maps of a perspective view: depth, normal, mask, class and object in
/// `.npy`, and the two PNG.
const BYTES_PER_PIXEL: usize = 4 + 12 + 1 + 1 + 4 + 3;
/// Bytes of a pixel that GeoTIFF maps add at most.
const BYTES_PER_GEOTIFF_PIXEL: usize = 4 + 12 + 1 + 4;
/// Bytes of a pixel of a picture at most: a PNG with alpha.
const BYTES_PER_PICTURE_PIXEL: usize = 4;
/// Bytes of a point in binary: in `points3D.bin` without its track, and in the PLY.
const BYTES_PER_POINT: usize = 43 + 27;
/// Bytes of an observation in binary: in `points3D.bin` and `images.bin`.
const BYTES_PER_OBSERVATION: usize = 8 + 24;
/// Bytes of a point in the extra files: the second PLY, the text and both forms of splats.
const BYTES_PER_EXTRA_POINT: usize = 27 + 70 + 244 + 248;
/// Bytes of an observation in the text of the extra files.
const BYTES_PER_EXTRA_OBSERVATION: usize = 10 + 45;

/// Returns the largest size of a dataset of views with these numbers of columns and rows, bytes.
/// Pictures for people are not counted.
pub(super) fn largest_bytes(config: &PriorsConfig, points: usize, sizes: &[[usize; 2]]) -> usize {
    let pixels: usize = sizes.iter().map(|[width, height]| width.saturating_mul(*height)).sum();
    let mut per_pixel = BYTES_PER_PIXEL + if config.geotiff { BYTES_PER_GEOTIFF_PIXEL } else { 0 };
    if config.images != PriorsImages::None {
        per_pixel += BYTES_PER_PICTURE_PIXEL;
    }
    let maps = pixels.saturating_mul(per_pixel);
    if config.maps_only {
        return maps;
    }
    let seen = config.visibility.max_observations.min(sizes.len());
    let mut per_point = BYTES_PER_POINT + seen * BYTES_PER_OBSERVATION;
    if config.extras {
        per_point += BYTES_PER_EXTRA_POINT + seen * BYTES_PER_EXTRA_OBSERVATION;
    }
    maps.saturating_add(points.saturating_mul(per_point))
}

/// A number of bytes in words, with two significant digits.
pub(super) fn in_words(bytes: usize) -> String {
    let megabytes = bytes as f64 / 1e6;
    match megabytes {
        m if m < 1.0 => "less than 1 MB".to_owned(),
        m if m < 10.0 => format!("{m:.1} MB"),
        m if m < 1000.0 => format!("{m:.0} MB"),
        m => format!("{:.1} GB", m / 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::in_words;

    #[test]
    fn sizes_are_short() {
        let words = [400_000, 1_250_000, 97_400_000, 2_340_000_000].map(in_words);
        assert_eq!(words, ["less than 1 MB", "1.2 MB", "97 MB", "2.3 GB"]);
    }
}
