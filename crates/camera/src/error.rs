//! Errors of projection and localisation, and of coefficients that do not form a camera.

use numeric::failures;

/// A point that cannot be projected or localised.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A coordinate is NaN or infinite.
    #[error("the coordinate is not a finite number")]
    NotFinite,
    /// A denominator of the RPC vanishes at this point.
    #[error("the RPC's denominator vanishes at this point (|denominator| = {denominator:e})")]
    Denominator {
        /// The value of the offending denominator.
        denominator: f64,
    },
    /// Newton's method did not reach the tolerance.
    #[error("localisation did not converge: {residual_px:.3} px left after {iterations} iterations")]
    NotConverged {
        /// Remaining distance in the image, pixels.
        residual_px: f64,
        /// Number of iterations.
        iterations: u32,
    },
    /// The ground point is so far from the RPC's validity domain that its polynomials mean nothing.
    #[error(
        "the ground point lies {normalised:.1} half-widths from the centre of the RPC's domain; at most {limit} are \
         accepted: is this image of that place?"
    )]
    OutsideDomain {
        /// The larger absolute value of the normalised longitude and latitude.
        normalised: f64,
        /// Largest accepted value.
        limit: f64,
    },
    /// The image position does not change in one direction on the ground, so that no inverse
    /// exists.
    #[error("the camera's Jacobian is singular at this point")]
    Singular,
}

failures!(CameraError: Input);

/// Coefficients that do not form a camera.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RpcError {
    /// An entry is NaN or infinite.
    #[error("{key} is {value}, expected a finite number")]
    NotFinite {
        /// RPC00B name of the entry.
        key: Key,
        /// Value found.
        value: f64,
    },
    /// A scale is zero.
    #[error("{key} is zero, expected a scale: the normalised coordinate would be infinite")]
    ZeroScale {
        /// RPC00B name of the entry.
        key: Key,
    },
    /// An offset is not a valid longitude or latitude.
    #[error("{key} is {value}°, expected an angle between −{limit}° and {limit}°")]
    Angle {
        /// RPC00B name of the entry.
        key: Key,
        /// Value found, degrees.
        value: f64,
        /// Largest absolute value, degrees.
        limit: f64,
    },
    /// A scale or an offset is larger than any sensor has.
    #[error("{key} is {value:e}, expected at most {limit:e} in size: no image has such an RPC")]
    Implausible {
        /// RPC00B name of the entry.
        key: Key,
        /// Value found.
        value: f64,
        /// Largest absolute value.
        limit: f64,
    },
    /// The image lies far outside of its own domain, which a wrong coefficient does.
    #[error(
        "the coefficients place a corner of the RPC's own domain {reach_px:e} px from its offset, \
         expected about the size of the image: a coefficient is wrong"
    )]
    Stretched {
        /// Largest distance along the line or the sample, pixels.
        reach_px: f64,
    },
    /// The first denominator coefficient is zero: a pole at the centre of the domain.
    #[error("{key} is zero, expected about 1: the model has a pole at its centre")]
    PoleAtCentre {
        /// RPC00B name of the entry.
        key: Key,
    },
    /// The image does not depend on both longitude and latitude at the centre.
    #[error(
        "the image does not depend on both longitude and latitude at the centre: the coefficients do not form a camera"
    )]
    Degenerate,
}

failures!(RpcError: Input);

/// The RPC00B name of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key {
    /// Name of the entry, such as `LINE_OFF` or `SAMP_NUM_COEFF`.
    pub name: &'static str,
    /// Number of the coefficient, from 1. `None` for entries that are not lists.
    pub number: Option<usize>,
}

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.number {
            Some(n) => write!(f, "{}_{n}", self.name),
            None => f.write_str(self.name),
        }
    }
}
