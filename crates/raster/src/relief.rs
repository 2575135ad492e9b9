//! Pictures of heights: hillshade and coloured relief.
//!
//! The hillshade follows Horn (Proc. IEEE 69, 1981): slopes come from the eight neighbours with
//! weights 1, 2, 1. The shade is `cos(angle between the surface's normal and the sun)`, scaled to
//! 1–255 as in gdaldem; 0 is no-data. A neighbour without a height takes the height of the centre,
//! so that gaps in pictures are no wider than those in the data.

use numeric::nearest_quantile;
use rayon::prelude::*;

use crate::Grid;

/// Direction of the light, and exaggeration of the relief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Azimuth of the light, degrees clockwise from north (from the top of the picture).
    pub azimuth_deg: f32,
    /// Altitude of the light, degrees above the horizon.
    pub altitude_deg: f32,
    /// Factor by which heights are exaggerated.
    pub z_factor: f32,
}

impl Default for Light {
    fn default() -> Self {
        Self { azimuth_deg: 315.0, altitude_deg: 45.0, z_factor: 1.0 }
    }
}

/// Colours from low to high, evenly spaced: green plains, yellow, brown, light grey heights.
const RAMP: [[f32; 3]; 6] = [
    [52.0, 107.0, 85.0],
    [113.0, 158.0, 94.0],
    [205.0, 205.0, 127.0],
    [201.0, 153.0, 96.0],
    [150.0, 107.0, 93.0],
    [236.0, 232.0, 228.0],
];
/// Share of the shade in the blend of colour and shade.
const SHADE_SHARE: f32 = 0.75;
/// Colour of cells without a value on every map: lilac, which no ramp has. White or grey would be
/// that of the highest roofs, black that of shadows, blue that of water.
pub const VOID_COLOUR: [u8; 3] = [212, 168, 226];

/// Computes the shade of every cell. Rows run from north to south. Cells are `cell_size_m` metres
/// wide and high.
pub fn hillshade(heights: &Grid<f32>, cell_size_m: (f64, f64), light: Light) -> Grid<u8> {
    let (width, height) = (heights.width(), heights.height());
    let mut shade = Grid::filled(width, height, 0_u8);
    if width == 0 {
        return shade;
    }
    let (sin_altitude, cos_altitude) = light.altitude_deg.to_radians().sin_cos();
    let (sin_azimuth, cos_azimuth) = light.azimuth_deg.to_radians().sin_cos();
    let (scale_x, scale_y) =
        (light.z_factor / (8.0 * cell_size_m.0 as f32), light.z_factor / (8.0 * cell_size_m.1 as f32));
    shade.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        let rows = [heights.row(row.saturating_sub(1)), heights.row(row), heights.row((row + 1).min(height - 1))];
        for (column, cell) in out.iter_mut().enumerate() {
            let Some((dx, dy)) = horn(rows, column) else { continue };
            // Slopes towards east and north. The sun's horizontal direction is (sin azimuth, cos
            // azimuth).
            let (east, north) = (dx * scale_x, -dy * scale_y);
            let facing = sin_altitude - cos_altitude * (east * sin_azimuth + north * cos_azimuth);
            let cosine = facing / (1.0 + east * east + north * north).sqrt();
            *cell = (1.0 + 254.0 * cosine.max(0.0)).round() as u8;
        }
    });
    shade
}

/// Returns Horn's sums of differences towards larger columns and rows, or `None` if the centre has
/// no height.
fn horn(rows: [&[f32]; 3], column: usize) -> Option<(f32, f32)> {
    let centre = rows[1][column];
    if !centre.is_finite() {
        return None;
    }
    let (left, right) = (column.saturating_sub(1), (column + 1).min(rows[1].len() - 1));
    let at = |row: usize, c: usize| {
        let value = rows[row][c];
        if value.is_finite() { value } else { centre }
    };
    let dx = (at(0, right) + 2.0 * at(1, right) + at(2, right)) - (at(0, left) + 2.0 * at(1, left) + at(2, left));
    let dy = (at(2, left) + 2.0 * at(2, column) + at(2, right)) - (at(0, left) + 2.0 * at(0, column) + at(0, right));
    Some((dx, dy))
}

/// Colours heights from `low_m` to `high_m` and shades them. Cells without a height have
/// [`VOID_COLOUR`].
pub fn coloured_relief(heights: &Grid<f32>, shade: &Grid<u8>, low_m: f32, high_m: f32) -> Grid<[u8; 3]> {
    let span = if high_m > low_m { high_m - low_m } else { 1.0 };
    // Flat ground has the shade of the sun's altitude (sin 45° by default). It should keep its
    // colour.
    let flat = 255.0 * std::f32::consts::FRAC_1_SQRT_2;
    let mut picture = Grid::filled(heights.width(), heights.height(), VOID_COLOUR);
    let cells = heights.data().iter().zip(shade.data());
    for (pixel, (&height, &shade)) in picture.data_mut().iter_mut().zip(cells) {
        if height.is_finite() {
            let light = 1.0 - SHADE_SHARE + SHADE_SHARE * f32::from(shade) / flat;
            *pixel = ramp((height - low_m) / span).map(|c| (c * light).clamp(0.0, 255.0).round() as u8);
        }
    }
    picture
}

/// Returns a shade as a picture, in which cells without a height have [`VOID_COLOUR`].
pub fn shade_picture(shade: &Grid<u8>) -> Grid<[u8; 3]> {
    shade.map(|&shade| if shade == 0 { VOID_COLOUR } else { [shade; 3] })
}

/// Returns the heights at two percentiles (0–100) of the valid cells, or `None` without valid
/// cells. As a range for [`coloured_relief`], they keep outliers from stretching the colours.
///
/// ```
/// let heights = raster::Grid::from_vec(5, 1, vec![1.0, 2.0, 3.0, 4.0, f32::NAN]).unwrap();
/// assert_eq!(raster::height_percentiles(&heights, 0.0, 100.0), Some((1.0, 4.0)));
/// ```
pub fn height_percentiles(heights: &Grid<f32>, low: f64, high: f64) -> Option<(f32, f32)> {
    let mut valid: Vec<f32> = heights.data().iter().copied().filter(|h| h.is_finite()).collect();
    let mut at = |percent: f64| nearest_quantile(&mut valid, percent.clamp(0.0, 100.0) / 100.0);
    Some((at(low)?, at(high)?))
}

/// Returns the colour of flat ground in [`coloured_relief`] at a fraction of the range of heights,
/// clamped to [0, 1].
pub fn relief_colour(fraction: f32) -> [u8; 3] {
    ramp(fraction).map(|c| c.round() as u8)
}

/// Returns the ramp's colour at a fraction, clamped to [0, 1].
fn ramp(fraction: f32) -> [f32; 3] {
    let position = fraction.clamp(0.0, 1.0) * (RAMP.len() - 1) as f32;
    let below = (position as usize).min(RAMP.len() - 2);
    let t = position - below as f32;
    std::array::from_fn(|i| RAMP[below][i] + (RAMP[below + 1][i] - RAMP[below][i]) * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slope(dx: f32, dy: f32) -> Grid<f32> {
        Grid::from_vec(9, 9, (0..81).map(|i| (i % 9) as f32 * dx + (i / 9) as f32 * dy).collect()).unwrap()
    }

    #[test]
    fn flat_ground_has_the_sine_of_the_altitude() {
        let shade = hillshade(&slope(0.0, 0.0), (1.0, 1.0), Light::default());
        assert!(shade.data().iter().all(|&s| s == (1.0 + 254.0 * 45_f32.to_radians().sin()).round() as u8));
    }

    #[test]
    fn a_slope_towards_the_sun_is_bright_and_away_is_dark() {
        // The ground rises to the lower right, so it faces north-west, where the sun is.
        let facing = hillshade(&slope(0.5, 0.5), (0.5, 0.5), Light::default())[(4, 4)];
        let averted = hillshade(&slope(-0.5, -0.5), (0.5, 0.5), Light::default())[(4, 4)];
        let flat = hillshade(&slope(0.0, 0.0), (0.5, 0.5), Light::default())[(4, 4)];
        assert!(facing > flat && flat > averted && averted == 1, "{facing} {flat} {averted}");
    }

    /// Heights of any size in any light look different from cells without a height: by a tenth of
    /// the range of a channel. Greys come nearest.
    #[test]
    fn voids_have_a_colour_that_no_height_has() {
        let far = |a: [u8; 3]| a.iter().zip(VOID_COLOUR).map(|(&a, b)| u32::from(a.abs_diff(b))).max() >= Some(24);
        let heights = Grid::from_vec(256, 1, (0..256).map(|i| i as f32).collect()).unwrap();
        for shade in 1..=255 {
            let picture = coloured_relief(&heights, &Grid::filled(256, 1, shade), 0.0, 255.0);
            assert!(picture.data().iter().all(|&colour| far(colour)), "in the shade {shade}");
            assert!(far([shade; 3]));
        }
    }

    #[test]
    fn holes_are_zero_and_do_not_spread() {
        let mut heights = slope(0.1, 0.0);
        heights[(4, 4)] = f32::NAN;
        let shade = hillshade(&heights, (1.0, 1.0), Light::default());
        assert_eq!(shade.data().iter().filter(|&&s| s == 0).count(), 1);
        let (low, high) = height_percentiles(&heights, 2.0, 98.0).unwrap();
        let picture = coloured_relief(&heights, &shade, low, high);
        assert_eq!(picture.data().iter().filter(|&&p| p == VOID_COLOUR).count(), 1);
        assert_eq!(shade_picture(&shade).data().iter().filter(|&&p| p == VOID_COLOUR).count(), 1);
        assert!(low < high && picture[(0, 0)] != picture[(8, 0)]);
        assert_eq!(height_percentiles(&Grid::filled(2, 2, f32::NAN), 2.0, 98.0), None);
    }
}
