//! What kind of failure an error is, for callers that react to it: the command line with a hint,
//! Python with the class of an exception, a page with advice.
//!
//! An error says its kind itself. Its causes cannot be asked for it: an error that only passes on
//! another one (`#[error(transparent)]`) hides the type of that one from
//! [`source`](std::error::Error::source).

use crate::Cancelled;

/// What kind of failure an error is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// A setting or an array that cannot be used.
    Input,
    /// A file cannot be read or written.
    File,
    /// An output exists and may not be replaced.
    OutputExists,
    /// Another process has the output folder for itself, or works in it.
    InUse,
    /// A coordinate reference system or a vertical datum cannot be used.
    Crs,
    /// A geoid grid is needed that PROJ does not find and that may not be fetched.
    GridMissing,
    /// An input lies on a network, which may not be read.
    RemoteRefused,
    /// The job was asked to stop.
    Cancelled,
    /// Another reason why there is no result.
    Other,
}

/// An error that says what kind of failure it is.
pub trait Failure: std::error::Error {
    /// Returns the kind.
    fn kind(&self) -> Kind;
}

/// Implements [`Failure`] for errors: one kind, and the variants that are of another kind.
///
/// ```
/// use numeric::{Failure, Kind, failures};
///
/// #[derive(Debug, thiserror::Error)]
/// enum RoadError {
///     #[error("cannot read the roads")]
///     Unreadable,
///     #[error("the width is {0} m, expected a positive number")]
///     Width(f64),
/// }
///
/// failures!(RoadError: File { Self::Width(_) => Kind::Input });
/// assert_eq!(RoadError::Unreadable.kind(), Kind::File);
/// assert_eq!(RoadError::Width(-1.0).kind(), Kind::Input);
/// ```
#[macro_export]
macro_rules! failures {
    ($($error:ty: $all:ident $({ $($variant:pat => $kind:expr),+ $(,)? })?),+ $(,)?) => {$(
        impl $crate::Failure for $error {
            fn kind(&self) -> $crate::Kind {
                $(match self {
                    $($variant => return $kind,)+
                    #[allow(unreachable_patterns, reason = "the named variants may be all that there are")]
                    _ => {}
                })?
                $crate::Kind::$all
            }
        }
    )+};
}

failures!(Cancelled: Cancelled);
