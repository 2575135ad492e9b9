//! Image chips: the surroundings of a ground point in a small image are searched for in an image.
//!
//! The image is resampled once in the frame of the chip, around the place where the camera expects
//! the point. The zero-mean normalised cross-correlation of every place within the pointing error
//! is computed, over the pixels that both show: NaN hides pixels on either side. A chip is as large
//! as its image reaches on all sides and at least half of it is clear. The best place must
//! correlate well and lead over every other peak, because a wrong control point does more harm than
//! none.
//!
//! The place is refined by least-squares matching (Gruen 1985): an affine map from the chip to the
//! image, and a gain and an offset of the grey values, are adjusted to all pixels of the chip. The
//! affine map follows a slope of the ground, which would pull the top of the correlation aside.

use std::borrow::Cow;

use raster::{Grid, Window, bicubic_along, level_from_level0, level0_from_level, reduce};

use super::chip_fit::{Chip, ChipSearch, fit};
use super::masked_patch::{MaskedPatch, clear_radius};
use super::moments::remove_mean;
use super::patch::{NO_PIXELS, Patch, padded};

/// How a chip is searched for.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ChipConfig {
    /// Least half width of a chip, its pixels. Fewer pixels are found in many places.
    pub radius_min: usize,
    /// Greatest half width that is compared, pixels of the chip. Relief moves the rest of a larger
    /// chip.
    pub radius_max: usize,
    /// Least correlation. Another date of the same place usually reaches it.
    pub score: f32,
    /// Smallest lead in correlation over every other peak.
    pub margin: f32,
}

impl Default for ChipConfig {
    fn default() -> Self {
        Self { radius_min: 7, radius_max: 24, score: 0.6, margin: 0.1 }
    }
}

/// Where a chip was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChipPlace {
    /// Column and row of the point in the image.
    pub place: [f64; 2],
    /// Correlation there.
    pub score: f32,
}

/// Why a chip was not found.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ChipMiss {
    /// The chip has no texture, or reaches too little around its point.
    #[error("the chip has too little around its point, or no texture")]
    Useless,
    /// The image has no valid pixels around the expected place.
    #[error("the image has no valid pixels where the point is expected")]
    NoPixels,
    /// Nothing looks like the chip.
    #[error("nothing looks like the chip: the best correlation is {score:.2}, needed is {needed:.2}")]
    Unlike {
        /// Best correlation.
        score: f32,
        /// Least correlation that is trusted.
        needed: f32,
    },
    /// Several places look like the chip.
    #[error(
        "several places look like the chip: correlations {score:.2} and {other:.2}, needed is a lead of {margin:.2}"
    )]
    Ambiguous {
        /// Best correlation.
        score: f32,
        /// Correlation of the second peak.
        other: f32,
        /// Lead that is needed.
        margin: f32,
    },
    /// Least-squares matching leaves the best place, or does not come to an end.
    #[error("the chip cannot be laid over the image to a fraction of a pixel")]
    Unsettled,
    /// The best place lies at the edge of the search.
    #[error("the best place lies at the edge of the search, {reach_px:.0} px from where the point is expected")]
    AtEdge {
        /// Radius of the search, pixels of the image.
        reach_px: f64,
    },
}

/// Finds a chip in an image.
///
/// # Errors
/// [`ChipMiss`]: the reason for which no place is trusted.
pub fn find_chip(chip: Chip<'_>, search: &ChipSearch<'_>, config: &ChipConfig) -> Result<ChipPlace, ChipMiss> {
    let (mut search, mut point) = (*search, chip.point);
    let (mut small, mut image) = (Cow::Borrowed(chip.image), Cow::Borrowed(search.image));
    let mut halved = 0;
    if !SCALES.contains(&scale(&search)) {
        return Err(ChipMiss::Useless);
    }
    // The finer of both is brought to about the pixels of the other.
    while scale(&search) <= 0.5 {
        small = Cow::Owned(reduce(&small));
        point = point.map(|v| level_from_level0(v, 1));
        search.image_from_chip = search.image_from_chip.map(|row| row.map(|v| 2.0 * v));
    }
    while scale(&search) >= 2.0 && halved < HALVED_MAX {
        image = Cow::Owned(reduce(&image));
        search.expected = search.expected.map(|v| level_from_level0(v, 1));
        search.image_from_chip = search.image_from_chip.map(|row| row.map(|v| 0.5 * v));
        search.reach_px *= 0.5;
        halved += 1;
    }
    let found = find(Chip { image: &small, point }, &ChipSearch { image: &image, ..search }, config)?;
    Ok(ChipPlace { place: found.place.map(|v| level0_from_level(v, halved)), ..found })
}

/// Returns the pixels of the image in a pixel of the chip, as a side.
fn scale(search: &ChipSearch<'_>) -> f64 {
    let [[a, b], [c, d]] = search.image_from_chip;
    (a * d - b * c).abs().sqrt()
}

/// Finds a chip whose pixels are about as large as those of the image.
fn find(chip: Chip<'_>, search: &ChipSearch<'_>, config: &ChipConfig) -> Result<ChipPlace, ChipMiss> {
    let reach = half_width(chip).filter(|reach| *reach >= config.radius_min).ok_or(ChipMiss::Useless)?;
    let radius = clear_radius(chip.image, chip.point, [config.radius_min, reach.min(config.radius_max)]);
    let radius = radius.ok_or(ChipMiss::Useless)? as i32;
    let own = MaskedPatch::around(chip.image, chip.point, radius).ok_or(ChipMiss::Useless)?;
    let whole = Patch::around(chip.image, chip.point, radius, 0.0).filter(|_| own.is_whole());
    let reach = (search.reach_px / scale(search)).ceil().max(2.0) as i32;
    let scores = correlations((&own, whole.as_ref()), radius, search, reach);
    let (side, data) = (scores.width(), scores.data());
    let best = (0..data.len()).max_by(|i, j| data[*i].total_cmp(&data[*j])).ok_or(ChipMiss::NoPixels)?;
    let (i, j, score) = (best % side, best / side, data[best]);
    if score == NO_PIXELS {
        return Err(ChipMiss::NoPixels);
    }
    if score < config.score {
        return Err(ChipMiss::Unlike { score, needed: config.score });
    }
    if [i, j].iter().any(|k| *k == 0 || *k == side - 1) {
        return Err(ChipMiss::AtEdge { reach_px: search.reach_px });
    }
    let others = (1..side - 1).flat_map(|v| (1..side - 1).map(move |u| (u, v)));
    let others = others.filter(|&at| at != (i, j) && scores.is_peak(at)).map(|at| scores[at]);
    let other = others.fold(NO_PIXELS, f32::max);
    if score - other < config.margin {
        return Err(ChipMiss::Ambiguous { score, other, margin: config.margin });
    }
    let start = search.moved(search.expected, [i, j].map(|k| k as f64 - f64::from(reach)));
    let place = fit(chip, search, start, radius).ok_or(ChipMiss::Unsettled)?;
    Ok(ChipPlace { place, score })
}

/// Returns how far a chip reaches around its point on all sides, with a margin for resampling.
fn half_width(chip: Chip<'_>) -> Option<usize> {
    let (width, height) = (chip.image.width() as f64, chip.image.height() as f64);
    let [x, y] = chip.point;
    let reach = x.min(width - 1.0 - x).min(y).min(height - 1.0 - y).floor() - 2.0;
    (reach >= 0.0).then_some(reach as usize)
}

/// Pixels of the image in a pixel of the chip, as a side, that can be compared.
const SCALES: std::ops::RangeInclusive<f64> = 1e-2..=1e2;
/// Most times that an image is halved. A chip with still larger pixels tells no place.
const HALVED_MAX: u32 = 4;

/// Returns the correlations at the places around the expected one, a chip's pixel apart and up to
/// `reach` of them away. A chip without hidden pixels in an image without any goes the shorter way.
fn correlations(
    (own, whole): (&MaskedPatch, Option<&Patch>),
    radius: i32,
    search: &ChipSearch<'_>,
    reach: i32,
) -> Grid<f32> {
    let (patch, side) = (2 * radius as usize + 1, 2 * reach as usize + 1);
    let far = radius + reach;
    let length = 2 * far as usize + 1;
    let mut resampled = Grid::filled(length + padded(patch) - patch, length, f32::NAN);
    let [[a, _], [c, _]] = search.image_from_chip;
    for j in 0..length {
        let line = search.moved(search.expected, [-f64::from(far), j as f64 - f64::from(far)]);
        bicubic_along(search.image, line, [a, c], &mut resampled.row_mut(j)[..length]);
    }
    remove_mean(resampled.data_mut());
    let is_clear = (0..length).all(|j| resampled.row(j)[..length].iter().all(|v| v.is_finite()));
    let scores = match whole.filter(|_| is_clear) {
        Some(patch) => patch.correlations(resampled, 0.0),
        None => own.correlations(&resampled),
    };
    scores.window(Window { x: 0, y: 0, width: side, height: side }, NO_PIXELS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use numeric::RandomByIndex;

    /// A smooth random surface, sampled at any place.
    fn texture(x: f64, y: f64) -> f64 {
        let random = RandomByIndex::new(7, 0);
        (0..40)
            .map(|k| {
                let at = |i: u64| random.uniform(6 * k + i);
                let (fx, fy) = (0.3 * (at(0) - 0.5), 0.3 * (at(1) - 0.5));
                (std::f64::consts::TAU * (fx * x + fy * y + at(2))).sin() * 10.0
            })
            .sum()
    }

    fn raster(width: usize, height: usize, value: impl Fn(f64, f64) -> f64) -> Grid<f32> {
        let cells = (0..width * height).map(|i| value((i % width) as f64, (i / width) as f64) as f32).collect();
        Grid::from_vec(width, height, cells).unwrap()
    }

    const TURNED: [[f64; 2]; 2] = [[0.9, 0.2], [-0.25, 1.1]];

    /// The chip shows what the image shows, turned, stretched and with other grey values.
    fn chip() -> Grid<f32> {
        let [[a, b], [c, d]] = TURNED;
        raster(41, 37, |x, y| {
            let (i, j) = (x - 20.25, y - 18.5);
            300.0 + 0.4 * texture(101.3 + a * i + b * j, 88.6 + c * i + d * j)
        })
    }

    fn search(image: &Grid<f32>) -> ChipSearch<'_> {
        ChipSearch { image, expected: [93.0, 99.0], reach_px: 20.0, image_from_chip: TURNED }
    }

    #[test]
    fn a_chip_is_found_to_a_hundredth_of_a_pixel() {
        let (image, chip) = (raster(200, 190, texture), chip());
        let chip = Chip { image: &chip, point: [20.25, 18.5] };
        let found = find_chip(chip, &search(&image), &ChipConfig::default()).unwrap();
        let [x, y] = found.place;
        assert!((x - 101.3).hypot(y - 88.6) < 0.01 && found.score > 0.99, "{found:?}");
    }

    #[test]
    fn hidden_pixels_of_the_chip_and_of_the_image_do_not_count() {
        let hidden = |x: f64, y: f64| (x - 24.0).abs() < 4.0 && y > 15.0;
        let chip =
            raster(41, 37, |x, y| if hidden(x, y) { f64::NAN } else { f64::from(chip()[(x as usize, y as usize)]) });
        let shadow = |x: f64, y: f64| x > 108.0 && y < 82.0;
        let image = raster(200, 190, |x, y| if shadow(x, y) { f64::NAN } else { texture(x, y) });
        let chip = Chip { image: &chip, point: [20.25, 18.5] };
        let found = find_chip(chip, &search(&image), &ChipConfig::default()).unwrap();
        let [x, y] = found.place;
        assert!((x - 101.3).hypot(y - 88.6) < 0.02 && found.score > 0.98, "{found:?}");
    }

    #[test]
    fn places_that_cannot_be_trusted_have_reasons() {
        let (image, chip) = (raster(200, 190, texture), chip());
        let find = |chip: &Grid<f32>, point: [f64; 2], search: &ChipSearch<'_>| {
            find_chip(Chip { image: chip, point }, search, &ChipConfig::default()).unwrap_err()
        };
        let point = [20.25, 18.5];
        let near = search(&image);
        assert_eq!(find(&chip, [1.5, 1.5], &near), ChipMiss::Useless);
        assert_eq!(find(&chip.map(|_| 3.0), point, &near), ChipMiss::Useless);
        assert_eq!(find(&chip, point, &ChipSearch { expected: [-500.0, 20.0], ..near }), ChipMiss::NoPixels);
        let elsewhere = ChipSearch { expected: [60.0, 150.0], reach_px: 12.0, ..near };
        assert!(matches!(find(&chip, point, &elsewhere), ChipMiss::Unlike { .. }));
        let short = ChipSearch { reach_px: 9.0, ..near };
        assert!(matches!(find(&chip, point, &short), ChipMiss::AtEdge { .. } | ChipMiss::Unlike { .. }));
        // Rows of houses repeat.
        let row = |x: f64, y: f64| texture(x.rem_euclid(14.0), y) + 0.01 * x;
        let (houses, house) = (raster(200, 190, row), raster(41, 41, |x, y| row(x + 70.0, y + 70.0)));
        let straight = [[1.0, 0.0], [0.0, 1.0]];
        let along = ChipSearch { image: &houses, expected: [92.0, 91.0], reach_px: 20.0, image_from_chip: straight };
        assert!(matches!(find(&house, [20.0, 20.0], &along), ChipMiss::Ambiguous { .. }));
    }
}
