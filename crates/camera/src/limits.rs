//! Limits within which an RPC is evaluated: the distance from its domain, and the distance from a
//! pole.

use crate::CameraError;

/// Denominators smaller than this count as poles. Real sensors keep them within a few percent of 1.
pub(crate) const DENOMINATOR_MIN: f64 = 1e-6;

/// Largest normalised longitude or latitude that is projected or returned.
///
/// The polynomials are fitted on [−1, 1]. Crops and tall scenes reach somewhat beyond it, and
/// several half-widths away the polynomials mean nothing.
pub const EXTRAPOLATION_MAX: f64 = 8.0;

/// Returns a longitude difference brought into ±180°, for longitudes given within ±360°.
#[inline(always)]
pub(crate) fn short_way(d_lon: f64) -> f64 {
    let shift = if d_lon > 180.0 {
        -360.0
    } else if d_lon < -180.0 {
        360.0
    } else {
        0.0
    };
    d_lon + shift
}

/// Checks that the numerator `n` and the denominator `d` have a finite quotient.
pub(crate) fn check_ratio(n: f64, d: f64) -> Result<(), CameraError> {
    if !(n.is_finite() && d.is_finite()) {
        return Err(CameraError::NotFinite);
    }
    if d.abs() < DENOMINATOR_MIN {
        return Err(CameraError::Denominator { denominator: d.abs() });
    }
    Ok(())
}

/// Checks that the normalised position (`l`, `p`) is close enough to the domain.
pub(crate) fn check_reach(l: f64, p: f64) -> Result<(), CameraError> {
    let normalised = l.abs().max(p.abs());
    if !(l.is_finite() && p.is_finite()) {
        return Err(CameraError::NotFinite);
    }
    if normalised > EXTRAPOLATION_MAX {
        return Err(CameraError::OutsideDomain { normalised, limit: EXTRAPOLATION_MAX });
    }
    Ok(())
}
