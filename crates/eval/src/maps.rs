//! Comparison of maps in the pixels of one camera: depths, normals, masks.
//!
//! A depth is valid if it is finite and above zero; misses are written as 0, NaN or infinity. A
//! normal is valid if it is finite and not zero, whatever its length. Errors are test − reference
//! over the pixels where both are valid. The IoU of the valid pixels measures how far both maps
//! agree on where something is. Both maps list their pixels in the same order.

use serde::Serialize;

use numeric::percentile;
use numeric::vector::unit;

/// Base of the thresholds δ₁, δ₂, δ₃ (Eigen, Puhrsch, Fergus 2014).
const DELTA: f64 = 1.25;

/// The two maps have different sizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the test has {test} pixels and the reference {reference}: expected maps of one camera")]
pub struct MapSizeError {
    /// Number of pixels of the test.
    pub test: usize,
    /// Number of pixels of the reference.
    pub reference: usize,
}

/// Number of pixels with a value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PixelCounts {
    /// Number of all pixels.
    pub pixels: usize,
    /// Number of pixels with a value in the test.
    pub test: usize,
    /// Number of pixels with a value in the reference.
    pub reference: usize,
    /// Number of pixels with a value in both.
    pub both: usize,
    /// `both` divided by the number of pixels with a value in either; 1 if neither has any.
    pub iou: f64,
}

/// Comparison of two depth maps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DepthComparison {
    /// Pixels with a depth.
    pub valid: PixelCounts,
    /// Errors over the pixels with both depths. `None` if there are no such pixels.
    pub errors: Option<DepthErrors>,
}

/// Errors of depths, in the unit of the maps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DepthErrors {
    /// Mean.
    pub bias: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Root mean square.
    pub rmse: f64,
    /// Median absolute error.
    pub median_abs: f64,
    /// Largest absolute error.
    pub max_abs: f64,
    /// Mean of |e| divided by the reference.
    pub abs_rel: f64,
    /// Shares of pixels where the larger depth divided by the smaller one is below 1.25, 1.25²,
    /// 1.25³.
    pub delta: [f64; 3],
}

/// Comparison of two normal maps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NormalComparison {
    /// Pixels with a normal.
    pub valid: PixelCounts,
    /// Angles over the pixels with both normals. `None` if there are no such pixels.
    pub angles: Option<AngleErrors>,
}

/// Angles between normals, degrees from 0 to 180.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AngleErrors {
    /// Mean.
    pub mean_deg: f64,
    /// Median.
    pub median_deg: f64,
    /// Root mean square.
    pub rmse_deg: f64,
    /// Largest.
    pub max_deg: f64,
    /// Shares of angles below 11.25°, 22.5° and 30°.
    pub within: [f64; 3],
}

/// Comparison of two masks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MaskComparison {
    /// Pixels that are set.
    pub set: PixelCounts,
    /// Share of the test's pixels that the reference has; 1 if the test has none.
    pub precision: f64,
    /// Share of the reference's pixels that the test has; 1 if the reference has none.
    pub recall: f64,
}

/// Compares two depth maps.
///
/// ```
/// let found = eval::compare_depths(&[1.0, 0.0, 3.0], &[1.5, 2.0, 3.0])?;
/// assert_eq!((found.valid.both, found.errors.map(|e| e.mae)), (2, Some(0.25)));
/// # Ok::<(), eval::MapSizeError>(())
/// ```
///
/// # Errors
/// [`MapSizeError`] if the maps have different sizes.
pub fn compare_depths(test: &[f64], reference: &[f64]) -> Result<DepthComparison, MapSizeError> {
    same_size(test.len(), reference.len())?;
    let there = |depth: f64| depth.is_finite() && depth > 0.0;
    let valid = PixelCounts::of(test.iter().zip(reference).map(|(&t, &r)| (there(t), there(r))));
    let pairs = || test.iter().zip(reference).map(|(&t, &r)| (t, r)).filter(|&(t, r)| there(t) && there(r));
    let n = valid.both as f64;
    let mean = |of: &dyn Fn(f64, f64) -> f64| pairs().map(|(t, r)| of(t, r)).sum::<f64>() / n;
    let mut absolute: Vec<f64> = pairs().map(|(t, r)| (t - r).abs()).collect();
    let max_abs = absolute.iter().copied().fold(0.0, f64::max);
    let within = |power: i32| {
        let most = DELTA.powi(power);
        pairs().filter(|(t, r)| (t / r).max(r / t) < most).count() as f64 / n
    };
    let errors = percentile(&mut absolute, 50.0).map(|median_abs| DepthErrors {
        bias: mean(&|t, r| t - r),
        mae: mean(&|t, r| (t - r).abs()),
        rmse: mean(&|t, r| (t - r).powi(2)).sqrt(),
        median_abs,
        max_abs,
        abs_rel: mean(&|t, r| (t - r).abs() / r),
        delta: [within(1), within(2), within(3)],
    });
    Ok(DepthComparison { valid, errors })
}

/// Compares two normal maps.
///
/// # Errors
/// [`MapSizeError`] if the maps have different sizes.
pub fn compare_normals(test: &[[f64; 3]], reference: &[[f64; 3]]) -> Result<NormalComparison, MapSizeError> {
    same_size(test.len(), reference.len())?;
    let pairs = || test.iter().zip(reference).map(|(&t, &r)| (unit(t), unit(r)));
    let valid = PixelCounts::of(pairs().map(|(t, r)| (t.is_some(), r.is_some())));
    let angle = |(t, r): (Option<[f64; 3]>, Option<[f64; 3]>)| Some(between_deg(t?, r?));
    let mut angles: Vec<f64> = pairs().filter_map(angle).collect();
    let n = angles.len() as f64;
    let mean_deg = angles.iter().sum::<f64>() / n;
    let rmse_deg = (angles.iter().map(|a| a * a).sum::<f64>() / n).sqrt();
    let max_deg = angles.iter().copied().fold(0.0, f64::max);
    let within = [11.25, 22.5, 30.0].map(|most| angles.iter().filter(|&&a| a < most).count() as f64 / n);
    let angles =
        percentile(&mut angles, 50.0).map(|median_deg| AngleErrors { mean_deg, median_deg, rmse_deg, max_deg, within });
    Ok(NormalComparison { valid, angles })
}

/// Compares two masks.
///
/// ```
/// let found = eval::compare_masks(&[true, true, false], &[true, false, false])?;
/// assert_eq!((found.precision, found.recall), (0.5, 1.0));
/// # Ok::<(), eval::MapSizeError>(())
/// ```
///
/// # Errors
/// [`MapSizeError`] if the masks have different sizes.
pub fn compare_masks(test: &[bool], reference: &[bool]) -> Result<MaskComparison, MapSizeError> {
    same_size(test.len(), reference.len())?;
    let set = PixelCounts::of(test.iter().copied().zip(reference.iter().copied()));
    let share = |of: usize| if of == 0 { 1.0 } else { set.both as f64 / of as f64 };
    Ok(MaskComparison { set, precision: share(set.test), recall: share(set.reference) })
}

impl PixelCounts {
    fn of(pixels: impl Iterator<Item = (bool, bool)>) -> Self {
        let mut counts = Self { pixels: 0, test: 0, reference: 0, both: 0, iou: 1.0 };
        for (test, reference) in pixels {
            counts.pixels += 1;
            counts.test += usize::from(test);
            counts.reference += usize::from(reference);
            counts.both += usize::from(test && reference);
        }
        let either = counts.test + counts.reference - counts.both;
        if either > 0 {
            counts.iou = counts.both as f64 / either as f64;
        }
        counts
    }
}

fn same_size(test: usize, reference: usize) -> Result<(), MapSizeError> {
    if test == reference { Ok(()) } else { Err(MapSizeError { test, reference }) }
}

/// Returns the angle between two unit vectors, degrees. It is computed from the chord, because the
/// arc cosine loses small angles.
fn between_deg(a: [f64; 3], b: [f64; 3]) -> f64 {
    let length = |sign: f64| (0..3).map(|i| (a[i] + sign * b[i]).powi(2)).sum::<f64>().sqrt();
    (2.0 * length(-1.0).atan2(length(1.0))).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misses_are_left_out_of_errors_and_counted() {
        let found = compare_depths(&[1.0, f64::INFINITY, 3.0, 0.0, 2.0], &[1.5, 2.0, 2.0, f64::NAN, 2.0]).unwrap();
        assert_eq!((found.valid.test, found.valid.reference, found.valid.both, found.valid.iou), (3, 4, 3, 0.75));
        let errors = found.errors.unwrap();
        assert!((errors.mae - 0.5).abs() < 1e-12 && (errors.bias - 0.5 / 3.0).abs() < 1e-12, "{errors:?}");
        assert_eq!((errors.max_abs, errors.median_abs), (1.0, 0.5));
        assert!((errors.delta[0] - 1.0 / 3.0).abs() < 1e-12 && errors.delta[2] == 1.0);
        let nothing = compare_depths(&[0.0], &[1.0]).unwrap();
        assert_eq!((nothing.errors, nothing.valid.iou), (None, 0.0));
        assert_eq!(compare_depths(&[1.0], &[]), Err(MapSizeError { test: 1, reference: 0 }));
    }

    #[test]
    fn angles_are_exact_where_they_are_small() {
        let tilt = 1e-9f64;
        let test = [[0.0, tilt.sin(), tilt.cos()], [0.0, 0.0, 2.0], [0.0; 3], [0.0, 0.0, -1.0]];
        let found = compare_normals(&test, &[[0.0, 0.0, 1.0]; 4]).unwrap();
        let angles = found.angles.unwrap();
        assert_eq!((found.valid.both, angles.max_deg), (3, 180.0));
        assert!((angles.median_deg - tilt.to_degrees()).abs() < 1e-12);
        assert!((angles.within[0] - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!(compare_normals(&[[0.0; 3]], &[[0.0; 3]]).unwrap().angles, None);
    }

    #[test]
    fn masks_overlap() {
        let found = compare_masks(&[true, true, false, false], &[true, false, true, false]).unwrap();
        assert_eq!((found.set.iou, found.precision, found.recall), (1.0 / 3.0, 0.5, 0.5));
        let empty = compare_masks(&[false], &[false]).unwrap();
        assert_eq!((empty.set.iou, empty.precision, empty.recall), (1.0, 1.0, 1.0));
    }
}
