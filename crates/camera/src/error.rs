//! Why a camera could not answer, and why a set of coefficients is no camera.

/// Why a point has no image or no ground position.
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
        /// What was left, pixels.
        residual_px: f64,
        /// Iterations done.
        iterations: u32,
    },
    /// The ground point is so far from the RPC's validity domain that its polynomials mean nothing.
    #[error(
        "the ground point lies {normalised:.1} half-widths from the centre of the RPC's domain; at most {limit} are \
         accepted: is this image of that place?"
    )]
    OutsideDomain {
        /// The larger of the normalised longitude's and latitude's sizes.
        normalised: f64,
        /// What is accepted.
        limit: f64,
    },
    /// The image does not change in one direction on the ground, so that the inverse does not exist.
    #[error("the camera's Jacobian is singular at this point")]
    Singular,
}

/// Why coefficients are no usable RPC.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RpcError {
    /// An entry is NaN or infinite.
    #[error("{key} is {value}, expected a finite number")]
    NotFinite {
        /// RPC00B name of the entry, with the coefficient's number from 1 where there is one.
        key: Key,
        /// What was found.
        value: f64,
    },
    /// A scale is zero.
    #[error("{key} is zero, expected a scale: the normalised coordinate would be infinite")]
    ZeroScale {
        /// RPC00B name of the entry.
        key: Key,
    },
    /// An offset is no angle of its kind.
    #[error("{key} is {value}°, expected at most {limit}° in size")]
    Angle {
        /// RPC00B name of the entry.
        key: Key,
        /// What was found, degrees.
        value: f64,
        /// What is possible, degrees.
        limit: f64,
    },
    /// The first denominator coefficient is zero: a pole at the centre of the domain.
    #[error("{key} is zero, expected about 1: the model has a pole at its centre")]
    PoleAtCentre {
        /// RPC00B name of the entry.
        key: Key,
    },
    /// The image does not depend on both longitude and latitude at the centre.
    #[error("the image does not depend on both longitude and latitude at the centre: the coefficients are no camera")]
    Degenerate,
}

/// The RPC00B name of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key {
    /// Such as `LINE_OFF` or `SAMP_NUM_COEFF`.
    pub name: &'static str,
    /// Number of the coefficient, from 1.
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
