//! Limits and checks of the parameters.

use crate::PriorsError;

/// Largest number of points.
pub(crate) const LIMIT: usize = 100_000_000;

/// Returns `value` when it is a positive, finite number.
pub(super) fn positive(name: &'static str, value: f64) -> Result<f64, PriorsError> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(PriorsError::Config { name, value, expected: "a positive number" })
    }
}
