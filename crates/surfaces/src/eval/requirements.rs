//! Requirements that an evaluation must meet. A missed requirement is reported; it is not an error.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::error::EvalJobError;
use job::error::SettingError;

/// Requirements on the result of an evaluation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvalRequirements {
    /// Largest mean absolute error, metres; for surfaces the mean distance of the test to the
    /// reference, for normals the mean angle in degrees.
    pub max_mae: Option<f64>,
    /// Least completeness at some thresholds.
    pub min_completeness: Vec<MinCompleteness>,
}

/// A completeness that must be reached.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MinCompleteness {
    /// Threshold of the absolute error, metres.
    pub threshold_m: f64,
    /// Least share of the cells, 0 to 1.
    pub share: f64,
}

impl FromStr for MinCompleteness {
    type Err = String;

    /// Reads `THRESHOLD=SHARE`, or `SHARE` for a threshold of 1 m.
    fn from_str(text: &str) -> Result<Self, String> {
        let (threshold, share) = text.split_once('=').unwrap_or(("1", text));
        let number = |part: &str| part.trim().parse::<f64>().map_err(|_| format!("\"{part}\" is not a number"));
        let (threshold_m, share) = (number(threshold)?, number(share)?);
        if !(0.0..=1.0).contains(&share) {
            return Err(format!("{share} is not a share: expected 0 to 1"));
        }
        Ok(Self { threshold_m, share })
    }
}

impl EvalRequirements {
    /// Checks that the requirements are numbers in their ranges.
    pub(super) fn validate(&self) -> Result<(), EvalJobError> {
        if let Some(max_mae) = self.max_mae.filter(|mae| mae.is_nan() || *mae < 0.0) {
            return Err(SettingError::new("the largest allowed mean error", max_mae, "a number of metres").into());
        }
        let outside = |least: &&MinCompleteness| !(0.0..=1.0).contains(&least.share);
        match self.min_completeness.iter().find(outside) {
            Some(least) => Err(SettingError::new("the least completeness", least.share, "a share from 0 to 1").into()),
            None => Ok(()),
        }
    }

    /// Returns the thresholds together with those that the requirements need, sorted and without
    /// repetition.
    pub(super) fn with_thresholds(&self, mut thresholds_m: Vec<f64>) -> Vec<f64> {
        thresholds_m.extend(self.min_completeness.iter().map(|least| least.threshold_m));
        thresholds_m.sort_by(f64::total_cmp);
        thresholds_m.dedup();
        thresholds_m
    }
}
