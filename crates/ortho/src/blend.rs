//! Values of a cell from all images that see it: the best image alone, a blend along the seams, or
//! the median.
//!
//! A feathered mosaic is the mosaic of the best images with its seams made soft: the weight of an
//! image in a cell is the share of the cells around that it gives, and images that do not see the
//! cell have none. The share is counted with a window that falls off linearly (two box filters, one
//! after the other), so weights change without a jump.

use raster::Grid;

/// How the values of the images become those of a mosaic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MosaicRule {
    /// The image that sees the cell most steeply.
    #[default]
    Best,
    /// The same, blended along the seams.
    Feather,
    /// The median of all images that see the cell, which leaves out what moved.
    Median,
}

impl MosaicRule {
    /// Every rule with its name and what it does.
    pub const CHOICES: [(&'static str, Self, &'static str); 3] = [
        ("best", Self::Best, "the image that sees the cell most steeply"),
        ("feather", Self::Feather, "the same, with soft seams"),
        ("median", Self::Median, "the median of all images that see the cell"),
    ];
}

/// Returns the median of the finite values: the mean of the middle two of an even number. NaN
/// without a finite value.
///
/// ```
/// assert_eq!(ortho::median_value(&mut [5.0, f32::NAN, 1.0, 9.0]), 5.0);
/// assert_eq!(ortho::median_value(&mut [4.0, 2.0]), 3.0);
/// ```
pub fn median_value(values: &mut [f32]) -> f32 {
    values.sort_unstable_by(f32::total_cmp);
    // Positive NaN is sorted behind every number.
    let known = values.partition_point(|v| v.is_finite());
    let known = &values[..known];
    numeric::middle_values(known).map_or(f32::NAN, |(a, b)| 0.5 * (a + b))
}

/// Returns the weight of one image in each cell, before the weights of all images are brought to a
/// sum of one. `gives` says where it is the best image, `sees` where it sees the cell; `radius` is
/// the distance to which its cells count, at least 1.
///
/// Where the image is the best, the weight is above 0, so a cell that an image sees has a weight.
pub fn feather_weight(gives: &Grid<bool>, sees: &Grid<bool>, radius: usize) -> Grid<f32> {
    let half = radius.div_ceil(2);
    let mut weight = gives.map(|&gives| if gives { 1.0 } else { 0.0 });
    for _ in 0..2 {
        weight = box_filter_rows(&weight, half);
        weight = box_filter_rows(&weight.transposed(), half).transposed();
    }
    for (weight, sees) in weight.data_mut().iter_mut().zip(sees.data()) {
        if !sees {
            *weight = 0.0;
        }
    }
    weight
}

/// Returns the means over windows of 2 `half` + 1 cells along the rows; cells outside count as 0.
fn box_filter_rows(values: &Grid<f32>, half: usize) -> Grid<f32> {
    let (width, height) = (values.width(), values.height());
    let share = 1.0 / (2 * half + 1) as f32;
    let mut out = Grid::filled(width, height, 0.0);
    let mut sums = vec![0.0f64; width + 1];
    for y in 0..height {
        for (x, value) in values.row(y).iter().enumerate() {
            sums[x + 1] = sums[x] + f64::from(*value);
        }
        for (x, out) in out.row_mut(y).iter_mut().enumerate() {
            let (from, to) = (x.saturating_sub(half), (x + half + 1).min(width));
            *out = (sums[to] - sums[from]) as f32 * share;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_cross_over_at_the_seam() {
        let left = Grid::from_vec(40, 40, (0..1600).map(|i| i % 40 < 20).collect()).unwrap();
        let right = left.map(|l| !l);
        let everywhere = Grid::filled(40, 40, true);
        let (a, b) = (feather_weight(&left, &everywhere, 8), feather_weight(&right, &everywhere, 8));
        let share = |x: usize| a[(x, 20)] / (a[(x, 20)] + b[(x, 20)]);
        assert!((share(9) - 1.0).abs() < 1e-6 && share(30) == 0.0, "far from the seam one image counts");
        assert!((share(19) + share(20) - 1.0).abs() < 1e-5, "both count alike at the seam");
        assert!((10..30).all(|x| share(x) >= share(x + 1) && share(x) - share(x + 1) < 0.15), "no jump");
    }

    #[test]
    fn an_image_that_does_not_see_a_cell_has_no_weight() {
        let gives = Grid::from_vec(3, 1, vec![true, true, false]).unwrap();
        let sees = Grid::from_vec(3, 1, vec![true, true, false]).unwrap();
        let weight = feather_weight(&gives, &sees, 1);
        assert!(weight[(0, 0)] > 0.0 && weight[(1, 0)] > 0.0 && weight[(2, 0)] == 0.0);
    }
}
