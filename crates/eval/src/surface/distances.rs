//! Statistics of distances and angles.

use serde::Serialize;

use numeric::percentile;

/// Distances from samples of one surface to the other, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DistanceStatistics {
    /// Number of samples.
    pub n: usize,
    /// Mean.
    pub mean_m: f64,
    /// Median.
    pub median_m: f64,
    /// Root of the mean square.
    pub rmse_m: f64,
    /// 90th percentile.
    pub le90_m: f64,
    /// 95th percentile.
    pub le95_m: f64,
    /// Largest distance.
    pub max_m: f64,
}

/// Shares of distances below a threshold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ThresholdScore {
    /// Threshold, metres.
    pub threshold_m: f64,
    /// Share of the test that is nearer than this to the reference.
    pub precision: f64,
    /// Share of the reference that is nearer than this to the test.
    pub recall: f64,
    /// Harmonic mean of precision and recall; 0 if both are 0.
    pub f_score: f64,
}

/// Angles between normals of the test and of the nearest place of the reference, degrees from 0 to
/// 90.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NormalAngle {
    /// Number of samples where both have a normal.
    pub n: usize,
    /// Mean.
    pub mean_deg: f64,
    /// Median.
    pub median_deg: f64,
    /// 90th percentile.
    pub p90_deg: f64,
}

impl DistanceStatistics {
    /// Computes the statistics of distances, which must not be empty. Their order is lost.
    pub(super) fn of(distances: &mut [f64]) -> Self {
        let n = distances.len();
        let count = n.max(1) as f64;
        let mean_m = distances.iter().sum::<f64>() / count;
        let rmse_m = (distances.iter().map(|d| d * d).sum::<f64>() / count).sqrt();
        let max_m = distances.iter().copied().fold(0.0, f64::max);
        let mut at = |p| percentile(distances, p).unwrap_or(f64::NAN);
        let [median_m, le90_m, le95_m] = [at(50.0), at(90.0), at(95.0)];
        Self { n, mean_m, median_m, rmse_m, le90_m, le95_m, max_m }
    }
}

impl ThresholdScore {
    pub(super) fn of(threshold_m: f64, accuracy: &[f64], completeness: &[f64]) -> Self {
        let share = |distances: &[f64]| {
            distances.iter().filter(|&&d| d < threshold_m).count() as f64 / distances.len().max(1) as f64
        };
        let (precision, recall) = (share(accuracy), share(completeness));
        let sum = precision + recall;
        let f_score = if sum > 0.0 { 2.0 * precision * recall / sum } else { 0.0 };
        Self { threshold_m, precision, recall, f_score }
    }
}

impl NormalAngle {
    /// Computes the statistics of angles, or `None` if there are none. Their order is lost.
    pub(super) fn of(angles_deg: &mut [f64]) -> Option<Self> {
        let n = angles_deg.len();
        let mean_deg = angles_deg.iter().sum::<f64>() / n as f64;
        let median_deg = percentile(angles_deg, 50.0)?;
        Some(Self { n, mean_deg, median_deg, p90_deg: percentile(angles_deg, 90.0)? })
    }
}
